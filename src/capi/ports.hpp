#pragma once

#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "api/scope/source.hpp"
#include "capi/open_line.hpp"
#include "links/can/memory_port.hpp"

// What a caller opens on a line, beside the line itself.
namespace servodrome::capi {

// The rows of a recording that never ends.
class Recorder final : public Item, private line::Follower {
 public:
  // Throws api::ApiError if too many values are sampled per tick. `channels` is not empty.
  Recorder(line::Line& line, const std::vector<const api::NamedChannel*>& channels, std::int64_t stride);
  ~Recorder() override;

  std::size_t columns() const { return samples_.size(); }
  // The number of rows so far.
  std::size_t rows();
  std::int64_t first_tick() const { return first_; }
  // Row after row.
  std::span<const double> values() const { return values_; }

 private:
  // line::Follower
  Time next_deadline() const override { return next_fetch_; }
  void reached(Time now) override;

  void fetch(Time now);

  line::Line& line_;
  std::vector<std::shared_ptr<api::Samples>> samples_;
  std::int64_t stride_;
  std::int64_t first_ = 0;  // tick of the first row
  std::int64_t next_ = 0;   // tick of the next row
  Time next_fetch_{};
  std::vector<double> values_;
};

class CanPort final : public Port {
 public:
  explicit CanPort(links::CanBus& bus) : bus_(bus), port_(bus, most_waiting) {}

  bool ready(Time) const override { return port_.waiting() > 0; }
  bool send(const canopen::Frame& frame, Time now) { return port_.send(frame, now); }
  links::ErrorState state() const { return bus_.error_state(port_.port()); }
  // There must be a frame (ready). `lost`: frames before it were lost.
  links::TimedFrame take(bool& lost);

 private:
  static constexpr std::size_t most_waiting = 16384;

  const links::CanBus& bus_;
  links::MemoryPort port_;
  std::uint64_t lost_ = 0;  // frames whose loss was reported
};

class BytePort final : public Port, private links::SerialStation {
 public:
  explicit BytePort(links::SerialLine& line) : line_(line), port_(line.attach(*this)) {}
  ~BytePort() override { line_.detach(port_); }

  bool ready(Time) const override { return !received_.empty(); }
  void configure(const modbus::CharacterFormat& format) { line_.set_format(port_, format); }
  void send(std::span<const std::uint8_t> bytes, Time now) { line_.transmit(port_, bytes, now); }
  // Copies and removes as many bytes as fit. Returns their number.
  std::size_t take_into(std::span<std::uint8_t> into);

 private:
  void receive(std::uint8_t character, bool intact, Time at) override;

  links::SerialLine& line_;
  links::SerialPortId port_;
  std::deque<std::uint8_t> received_;
};

// One of the two ports of an EtherCAT master. A frame that leaves the segment at the other side goes to the port there,
// if it is open.
class EthernetPort final : public Port {
 public:
  EthernetPort(links::EthercatBus& bus, links::EthercatBus::Port side);
  ~EthernetPort() override;

  bool ready(Time now) const override { return !returning_.empty() && returning_.front().at <= now; }
  Time arrival() const override { return returning_.empty() ? links::never : returning_.front().at; }
  // `other` is the port of the other side, or nullptr.
  void send(std::span<const std::uint8_t> frame, Time now, EthernetPort* other);
  // The frame that is ready.
  std::span<const std::uint8_t> front() const { return returning_.front().bytes; }
  void pop() { returning_.erase(returning_.begin()); }

  const links::EthercatBus& bus() const { return bus_; }
  links::EthercatBus::Port side() const { return side_; }

 private:
  struct Returning {
    Time at;
    std::vector<std::uint8_t> bytes;
  };
  void keep(Time at, std::vector<std::uint8_t> bytes);

  links::EthercatBus& bus_;
  links::EthercatBus::Port side_;
  std::vector<Returning> returning_;  // sorted by time
};

}  // namespace servodrome::capi
