#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/slave/al_status.hpp"
#include "line/line.hpp"
#include "sequence.hpp"

// The masters of a line in virtual time. They act by frames, except that they map PDOs directly.
namespace servodrome::motion {

// Values that the master sends in process data.
struct ProcessValues {
  std::uint16_t controlword = 0;
  std::int8_t mode = 0;
  std::int32_t position = 0;
  std::int32_t velocity = 0;
  std::int16_t torque = 0;
  std::int32_t record = 0;  // 60C1h sub 1, which is not mapped

  // Returns false if the object is none of these.
  bool set(std::uint16_t index, std::int64_t value);
  std::int64_t get(std::uint16_t index) const;
};
inline constexpr std::array<std::uint16_t, 5> process_objects{0x6040, 0x6060, 0x607A, 0x60FF, 0x6071};

// Receives the frames that the axes send.
class FrameListener {
 public:
  virtual void heard(std::size_t axis, const canopen::Frame& frame, line::Time at) = 0;

 protected:
  ~FrameListener() = default;
};

class Master {
 public:
  virtual ~Master() = default;
  // Sets an axis up after power-on, up to the exchange of process data, as far as that is possible in one step.
  virtual void set_up(std::size_t axis, bool mapped) = 0;
  virtual void write(std::size_t axis, std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes,
                     bool pdo) = 0;
  virtual bool in_process_data(std::size_t axis, std::uint16_t index) const = 0;
  virtual void command(std::size_t axis, Kind kind, std::int64_t value) = 0;
  // One cycle of process data with or without SYNC.
  virtual void cycle(bool sync) = 0;
  // Called every ms between cycles. Returns true if a heartbeat was sent.
  virtual bool poll() = 0;
  // The axis has lost its power; set_up() follows after power-on.
  virtual void lost(std::size_t) {}
  ProcessValues& values(std::size_t axis) { return values_[axis]; }

 protected:
  explicit Master(line::Line& line) : line_(line), values_(line.axes().size()) {}
  line::Time now() const { return line_.now(); }

  line::Line& line_;
  std::vector<ProcessValues> values_;
};

class CanMaster final : public Master, public links::Receiver {
 public:
  CanMaster(line::Line& line, FrameListener& listener);
  ~CanMaster() override;

  void set_up(std::size_t axis, bool mapped) override;
  void write(std::size_t axis, std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes,
             bool pdo) override;
  bool in_process_data(std::size_t axis, std::uint16_t index) const override;
  void command(std::size_t axis, Kind kind, std::int64_t value) override;
  void cycle(bool sync) override;
  bool poll() override;

  void on_frame(const canopen::Frame& frame, line::Time at) override;
  links::PortId port() const { return port_; }
  std::uint64_t refused() const { return refused_; }

 private:
  struct Request {
    canopen::Frame frame;
  };
  struct Node {
    std::uint8_t id = 0;
    std::array<bool, process_objects.size()> mapped{};
    std::array<Request, 16> requests{};  // ring buffer of waiting SDO requests
    std::size_t first = 0;
    std::size_t waiting = 0;
    bool busy = false;
    line::Time deadline{};
  };
  void send(const canopen::Frame& frame);
  void send_pdo(std::size_t axis, std::uint16_t index);
  void next_request(Node& node);
  std::size_t axis_of(std::uint32_t id) const;

  FrameListener& listener_;
  links::CanBus& bus_;
  links::PortId port_{};
  std::vector<Node> nodes_;
  std::uint64_t refused_ = 0;
  line::Time heartbeat_{};  // 0: none
  line::Time next_heartbeat_{};
};

class EthercatMaster final : public Master {
 public:
  explicit EthercatMaster(line::Line& line, std::int64_t cycle_us, bool sync0);

  void set_up(std::size_t axis, bool mapped) override;
  void write(std::size_t axis, std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes,
             bool pdo) override;
  bool in_process_data(std::size_t axis, std::uint16_t index) const override;
  void command(std::size_t axis, Kind kind, std::int64_t value) override;
  void cycle(bool sync) override;
  bool poll() override;
  void lost(std::size_t axis) override { slaves_[axis].wanted = 0; }

 private:
  struct Mapped {
    std::uint16_t index;
    std::size_t at;
    unsigned bytes;
  };
  struct Slave {
    std::vector<Mapped> outputs;
    std::size_t output_bytes = 0;
    std::size_t input_bytes = 0;
    unsigned mail = 0;
    std::uint8_t wanted = 8;  // AL state that the master brings it to; 0: none
    std::uint8_t asked = 0;
  };
  // Sends one datagram in a frame of its own. Returns the working counter.
  unsigned send(ethercat::Command command, std::uint32_t address, std::span<const std::uint8_t> data);
  unsigned put(std::size_t axis, std::uint16_t offset, std::span<const std::uint8_t> data);
  void channel(std::size_t axis, unsigned number, std::uint16_t start, std::size_t length, std::uint8_t control);
  void lead(std::size_t axis);
  static std::uint16_t address(std::size_t axis) { return static_cast<std::uint16_t>(0U - axis); }

  links::EthercatBus& bus_;
  std::int64_t cycle_us_;
  bool sync0_;
  std::vector<Slave> slaves_;
  std::array<std::uint8_t, ethercat::max_frame> memory_{};
  std::array<std::uint8_t, 256> answer_{};
};

}  // namespace servodrome::motion
