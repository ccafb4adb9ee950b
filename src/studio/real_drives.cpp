#include "studio/real_drives.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "drive/drive.hpp"
#include "line/axis.hpp"
#include "links/nearest_name.hpp"
#include "studio/remote_objects.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;
using api::Json;

std::shared_ptr<Access> quick_stop_of(std::size_t drive) {
  constexpr std::array quick_stop{std::byte{0x02}, std::byte{0x00}};  // CiA 402-2 table 24
  const auto access = std::make_shared<Access>();
  access->drive = drive;
  access->object = {0x6040, 0};
  access->writes = true;
  access->urgent = true;
  access->bytes.assign(quick_stop.begin(), quick_stop.end());
  return access;
}

const line::Product& tables_of(const std::string& product) {
  const line::Product* found = line::find_product(line::all_products(), product);
  return found != nullptr ? *found : *line::find_product(line::all_products(), "generic402");
}

}  // namespace

void require_no_torque(master::ObjectClient& objects, const char* reason) {
  std::uint16_t statusword = 0;
  try {
    statusword = objects.read<std::uint16_t>(0x6041);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) return;  // the drive is silent: no check is possible
    throw;
  }
  if (master::may_have_torque(master::state_of(statusword))) {
    throw master::MasterError(reason, objects.where(), "disable the axis first");
  }
}

RealDrives::RealDrives(std::vector<BusPlan> plans) : start_(DriveBus::Clock::now()), wall_epoch_(links::wall_now()) {
  for (BusPlan& plan : plans) {
    for (std::size_t i = 0; i < plan.drives.size(); ++i) {
      const DrivePlan& drive = plan.drives[i];
      const line::Product& tables = tables_of(drive.product);
      axes_.push_back({drive.name, buses_.size(), i, drive.address, drive.product, &tables, tables.make({})});
    }
    buses_.push_back(std::make_unique<DriveBus>(std::move(plan), start_));
  }
  std::vector<DriveChanges::Drive> noted;
  for (const Axis& axis : axes_) noted.push_back({axis.name, &axis.device->dictionary()});
  changes_ = std::make_unique<DriveChanges>(
      noted, [this] { return now(); }, wall_epoch_);
  changes_->before_each_own([this] { note_foreign_writes(); });
  commands_.resize(axes_.size());
  operated_.resize(axes_.size());
  told_.resize(axes_.size());
  told_of_buses_.resize(buses_.size());
  sampled_.resize(buses_.size());
  set_ups_.resize(buses_.size());
}

const RealDrives::Axis* RealDrives::find(std::string_view name) const {
  const auto found = std::find_if(axes_.begin(), axes_.end(), [name](const Axis& axis) { return axis.name == name; });
  return found == axes_.end() ? nullptr : &*found;
}

const RealDrives::Axis& RealDrives::axis_of(std::string_view name) const {
  if (const Axis* axis = find(name)) return *axis;
  const std::vector<std::string> known = names();
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "axis",
                 links::suggestion(name, {known.begin(), known.end()})};
}

std::vector<std::string> RealDrives::names() const {
  std::vector<std::string> names;
  for (const Axis& axis : axes_) names.push_back(axis.name);
  return names;
}

DriveBus::DriveState RealDrives::state_of(const Axis& axis) const {
  return buses_[axis.bus]->state().drives[axis.drive];
}

void RealDrives::require_ready(const std::string& axis) const {
  if (const auto problem = state_of(axis_of(axis)).problem) {
    throw ApiError{409, problem->what, fmt::format("{}, {}", axis, problem->where), problem->hint};
  }
}

std::unique_ptr<master::ObjectClient> RealDrives::open(const std::string& name, Wait wait) {
  const Axis& axis = axis_of(name);
  return changes_->recorded(index_of(axis),
                            std::make_unique<RemoteObjects>(
                                *buses_[axis.bus], axis.drive, axis.name, [this] { return now(); }, std::move(wait)));
}

master::AxisOptions RealDrives::options(const std::string& axis) const {
  master::AxisOptions options;
  options.product = &catalogue::product_of(axis_of(axis).product);
  return options;
}

bool RealDrives::has_cycles(const std::string& axis) const { return buses_[axis_of(axis).bus]->plan().type != "rs485"; }

void RealDrives::carry_out(const Axis& axis, const std::shared_ptr<studio::Work>& work,
                           const std::function<void()>& wait) {
  // If the caller leaves, also by an exception, the work item is cancelled.
  struct Wanted {
    studio::Work& work;
    ~Wanted() { work.cancelled = true; }
  };
  const Wanted wanted{*work};
  work->drive = axis.drive;
  buses_[axis.bus]->submit(work);
  while (!work->done) {
    if (work->cancelled && !work->begun) throw master::Cancelled("interrupted", axis.name, "nothing was done");
    wait();
  }
  if (work->error) std::rethrow_exception(work->error);
}

Json RealDrives::in_cycles(const std::string& name, master::ObjectClient& objects, const master::CanDrive& exchanged,
                           const std::function<bool()>& cancelled,
                           const std::function<void(const char* doing, double share)>& progress, const Work& work) {
  const Axis& axis = axis_of(name);
  if (!has_cycles(name)) {
    throw master::MasterError("a frequency response needs samples at a fixed rate, which this bus does not give", name,
                              "use the drive's CAN or EtherCAT port");
  }
  // Data shared by both threads. It lives as long as either uses it.
  struct Shared {
    std::mutex mutex{};
    std::string doing{};
    double share = 0.0;
    Json found{};
  };
  const auto shared = std::make_shared<Shared>();
  const auto handed = changes_->hand_out(index_of(axis));
  const auto task = std::make_shared<studio::Work>();
  task->carry_out = [shared, handed, exchanged, work, drive = axis.drive, &on = *buses_[axis.bus]](
                        OpenBus& bus, const studio::Work::IsToEnd& is_to_end) {
    if (on.records()) {
      throw master::MasterError("a recording has set up the PDOs of this bus", bus.drives()[drive]->where(),
                                "wait for its end, stop it or delete it");
    }
    const OpenBus::Cyclic cyclic = bus.open_cyclic(drive, exchanged);
    const auto tell = [&shared](const char* doing, double share) {
      const std::lock_guard lock(shared->mutex);
      shared->doing = doing;
      shared->share = share;
    };
    RecordedObjects recorded(*bus.drives()[drive], handed->record());
    CyclicAccess access{*cyclic.bus, cyclic.drive, recorded, is_to_end, tell};
    Json found = work(access);
    is_to_end();  // lets urgent accesses run before the process data are restored
    const std::lock_guard lock(shared->mutex);
    shared->found = std::move(found);
  };
  carry_out(axis, task, [&] {
    constexpr master::Time look_period = std::chrono::milliseconds(5);
    if (cancelled()) task->cancelled = true;
    std::string doing;
    double share = 0.0;
    {
      const std::lock_guard lock(shared->mutex);
      doing = shared->doing;
      share = shared->share;
    }
    if (!doing.empty()) progress(doing.c_str(), share);
    objects.wait(look_period);
  });
  buses_[axis.bus]->pdos().forget(links::steady_now());
  changes_->collect();
  return std::move(shared->found);
}

std::optional<catalogue::AxisUnits> RealDrives::units(const std::string& name) {
  const auto objects = open(name, wait_);
  return master::Axis402(*objects, options(name)).units();
}

master::AxisLimits RealDrives::limits(const std::string& name) {
  const auto objects = open(name, wait_);
  return master::Axis402(*objects, options(name)).limits();
}

Travel RealDrives::travel(const std::string& name) {
  const Axis& axis = axis_of(name);
  const auto objects = open(name, wait_);
  const drive::Policy& policy = axis.device->drive().policy();
  const std::uint16_t statusword = objects->read<std::uint16_t>(0x6041);
  const auto& bits = policy.status.bits;
  const bool homed = std::any_of(bits.begin(), bits.end(), [statusword](const drive::StatusBit& bit) {
    return bit.source == drive::StatusSource::home_found && (statusword >> bit.bit & 1U) != 0;
  });
  return travel_by_objects(*objects, options(name), policy, homed);
}

// Resets the targets, so that they do not take effect when another master enables the drive. The axis has already
// stopped, so errors are ignored.
void RealDrives::take_back_targets(const Axis& axis, const Wait& wait, bool is_idle) {
  try {
    const auto objects = open(axis.name, wait);
    master::Axis402 master_axis(*objects, options(axis.name));
    if (is_idle) return master_axis.take_back_targets_of_idle_axis();
    master_axis.take_back_targets();
  } catch (const master::MasterError&) {
    // The next request to the drive reports the error.
  }
}

bool RealDrives::is_idle(const Axis& axis) const {
  const DriveBus::DriveState state = state_of(axis);
  const bool commanded = master::commands_operation(state.controlword);
  const bool is_off = !state.problem && !commanded && state.status.state() < drive::PowerState::operation_enabled &&
                      !buses_[axis.bus]->is_worked_with(axis.drive);
  return is_off && state.at + 2 * DriveBus::usual_poll > DriveBus::Clock::now();
}

void RealDrives::quick_stop(const std::vector<const Axis*>& axes) {
  const Wait wait = wait_;
  std::vector<std::shared_ptr<Access>> accesses;
  for (const Axis* axis : axes) {
    accesses.push_back(quick_stop_of(axis->drive));
    buses_[axis->bus]->submit(accesses.back());
  }
  for (const auto& access : accesses) {
    while (!access->done) wait(now() + std::chrono::milliseconds(1));
  }
}

void RealDrives::stop_when_back(const std::string& name) {
  const Axis& axis = axis_of(name);
  buses_[axis.bus]->stop_when_back(axis.drive);
}

// Stops on all buses at the same time, before all other waiting accesses.
std::vector<std::optional<JobError>> RealDrives::stop_all() {
  const Wait wait = wait_;  // copied: while this task waits, other tasks set their own
  std::vector<std::shared_ptr<Access>> accesses;
  std::vector<bool> stopped;
  std::vector<std::size_t> silent;  // submitted last, because each costs its timeout
  for (const Axis& axis : axes_) {
    note_command(axis);
    operated_[index_of(axis)].since_stop = false;
    const auto access = quick_stop_of(axis.drive);
    accesses.push_back(access);
    const bool is_silent = state_of(axis).problem.has_value();
    stopped.push_back(!is_idle(axis));
    if (!stopped.back()) {
      access->done = true;  // the axis has no torque, and a quick stop would only change its power state
      buses_[axis.bus]->cancel_motion(axis.drive);
    } else if (is_silent) {
      silent.push_back(index_of(axis));
    } else {
      buses_[axis.bus]->submit(access);
    }
  }
  for (const std::size_t i : silent) buses_[axes_[i].bus]->submit(accesses[i]);
  for (const auto& access : accesses) {
    while (!access->done) wait(now() + std::chrono::milliseconds(1));
  }
  std::vector<std::optional<JobError>> errors;
  for (std::size_t i = 0; i < accesses.size(); ++i) {
    std::optional<JobError>& wrong = errors.emplace_back();
    if (!accesses[i]->error) {
      take_back_targets(axes_[i], wait, !stopped[i]);
      continue;
    }
    operated_[i].since_stop = operated_[i].ever;
    buses_[axes_[i].bus]->stop_when_back(axes_[i].drive);
    try {
      std::rethrow_exception(accesses[i]->error);
    } catch (const master::MasterError& error) {
      wrong = JobError{error.happened(), error.where(),
                       "use its emergency stop; the quick stop is sent as soon as the drive answers"};
    } catch (const std::exception& error) {
      wrong = JobError{error.what(), axes_[i].name,
                       "use its emergency stop; the quick stop is sent as soon as the drive answers"};
    }
  }
  return errors;
}

std::vector<RealDrives::ProcessDataRegisters> RealDrives::process_data_of(std::size_t bus) {
  const auto found = std::make_shared<std::vector<ProcessDataRegisters>>();
  const auto task = std::make_shared<studio::Work>();
  const auto addresses = std::make_shared<std::vector<unsigned>>();
  for (const DrivePlan& drive : buses_[bus]->plan().drives) addresses->push_back(drive.address);
  task->beside = true;
  task->carry_out = [found, addresses](OpenBus& open, const studio::Work::IsToEnd&) {
    open.show_process_data(
        [&](std::size_t drive, std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> bytes) {
          found->push_back({(*addresses)[drive], station, offset, {bytes.begin(), bytes.end()}});
        });
  };
  const auto first = std::find_if(axes_.begin(), axes_.end(), [bus](const Axis& axis) { return axis.bus == bus; });
  const Wait wait = wait_;
  try {
    carry_out(*first, task, [&] { wait(now() + std::chrono::milliseconds(1)); });
  } catch (const master::MasterError&) {
    found->clear();  // the bus is lost: frames are decoded without this information
  }
  return std::move(*found);
}

std::vector<OpenBus::Found> RealDrives::scan(std::size_t bus) {
  const auto found = std::make_shared<std::vector<OpenBus::Found>>();
  const auto task = std::make_shared<studio::Work>();
  task->carry_out = [found](OpenBus& open, const studio::Work::IsToEnd&) {
    for (master::ObjectClient* objects : open.drives()) {
      require_no_torque(*objects, "the axis has torque, and its stop would have to wait for the scan");
    }
    *found = open.scan();
  };
  const auto first = std::find_if(axes_.begin(), axes_.end(), [bus](const Axis& axis) { return axis.bus == bus; });
  const Wait wait = wait_;
  carry_out(*first, task, [&] { wait(now() + std::chrono::milliseconds(5)); });
  return std::move(*found);
}

Subject RealDrives::open(api::Call& call) {
  const Axis& axis = axis_of(call.arguments.front());
  require_ready(axis.name);
  const BusPlan& bus = buses_[axis.bus]->plan();
  if (axis.product.empty()) {
    throw ApiError{409, "the parameters of this drive are not known", fmt::format("{}, {}", axis.name, bus.link),
                   "`servodrome params save --eds FILE` reads them from its data sheet"};
  }
  dictionary::Dictionary& seen = bus.type == "rs485" ? axis.device->dictionary() : axis.device->bus_dictionary();
  Subject subject{.client = open(axis), .product = axis.product, .table = seen.table()};
  if (bus.type == "can") subject.node_id = static_cast<std::uint8_t>(axis.address);
  subject.has_process_data = bus.type != "rs485";
  if (bus.type == "ethercat") {
    subject.configure = [this, &axis](const OpenBus::Action& action, const OpenBus::Action& undo) {
      const auto handed = changes_->hand_out(index_of(axis));
      const auto noted = [handed](const OpenBus::Action& its) {
        return [handed, its](master::ObjectClient& objects) {
          RecordedObjects recorded(objects, handed->record());
          its(recorded);
        };
      };
      const auto task = std::make_shared<studio::Work>();
      task->reopens = true;
      task->carry_out = [action = noted(action), undo = noted(undo), drive = axis.drive](OpenBus& open,
                                                                                         const studio::Work::IsToEnd&) {
        // read the present state, not the last polled one
        for (master::ObjectClient* objects : open.drives()) {
          require_no_torque(*objects, "the axis has torque, but its bus must leave operation to change process data");
        }
        open.configure(drive, action, undo);
      };
      const Wait wait = wait_;
      carry_out(axis, task, [&] { wait(now() + std::chrono::milliseconds(5)); });
      changes_->collect();
    };
  }
  return subject;
}

}  // namespace servodrome::studio
