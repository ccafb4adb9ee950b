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

#include "axis/axis402.hpp"
#include "studio/bus_samples.hpp"
#include "studio/bus_traffic.hpp"
#include "studio/cycle_sampler.hpp"
#include "studio/drives.hpp"
#include "studio/foreign_writes.hpp"
#include "studio/heard_pdos.hpp"
#include "studio/tpdo_recorder.hpp"

// Drives on a bus. The calls of `master` and `axis` block, so each bus has its own thread.
namespace servodrome::studio {

// An open bus and the drives on it.
class OpenBus {
 public:
  virtual ~OpenBus() = default;
  // In the order of the plan.
  virtual std::vector<master::ObjectClient*> drives() = 0;
  // Call it when a drive answers again after a silence, maybe after a reset. Throws MasterError.
  virtual void back(std::size_t drive) = 0;
  // Returns true if the drive has restarted since the opening or back(), even if no access failed meanwhile. The caller
  // must then call back().
  virtual bool has_restarted(std::size_t) const { return false; }
  // Restores the objects of the drive that this bus has changed for its own use, such as the supervision of this
  // program's heartbeat, so that the drive does not store them; back() sets them again.
  virtual void release(std::size_t drive) = 0;
  // Lets the bus run for `span`. Throws MasterError if the bus is lost.
  virtual void wait(master::Time span) = 0;

  // Calls `look` every few milliseconds while an access waits for its answer. The access ends with a MasterError as
  // soon as `look` returns true; `look` may access the other drives meanwhile. Only a CAN bus does this.
  virtual void while_waiting(std::function<bool()> look) = 0;

  // The exchange of a drive's process data; it runs as long as this object lives. On CAN it exchanges the given data,
  // on EtherCAT the data that the slave maps.
  struct Cyclic {
    std::unique_ptr<master::CyclicBus> bus;
    std::size_t drive;  // index of the drive in `bus`
  };
  virtual Cyclic open_cyclic(std::size_t drive, const master::CanDrive& exchanged) = 0;

  // The cycle that runs anyhow, of all drives in their order, for a caller that only watches its inputs; nullptr: there
  // is none. Valid as long as this object.
  virtual master::CyclicBus* cycle() { return nullptr; }

  // Sets up TPDOs of drives on CAN and sends SYNC with this period, as long as the result lives; then restores what the
  // drives had. `between` is called between two steps. Throws MasterError.
  virtual std::unique_ptr<master::CanCyclicBus> record(const std::vector<master::CanDrive>& drives, master::Time period,
                                                       const std::function<void()>& between);
  // Brings a node on CAN to pre-operational.
  virtual void to_pre_operational(std::size_t) {}
  // Asks a node on CAN that has no heartbeat for its state; nullopt: it does not answer, or must not be asked.
  virtual std::optional<bool> is_operational(std::size_t) { return std::nullopt; }

  // Runs `action` in a state in which the drive accepts changes of its process data. An EtherCAT bus must be reopened
  // afterwards. If its slaves no longer operate with the change, runs `undo` and throws the reason.
  using Action = std::function<void(master::ObjectClient& objects)>;
  virtual void configure(std::size_t drive, const Action& action, const Action& undo) = 0;

  // Calls `show` with the registers of the EtherCAT slave controllers that define the positions of process data. Does
  // nothing on other buses.
  using Registers = std::function<void(std::size_t drive, std::uint16_t station, std::uint16_t offset,
                                       std::span<const std::uint8_t> bytes)>;
  virtual void show_process_data(const Registers& show) = 0;

  // A device that answered a scan.
  struct Found {
    unsigned address;     // node-ID or position
    std::string name;     // 1008h, or that of the SII; may be empty
    std::string kind;     // for example "servo drive (CiA 402)"; "": not known
    std::string product;  // as `servodrome products` lists it; "": unknown
  };
  // Asks the bus which devices are on it, and changes nothing in them. Other accesses wait meanwhile, on CAN half a
  // second. Throws MasterError if the bus is lost or cannot be scanned.
  virtual std::vector<Found> scan() = 0;

  // The mechanism that stops a moving axis if this program dies or the link is lost. Empty: there is none, the axis
  // moves on.
  struct Watch {
    const char* by;
    double within_s;  // time until the axis begins to stop
  };
  virtual std::optional<Watch> watch_of(std::size_t drive) = 0;
};

struct DrivePlan {
  std::string name;      // of the axis
  std::string product;   // as `servodrome products` lists it; empty: unknown product
  unsigned address = 0;  // node-ID, position or station
};

struct BusPlan {
  std::string link;  // as in --bus
  std::string type;  // "can", "ethercat", "rs485"
  std::vector<DrivePlan> drives{};
  // Opens the bus with all drives of the plan, in their order; reports its traffic to `heard`. Throws std::exception.
  std::function<std::unique_ptr<OpenBus>(const links::Heard& heard)> open{};
};

// One access to an object. The thread of the bus carries it out.
struct Access {
  std::size_t drive = 0;
  master::ObjectAddress object{};
  bool writes = false;
  bool urgent = false;                         // comes before everything that waits
  std::vector<std::byte> bytes{};              // data to write, or data read
  bool size_is_known = true;                   // of the data read: ObjectClient::size_is_known
  std::optional<master::Time> longest_wait{};  // for an answer: ObjectClient::limit_wait
  std::exception_ptr error{};
  std::atomic<bool> done{false};      // bytes and error are valid
  std::atomic<bool> given_up{false};  // no caller waits for it any more: skip it
};

// A work item: a longer operation on a drive. The thread of the bus carries it out.
struct Work {
  // Returns true if the work item must end. The call also lets others use the bus, so it must be called often.
  using IsToEnd = std::function<bool()>;

  std::size_t drive = 0;
  std::function<void(OpenBus& bus, const IsToEnd& is_to_end)> carry_out{};
  bool reopens = false;  // the bus is reopened afterwards
  bool beside = false;   // short enough to run during another work item
  std::exception_ptr error{};
  std::atomic<bool> begun{false};
  std::atomic<bool> done{false};
  std::atomic<bool> cancelled{false};
};

class DriveBus {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr auto usual_poll = std::chrono::milliseconds(50);  // poll period of a drive's state
  static constexpr auto silent_poll = std::chrono::seconds(2);       // poll period of a drive that does not answer
  static constexpr auto reopen_period = std::chrono::seconds(1);     // period of attempts to reopen a lost bus

  struct DriveState {
    std::optional<JobError> problem;  // why the drive does not communicate
    master::AxisStatus status{};
    std::uint16_t controlword = 0;
    std::uint16_t error_code = 0;
    std::optional<OpenBus::Watch> watch{};
    Clock::time_point at{};
  };
  struct State {
    std::optional<JobError> problem;  // why the bus is not available
    std::vector<DriveState> drives;
    std::uint64_t accesses = 0;  // carried out
    std::uint64_t failed = 0;    // of these, without an answer
    std::uint64_t losses = 0;    // number of times the bus was lost
    double access_s = 0.001;     // smoothed duration of an access
  };

  // Opens the bus; throws what the plan's `open` throws. `start` is the time of tick 0.
  DriveBus(BusPlan plan, Clock::time_point start);
  ~DriveBus();
  DriveBus(const DriveBus&) = delete;
  DriveBus& operator=(const DriveBus&) = delete;

  const BusPlan& plan() const { return plan_; }
  BusTraffic& traffic() { return traffic_; }
  // What other masters have written to the drives since the last call, on CAN.
  std::vector<ForeignWrites::Write> take_foreign_writes() { return foreign_.take(); }
  State state() const;
  // Returns true if a work item for this drive waits or runs. The state of the drive may then change at any moment.
  bool is_worked_with(std::size_t drive) const;
  // Queues an access or a work item. An urgent access, a stop, comes before all others, cancels a running work item of
  // its drive, and refuses the waiting writes that would move the drive.
  void submit(std::shared_ptr<Access> access);
  void submit(std::shared_ptr<Work> work);
  // Refuses the waiting writes that would move the drive.
  void cancel_motion(std::size_t drive);
  void sample(const std::vector<std::shared_ptr<BusSamples>>& samples);
  const CycleSampler& cycle() const { return cycle_; }
  HeardPdos& pdos() { return pdos_; }
  // Sets up TPDOs for recordings. Only for a work item. Throws MasterError.
  void record(OpenBus& open, const TpdoRecorder::Wish& wish);
  bool records() const { return recorder_.runs(); }  // only for a work item
  // Sends the drive a quick stop when it answers again, because it may be moving: a stop has failed, or the connection
  // was lost after a client operated it.
  void stop_when_back(std::size_t drive);

 private:
  class Asking;
  // The accesses that may be carried out now.
  struct Choice {
    const Work* beside = nullptr;  // the running work item; after its cancellation no access to its drive is chosen
    bool urgent_only = false;
  };

  static JobError error_of(const std::exception& error, const std::string& where);
  links::Heard heard();
  void refuse_motion(std::size_t drive);
  bool has_urgent(std::size_t drive) const;
  bool look_around(OpenBus& open);
  void stop_now(std::size_t drive, master::ObjectClient& objects);
  void run(std::unique_ptr<OpenBus> open);
  // Returns true if the bus must be reopened.
  bool serve(OpenBus& open);
  std::shared_ptr<Access> next_access();
  std::shared_ptr<Work> next_work(bool beside = false);
  void carry_out(OpenBus& open, const std::shared_ptr<Access>& access);
  void serve_urgent(OpenBus& open);
  void store(OpenBus& open, const Access& access);
  std::deque<std::shared_ptr<Access>>::iterator first_ordinary();
  void carry_out(OpenBus& open, const std::shared_ptr<Work>& work);
  void serve_beside(OpenBus& open, const Work& work);
  bool sample_one(OpenBus& open);
  bool poll_one(OpenBus& open, bool silent_too = true);
  void lose(const std::exception& error);
  void note_access(bool answered, Clock::duration took);
  void note_silence(std::size_t drive, const JobError& problem, const std::exception_ptr& error);
  std::int64_t tick_of(Clock::time_point time) const;

  BusPlan plan_;
  Clock::time_point start_;
  BusTraffic traffic_;
  ForeignWrites foreign_;
  CycleSampler cycle_;
  HeardPdos pdos_;  // on CAN
  mutable std::mutex mutex_;
  std::condition_variable woken_;
  bool ending_ = false;
  std::deque<std::shared_ptr<Access>> waiting_;
  std::deque<std::shared_ptr<Work>> waiting_work_;
  std::shared_ptr<Work> running_work_;
  std::vector<std::weak_ptr<BusSamples>> sampled_;  // by reading
  State state_;

  // Used only by the thread of the bus
  TpdoRecorder recorder_{cycle_, pdos_};
  std::vector<master::Axis402> axes_;
  std::vector<Clock::time_point> next_poll_;
  std::vector<bool> silent_;
  std::vector<bool> stop_when_back_;
  Choice choice_{};
  Asking* asking_ = nullptr;  // the innermost
  std::thread thread_;
};

}  // namespace servodrome::studio
