#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "api/scope/source.hpp"
#include "catalogue/product.hpp"
#include "line/registry.hpp"
#include "studio/commissioning.hpp"
#include "studio/drive_bus.hpp"
#include "studio/drive_changes.hpp"
#include "studio/drives.hpp"

namespace servodrome::studio {

// Drives on buses, for jobs, streams and the API. now() is real time, counted from the construction of this object. All
// calls come from the server's thread, and from tasks that run in its place.
class RealDrives final : public Drives, public api::Source, public Subjects {
 public:
  // After this delay all recorded values of a moment are available, or missed.
  static constexpr auto latency = std::chrono::milliseconds(40);
  static constexpr std::int64_t finest_reading = 160;  // ticks between two readings of an object: 100 Hz
  static constexpr std::int64_t finest_sent = 16;      // ticks between two rows of TPDOs: 1 kHz

  struct Axis {
    std::string name;
    std::size_t bus;
    std::size_t drive;  // of the bus
    unsigned address;
    std::string product;                       // product name; empty: unknown
    const line::Product* tables;               // its objects and bits; those of CiA 402 for an unknown product
    std::shared_ptr<products::Device> device;  // a device of `tables` that never runs, for its constant data
  };

  // Opens all buses. Throws what their `open` throws.
  explicit RealDrives(std::vector<BusPlan> plans);

  // Sets how callers wait from now on: the wait of the task that runs now.
  void set_wait(Wait wait) { wait_ = std::move(wait); }

  const std::vector<Axis>& all() const { return axes_; }
  const std::vector<std::unique_ptr<DriveBus>>& buses() const { return buses_; }
  const Axis* find(std::string_view name) const;
  DriveBus::DriveState state_of(const Axis& axis) const;
  // Registers of EtherCAT slaves that define the positions of their process data; empty for other buses and for a lost
  // bus. Waits with the present wait.
  struct ProcessDataRegisters {
    unsigned position;
    std::uint16_t station;
    std::uint16_t offset;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<ProcessDataRegisters> process_data_of(std::size_t bus);
  // Notes that a client of the API, or another master, commands the axis otherwise than by a job.
  void note_command(const Axis& axis) { ++commands_[index_of(axis)]; }
  // True if a client of the API has operated the axis: by a job, or by writing an object of a motion. Jobs are
  // forgotten, this is not.
  bool was_operated(const Axis& axis) const { return operated_[index_of(axis)].ever; }
  // True if a client has operated the axis since its last successful stop.
  bool may_move(const Axis& axis) const { return operated_[index_of(axis)].since_stop; }
  // True if the axis has no torque and is not about to get any (a drive waits for its brake before it is enabled).
  // False if the last polled state is too old.
  bool is_idle(const Axis& axis) const;
  // Quick stops of these axes at the same time, before all other waiting accesses. Ignores errors. Waits with the
  // present wait.
  void quick_stop(const std::vector<const Axis*>& axes);
  // The devices on the bus. Throws MasterError if an axis of the bus has torque: a stop would have to wait for the
  // scan. Waits with the present wait.
  std::vector<OpenBus::Found> scan(std::size_t bus);
  // Waits with the present wait.
  std::unique_ptr<master::ObjectClient> open(const Axis& axis) { return open(axis.name, wait_); }
  api::Json view(const Axis& axis) const;

  // What this program, and by SDO other masters of a CAN bus, have written to the drives.
  api::ChangeLog& changes() const { return changes_->log(); }

  // Fetches the values of ticks before `end` that the threads of the buses have sampled, but not more than their
  // readers can take at once. Returns the tick up to which it has fetched them. If that is less than `end`, call it
  // again after the readers have taken the values.
  std::int64_t take_samples(std::int64_t end);
  // The events of the stream since the last call.
  std::vector<api::Json> events();

  static std::vector<std::string_view> signal_names();
  // The greatest rate of a recording of drives on this bus.
  double most_sampling_hz(std::size_t bus) const;

  // --- Drives
  master::Time now() const override { return DriveBus::Clock::now() - start_; }
  // Wall-clock time at which now() is 0.
  master::Time wall_epoch() const override { return wall_epoch_; }
  std::vector<std::string> names() const override;
  void require_ready(const std::string& axis) const override;
  std::unique_ptr<master::ObjectClient> open(const std::string& axis, Wait wait) override;
  master::AxisOptions options(const std::string& axis) const override;
  std::string product(const std::string& axis) const override { return axis_of(axis).product; }
  // True on CAN and EtherCAT.
  bool has_cycles(const std::string& axis) const override;
  api::Json in_cycles(const std::string& axis, master::ObjectClient& objects, const master::CanDrive& exchanged,
                      const std::function<bool()>& cancelled,
                      const std::function<void(const char* doing, double share)>& progress, const Work& work) override;
  std::optional<catalogue::AxisUnits> units(const std::string& axis) override;
  master::AxisLimits limits(const std::string& axis) override;
  Travel travel(const std::string& axis) override;
  std::uint64_t commands(const std::string& axis) const override { return commands_[index_of(axis_of(axis))]; }
  void note_motion(const std::string& axis) override { operated_[index_of(axis_of(axis))] = {true, true}; }
  void note_stop(const std::string& axis) override { operated_[index_of(axis_of(axis))] = {true, false}; }
  void stop_when_back(const std::string& axis) override;
  std::vector<std::optional<JobError>> stop_all() override;

  // --- Subjects
  Subject open(api::Call& call) override;

  // --- Source
  std::int64_t tick() const override;
  std::vector<std::string> axes() const override { return names(); }
  api::NamedChannel signal(const std::string& axis, std::string_view name) override;
  api::NamedChannel object(const std::string& axis, std::uint16_t index, std::uint8_t sub) override;
  std::int64_t stride_of(double rate_hz, const std::vector<api::NamedChannel>& channels) const override;
  Prepared prepare(double rate_hz, std::vector<api::NamedChannel>& channels) override;
  std::int64_t trigger_stride(std::int64_t stride) const override { return stride; }
  std::vector<api::Json> views() override;
  api::Json clock() override;

 private:
  using Json = api::Json;

  // The last published state of an axis or bus.
  struct Told {
    bool there = true;
    std::string state{};
    std::uint16_t error_code = 0;
  };

  struct Operated {
    bool ever = false;
    bool since_stop = false;
  };

  const Axis& axis_of(std::string_view name) const;  // throws ApiError 404
  // Lets the thread of the axis' bus carry out `work`; meanwhile `wait` lets other tasks run. Throws what the work
  // threw.
  void carry_out(const Axis& axis, const std::shared_ptr<studio::Work>& work, const std::function<void()>& wait);
  void note_foreign_writes();
  std::size_t index_of(const Axis& axis) const { return static_cast<std::size_t>(&axis - axes_.data()); }
  void take_back_targets(const Axis& axis, const Wait& wait, bool is_idle);
  // What a channel samples.
  struct Sampled {
    const Axis* axis;
    master::ObjectAddress object;
    BusSamples::Decode decode;
    std::string key{};  // set by channel(): axis and signal or object
  };
  // How a channel of a recording is sampled.
  struct Chosen {
    const Sampled* sampled;
    Sampling sampling;
    std::string by;                    // in words
    std::optional<JobError> limit{};   // why it is not faster
    std::vector<std::byte> initial{};  // the value before the first TPDO
  };

  api::NamedChannel channel(Sampled sampled, Json view, std::function<double()> value);
  // `channel` is one that channel() has made.
  const Sampled& sampled_by(const api::NamedChannel& channel) const;
  Sampling usual_sampling(const Sampled& sampled, std::int64_t stride) const;
  // Samples from now on; the values of earlier ticks are unknown.
  std::vector<std::shared_ptr<api::Samples>> open_samples(const std::vector<Chosen>& channels, std::int64_t stride);
  std::int64_t reading_period(const std::vector<Chosen>& channels) const;
  std::int64_t choose_stride(std::int64_t wanted, std::vector<Chosen>& channels) const;
  std::vector<Chosen> usual_choice(const std::vector<api::NamedChannel>& channels) const;
  // Chooses TPDOs for channels on CAN: those that the drives send already, or TPDOs that it sets up for the stride
  // `wanted`. They stay set up as long as the result lives.
  std::shared_ptr<void> choose_pdos(std::int64_t wanted, std::vector<Chosen>& channels);
  std::shared_ptr<void> choose_pdos_of(std::size_t bus, std::int64_t wanted, const std::vector<Chosen*>& channels);
  std::shared_ptr<void> set_up_pdos(std::size_t bus, std::int64_t wanted, const std::vector<Chosen*>& channels);
  void choose_set_up_pdos(std::size_t bus, const std::vector<Chosen*>& channels);
  void choose_sent_pdos(std::size_t bus, const std::vector<Chosen*>& channels, const HeardPdos::Use& use);
  HeardPdos::Use use_of_pdos(std::size_t bus, const std::vector<Chosen*>& channels);
  JobError limit_of(const Sampled& sampled, const Sampling& sampling) const;

  DriveBus::Clock::time_point start_;
  master::Time wall_epoch_;
  std::vector<std::unique_ptr<DriveBus>> buses_;
  std::vector<Axis> axes_;
  std::vector<std::uint64_t> commands_;  // of each axis
  std::vector<Operated> operated_;       // of each axis
  std::unique_ptr<DriveChanges> changes_;
  std::vector<Told> told_;
  std::vector<Told> told_of_buses_;
  Wait wait_;
  std::map<std::string, Sampled> objects_;  // by Sampled::key
  // Of each bus. Several readers share the samples.
  std::vector<std::map<std::string, std::weak_ptr<BusSamples>>> sampled_;
  std::vector<std::weak_ptr<void>> set_ups_;  // of each bus: the TPDOs that are set up for recordings
  std::int64_t advanced_ = 0;                 // the values of all ticks before it have been fetched
};

// Throws MasterError with `reason` if the motor is on. An example of a reason: a slave that leaves OP then goes to
// fault.
void require_no_torque(master::ObjectClient& objects, const char* reason);

}  // namespace servodrome::studio
