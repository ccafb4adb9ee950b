#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/axis402.hpp"
#include "line/tap.hpp"
#include "studio/bus_traffic.hpp"
#include "studio/drives.hpp"

// Drives on a bus, reached by the host library, whose calls wait: each bus has a thread of its own.
namespace servodrome::studio {

// A bus that is open, and the drives behind it.
class OpenBus {
 public:
  virtual ~OpenBus() = default;
  // In the order in which they were asked for.
  virtual std::vector<host::ObjectClient*> drives() = 0;
  // A drive answers again that did not, maybe after a reset. Throws HostError.
  virtual void back(std::size_t drive) = 0;
  // Lets the bus run. Throws HostError when it is lost.
  virtual void wait(host::Time span) = 0;

  // The process data of a drive, exchanged as long as this lives; on CAN those that are named, on EtherCAT those that
  // the slave maps.
  struct Cyclic {
    std::unique_ptr<host::CyclicBus> bus;
    std::size_t drive;  // of that
  };
  virtual Cyclic open_cyclic(std::size_t drive, const host::CanDrive& exchanged) = 0;

  // Does `action` while the drive takes changes of its process data. An EtherCAT bus is to be opened anew after it; if
  // its slaves do not operate any more with what it did, `undo` is done and the reason thrown.
  using Action = std::function<void(host::ObjectClient& objects)>;
  virtual void configure(std::size_t drive, const Action& action, const Action& undo) = 0;

  // Registers of the drives' EtherCAT slave controllers that say what process data are where. Nothing on other buses.
  using Registers = std::function<void(std::size_t drive, std::uint16_t station, std::uint16_t offset,
                                       std::span<const std::uint8_t> bytes)>;
  virtual void show_process_data(const Registers& show) = 0;

  // What brings an axis to rest that moves when this program dies or its link is lost. Nothing: it goes on.
  struct Watch {
    const char* by;
    double within_s;  // begins to stop
  };
  virtual std::optional<Watch> watch_of(std::size_t drive) = 0;
};

struct DrivePlan {
  std::string name;      // of the axis
  std::string product;   // as `servodrome products` lists it; empty: none of ours
  unsigned address = 0;  // node-ID, position or station
};

struct BusPlan {
  std::string link;  // as --bus has it
  std::string type;  // "can", "ethercat", "rs485"
  std::vector<DrivePlan> drives{};
  // Opens it with all its drives, in this order; what passes is told. Throws std::exception.
  std::function<std::unique_ptr<OpenBus>(const links::Heard& heard)> open{};
};

// One access to an object, carried out by the thread of its bus.
struct Access {
  std::size_t drive = 0;
  host::ObjectAddress object{};
  bool writes = false;
  bool urgent = false;             // before everything that waits
  std::vector<std::byte> bytes{};  // to be written, or read
  std::exception_ptr error{};
  std::atomic<bool> done{false};      // bytes and error are there
  std::atomic<bool> given_up{false};  // no caller waits for it any more: it is left out
};

// Something longer that is done with a drive by the thread of its bus.
struct Work {
  // True: it is to end. Others use the bus while this is asked, so it is asked often.
  using IsToEnd = std::function<bool()>;

  std::size_t drive = 0;
  std::function<void(OpenBus& bus, const IsToEnd& is_to_end)> carry_out{};
  bool reopens = false;  // the bus is opened anew when it is over
  bool beside = false;   // takes so little time that it is done beside another
  std::exception_ptr error{};
  std::atomic<bool> begun{false};
  std::atomic<bool> done{false};
  std::atomic<bool> cancelled{false};
};

// Values of an object that the thread of a bus reads again and again, by the clock on the wall: the one read nearest to
// each multiple of the stride. What was not read in time is not a number.
class PolledSamples final : public line::Samples {
 public:
  // What the number is in the bytes of the object.
  using Decode = std::function<double(std::span<const std::byte> bytes)>;

  PolledSamples(std::size_t drive, host::ObjectAddress object, Decode decode, std::int64_t stride, std::int64_t first)
      : Samples(rows_),
        rows_(stride, first, 1),
        drive_(drive),
        object_(object),
        decode_(std::move(decode)),
        next_(first) {}

  std::size_t drive() const { return drive_; }
  host::ObjectAddress object() const { return object_; }

  // --- The thread of the bus
  std::int64_t wanted() const { return next_; }  // tick at which it is to be read next
  void note(std::int64_t tick, std::span<const std::byte> bytes);
  void skip(std::int64_t tick);  // it could not be read then

  // --- The thread of the server
  // All ticks before `end` are over.
  void advance(std::int64_t end);

 private:
  struct Value {
    std::int64_t tick;
    double value;
  };

  line::SampleRows rows_;
  std::size_t drive_;
  host::ObjectAddress object_;
  Decode decode_;
  std::int64_t next_;
  std::mutex mutex_;
  std::deque<Value> read_;
};

class DriveBus {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr auto usual_poll = std::chrono::milliseconds(50);  // of a drive's state
  static constexpr auto silent_poll = std::chrono::seconds(2);       // of one that does not answer
  static constexpr auto reopen_period = std::chrono::seconds(1);     // of a bus that is lost

  struct DriveState {
    std::optional<JobError> problem;  // why it cannot be spoken to
    host::AxisStatus status{};
    std::uint16_t controlword = 0;
    std::uint16_t error_code = 0;
    std::optional<OpenBus::Watch> watch{};
    Clock::time_point at{};
  };
  struct State {
    std::optional<JobError> problem;  // why the bus is not there
    std::vector<DriveState> drives;
    std::uint64_t accesses = 0;  // carried out
    std::uint64_t failed = 0;    // of them, without an answer
    std::uint64_t losses = 0;    // how often the bus went away
    double access_s = 0.001;     // that an access takes, lately
  };

  // Opens it; throws what the plan's `open` throws. `start`: of tick 0.
  DriveBus(BusPlan plan, Clock::time_point start);
  ~DriveBus();
  DriveBus(const DriveBus&) = delete;
  DriveBus& operator=(const DriveBus&) = delete;

  const BusPlan& plan() const { return plan_; }
  BusTraffic& traffic() { return traffic_; }
  State state() const;
  // A work with it waits or runs: its state may be another at once.
  bool is_worked_with(std::size_t drive) const;
  // `first`: before everything that waits.
  // An urgent one to a drive that is being worked with ends that work.
  void submit(std::shared_ptr<Access> access);
  void submit(std::shared_ptr<Work> work);
  void sample(const std::shared_ptr<PolledSamples>& samples);
  // What else is to be done with a drive when the bus comes back: it had been moving when it went away.
  void stop_when_back(std::size_t drive);

 private:
  void run(std::unique_ptr<OpenBus> open);
  // True: it is to be opened anew.
  bool serve(OpenBus& open);
  std::shared_ptr<Access> next_access(const Work* beside = nullptr, bool urgent_only = false);
  std::shared_ptr<Work> next_work(bool beside = false);
  void carry_out(OpenBus& open, Access& access);
  void carry_out(OpenBus& open, const std::shared_ptr<Work>& work);
  void serve_beside(OpenBus& open, const Work& work);
  bool sample_one(OpenBus& open);
  bool poll_one(OpenBus& open, bool silent_too = true);
  void lose(const std::exception& error);
  void note_access(bool answered, Clock::duration took);
  std::int64_t tick_of(Clock::time_point time) const;

  BusPlan plan_;
  Clock::time_point start_;
  BusTraffic traffic_;
  mutable std::mutex mutex_;
  std::condition_variable woken_;
  bool ending_ = false;
  std::deque<std::shared_ptr<Access>> waiting_;
  std::deque<std::shared_ptr<Work>> waiting_work_;
  std::shared_ptr<Work> running_work_;
  std::vector<std::weak_ptr<PolledSamples>> sampled_;
  State state_;

  // Of the thread
  std::vector<host::Axis402> axes_;
  std::vector<Clock::time_point> next_poll_;
  std::vector<bool> silent_;
  std::vector<bool> stop_when_back_;
  std::thread thread_;
};

}  // namespace servodrome::studio
