#include "studio/real_drives.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <limits>

#include "api/scope/channel_list.hpp"
#include "axis/fault_report.hpp"
#include "drive/drive.hpp"
#include "line/axis.hpp"
#include "line/bench/axis_view.hpp"
#include "links/nearest_name.hpp"
#include "studio/remote_objects.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;
using api::Json;
using api::NamedChannel;

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

double number_of(dictionary::Type type, std::span<const std::byte> bytes) {
  if (bytes.empty()) return no_value;
  const std::size_t size =
      std::min<std::size_t>(bytes.size(), dictionary::size_of(type));  // an answer may have more: size_is_known()
  const std::int64_t raw = dictionary::decode_number(type, bytes.first(size));
  switch (type) {
    case dictionary::Type::real32: return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
    case dictionary::Type::unsigned64: return static_cast<double>(static_cast<std::uint64_t>(raw));
    default: return static_cast<double>(raw);
  }
}

// Equivalents of a line's signals for a drive that only has its objects.
struct Signal {
  const char* name;
  const char* unit;
  std::uint16_t index;
  dictionary::Type type;
  double (*of)(double number);
  double (*present)(const DriveBus::DriveState& state);  // the last polled value, without an access
};
using State = DriveBus::DriveState;
double as_it_is(double number) { return number; }
double state_of_word(double word) { return static_cast<double>(master::state_of(static_cast<std::uint16_t>(word))); }
constexpr std::array signals{
    Signal{"position_counts", "units", 0x6064, dictionary::Type::integer32, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.position); }},
    Signal{"velocity", "units/s", 0x606C, dictionary::Type::integer32, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.velocity); }},
    Signal{"following_error", "units", 0x60F4, dictionary::Type::integer32, as_it_is,
           [](const State&) { return no_value; }},
    Signal{"torque_percent", "%", 0x6077, dictionary::Type::integer16, [](double permille) { return permille / 10; },
           [](const State& state) { return state.status.torque / 10.0; }},
    Signal{"statusword", "", 0x6041, dictionary::Type::unsigned16, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.statusword); }},
    Signal{"state", "", 0x6041, dictionary::Type::unsigned16, state_of_word,
           [](const State& state) { return static_cast<double>(state.status.state()); }},
    Signal{"fault_code", "", 0x603F, dictionary::Type::unsigned16, as_it_is,
           [](const State& state) { return static_cast<double>(state.error_code); }},
};

// Throws MasterError with `reason` if the motor is on. An example of a reason: a slave that leaves OP then goes to
// fault.
void require_no_torque(master::ObjectClient& objects, const char* reason) {
  std::uint16_t statusword = 0;
  try {
    statusword = objects.read<std::uint16_t>(0x6041);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) return;  // the drive is silent: no check is possible
    throw;
  }
  using enum drive::PowerState;
  const drive::PowerState state = master::state_of(statusword);
  if (state != switched_on && state != operation_enabled && state != quick_stop_active &&
      state != fault_reaction_active) {
    return;
  }
  throw master::MasterError(reason, objects.where(), "disable the axis first");
}

const line::Product& tables_of(const std::string& product) {
  const line::Product* found = line::find_product(line::all_products(), product);
  return found != nullptr ? *found : *line::find_product(line::all_products(), "generic402");
}

}  // namespace

RealDrives::RealDrives(std::vector<BusPlan> plans) : start_(DriveBus::Clock::now()), wall_epoch_(links::wall_now()) {
  for (BusPlan& plan : plans) {
    for (std::size_t i = 0; i < plan.drives.size(); ++i) {
      const DrivePlan& drive = plan.drives[i];
      const line::Product& tables = tables_of(drive.product);
      axes_.push_back({drive.name, buses_.size(), i, drive.address, drive.product, &tables, tables.make({})});
    }
    buses_.push_back(std::make_unique<DriveBus>(std::move(plan), start_));
  }
  told_.resize(axes_.size());
  told_of_buses_.resize(buses_.size());
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
  return std::make_unique<RemoteObjects>(
      *buses_[axis.bus], axis.drive, axis.name, [this] { return now(); }, std::move(wait));
}

master::AxisOptions RealDrives::options(const std::string& axis) const {
  master::AxisOptions options;
  options.dialect = master::dialect_of(axis_of(axis).product);
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
  const auto task = std::make_shared<studio::Work>();
  task->carry_out = [shared, exchanged, work, drive = axis.drive](OpenBus& bus,
                                                                  const studio::Work::IsToEnd& is_to_end) {
    const OpenBus::Cyclic cyclic = bus.open_cyclic(drive, exchanged);
    const auto tell = [&shared](const char* doing, double share) {
      const std::lock_guard lock(shared->mutex);
      shared->doing = doing;
      shared->share = share;
    };
    CyclicAccess access{*cyclic.bus, cyclic.drive, *bus.drives()[drive], is_to_end, tell};
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
  return std::move(shared->found);
}

std::optional<master::AxisUnits> RealDrives::units(const std::string& name) {
  const auto objects = open(name, wait_);
  return master::Axis402(*objects, options(name)).units();
}

master::AxisLimits RealDrives::limits(const std::string& name) {
  const auto objects = open(name, wait_);
  return master::Axis402(*objects, options(name)).limits();
}

// Resets the targets, so that they do not take effect when another master enables the drive. The axis has already
// stopped, so errors are ignored.
void RealDrives::take_back_targets(const Axis& axis, const Wait& wait) {
  try {
    const auto objects = open(axis.name, wait);
    master::Axis402(*objects, options(axis.name)).take_back_targets();
  } catch (const master::MasterError&) {
    // The next request to the drive reports the error.
  }
}

// Stops on all buses at the same time, before all other waiting accesses.
std::vector<std::optional<JobError>> RealDrives::stop_all() {
  constexpr std::array quick_stop{std::byte{0x02}, std::byte{0x00}};  // CiA 402-2 table 24
  const Wait wait = wait_;  // copied: while this task waits, other tasks set their own
  std::vector<std::shared_ptr<Access>> accesses;
  std::vector<bool> stopped;
  for (const Axis& axis : axes_) {
    const auto access = std::make_shared<Access>();
    access->drive = axis.drive;
    access->object = {0x6040, 0};
    access->writes = true;
    access->urgent = true;
    access->bytes.assign(quick_stop.begin(), quick_stop.end());
    accesses.push_back(access);
    const DriveBus::DriveState state = state_of(axis);
    const bool idle = !state.problem && state.status.state() < drive::PowerState::operation_enabled &&
                      !buses_[axis.bus]->is_worked_with(axis.drive);
    stopped.push_back(!idle || state.at + 2 * DriveBus::usual_poll <= DriveBus::Clock::now());
    if (!stopped.back()) {
      access->done = true;  // it has no torque: a quick stop would only change its state
    } else {
      buses_[axis.bus]->submit(access);
    }
  }
  for (const auto& access : accesses) {
    while (!access->done) wait(now() + std::chrono::milliseconds(1));
  }
  std::vector<std::optional<JobError>> errors;
  for (std::size_t i = 0; i < accesses.size(); ++i) {
    std::optional<JobError>& wrong = errors.emplace_back();
    if (!accesses[i]->error) {
      if (stopped[i]) take_back_targets(axes_[i], wait);
      continue;
    }
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
                   "`servodrome params --eds FILE` reads them from its data sheet"};
  }
  dictionary::Dictionary& seen = bus.type == "rs485" ? axis.device->dictionary() : axis.device->bus_dictionary();
  Subject subject{.client = open(axis), .product = axis.product, .table = seen.table()};
  if (bus.type == "can") subject.node_id = static_cast<std::uint8_t>(axis.address);
  subject.has_process_data = bus.type != "rs485";
  if (bus.type == "ethercat") {
    subject.configure = [this, &axis](const OpenBus::Action& action, const OpenBus::Action& undo) {
      const auto task = std::make_shared<studio::Work>();
      task->reopens = true;
      task->carry_out = [action, undo, drive = axis.drive](OpenBus& open, const studio::Work::IsToEnd&) {
        // read the present state, not the last polled one
        for (master::ObjectClient* objects : open.drives()) {
          require_no_torque(*objects, "the axis has torque, but its bus must leave operation to change process data");
        }
        open.configure(drive, action, undo);
      };
      const Wait wait = wait_;
      carry_out(axis, task, [&] { wait(now() + std::chrono::milliseconds(5)); });
    };
  }
  return subject;
}

// ---- Observation

std::int64_t RealDrives::tick() const { return (now() - master::Time(latency)) / line::tick_length; }

NamedChannel RealDrives::channel(const Axis& axis, master::ObjectAddress object, PolledSamples::Decode decode,
                                 const std::string& key, Json view, std::function<double()> value) {
  const auto open = [this, bus = axis.bus, drive = axis.drive, object, decode,
                     key](std::int64_t stride) -> std::shared_ptr<api::Samples> {
    std::weak_ptr<PolledSamples>& known = polled_[fmt::format("{}/{}", key, stride)];
    if (auto samples = known.lock()) return samples;
    const std::int64_t first = (tick() / stride + 1) * stride;
    auto samples = std::make_shared<PolledSamples>(drive, object, decode, stride, first);
    buses_[bus]->sample(samples);
    known = samples;
    return samples;
  };
  return {axis.name, std::move(view), open, std::move(value)};
}

std::vector<std::string_view> RealDrives::signal_names() {
  std::vector<std::string_view> names;
  for (const Signal& row : signals) names.emplace_back(row.name);
  return names;
}

NamedChannel RealDrives::signal(const std::string& name, std::string_view signal) {
  const Axis& axis = axis_of(name);
  for (const Signal& row : signals) {
    if (row.name != signal) continue;
    const auto decode = [&row](std::span<const std::byte> bytes) { return row.of(number_of(row.type, bytes)); };
    return channel(axis, {row.index, 0}, decode, fmt::format("{}/{}", name, signal),
                   {{"axis", name}, {"signal", signal}, {"name", row.name}, {"unit", row.unit}},
                   [this, &axis, &row] { return row.present(state_of(axis)); });
  }
  throw ApiError{422, fmt::format("a drive on a bus has no signal \"{}\"", signal.substr(0, 40)), name,
                 links::suggestion(signal, signal_names()) + "; or give an object"};
}

NamedChannel RealDrives::object(const std::string& name, std::uint16_t index, std::uint8_t sub) {
  const Axis& axis = axis_of(name);
  const std::string text = fmt::format("{:04X}:{:02X}", index, sub);
  const dictionary::Entry* entry = axis.device->dictionary().find(index, sub);
  if (entry == nullptr || !entry->readable() || !entry->fixed_size()) {
    throw ApiError{422, fmt::format("{} {}", text, entry == nullptr ? "is not known" : "is not a readable number"),
                   name, fmt::format("GET /api/v1/axes/{}/objects lists the objects", name)};
  }
  const auto decode = [type = entry->type](std::span<const std::byte> bytes) { return number_of(type, bytes); };
  return channel(axis, {index, sub}, decode, fmt::format("{}/{}", name, text),
                 {{"axis", name}, {"object", text}, {"name", entry->name}, {"unit", entry->unit}},
                 [] { return no_value; });
}

// Chooses the stride so that sampling uses at most half of the time of the busiest bus.
std::int64_t RealDrives::stride_of(double rate_hz, const std::vector<NamedChannel>& channels) const {
  std::vector<double> busy_s(buses_.size());
  for (const NamedChannel& channel : channels) {
    const Axis& axis = axis_of(channel.axis);
    busy_s[axis.bus] += buses_[axis.bus]->state().access_s;
  }
  const double longest_s = *std::max_element(busy_s.begin(), busy_s.end());
  const double rate = std::min(rate_hz, 0.5 / longest_s);
  return std::max(finest_stride, api::stride_of_rate(std::max(rate, 1.0)));
}

Json RealDrives::clock() {
  return {{"mode", "real"},
          {"time_ns", now().count()},
          {"time_ms", std::chrono::duration<double, std::milli>(now()).count()},
          {"ticks", now() / line::tick_length},
          {"speed", 1.0},
          {"lag_ms", 0.0},
          {"lag_count", 0}};
}

Json RealDrives::view(const Axis& axis) const {
  const DriveBus& bus = *buses_[axis.bus];
  const DriveBus::DriveState state = state_of(axis);
  Json view{{"name", axis.name},
            {"product", axis.product.empty() ? "CiA 402 drive" : axis.product},
            {"bus", bus.plan().link}};
  if (bus.plan().type == "can") view["node_id"] = axis.address;
  if (bus.plan().type == "ethercat") view["position"] = axis.address;
  view["serial"] = nullptr;
  if (bus.plan().type == "rs485") {
    view["serial"] = {{"bus", bus.plan().link}, {"station", axis.address}, {"protocol", "modbus"}};
    if (bus.plan().link.starts_with("serial10:")) view["serial"]["protocol"] = "serial10";
  }
  view["powered"] = !state.problem;
  if (state.problem) {
    view["problem"] = {{"what", state.problem->what}, {"where", state.problem->where}, {"hint", state.problem->hint}};
  } else {
    view["state"] = drive::name(state.status.state());
    view["mode"] = state.status.mode;
    view["mode_name"] = line::bench::mode_name(static_cast<drive::Mode>(state.status.mode));
    view["statusword"] = state.status.statusword;
    view["controlword"] = state.controlword;
    view["error_code"] = state.error_code;
    view["watch"] = nullptr;
    if (state.watch) view["watch"] = {{"by", state.watch->by}, {"within_s", state.watch->within_s}};
  }
  view["faults"] = Json::array();
  if (!state.problem && state.error_code != 0) {
    const master::ReportedFault fault = master::fault_of_code(state.error_code, {0x603F, 0}, axis.product);
    const std::string text = master::text_of(fault, axis.product);
    view["faults"].push_back({{"code", fmt::format("0x{:04X}", state.error_code)},
                              {"name", text.substr(std::min(text.find(' ') + 1, text.size()))}});
  }
  view["position_counts"] = state.status.position;
  view["velocity"] = state.status.velocity;
  view["torque_percent"] = state.status.torque / 10.0;
  for (const char* unknown :
       {"velocity_rpm", "torque_nm", "current_a", "temperature_c", "stage_temperature_c", "supply_v"}) {
    view[unknown] = nullptr;
  }
  return view;
}

std::vector<Json> RealDrives::views() {
  std::vector<Json> views;
  for (const Axis& axis : axes_) views.push_back(view(axis));
  return views;
}

std::vector<Json> RealDrives::advance() {
  const std::int64_t end = tick() + 1;
  for (auto entry = polled_.begin(); entry != polled_.end();) {
    const auto samples = entry->second.lock();
    if (samples) samples->advance(end);
    entry = samples ? std::next(entry) : polled_.erase(entry);
  }
  std::vector<Json> events;
  const auto tell = [&](const char* kind, const Json& axis, Json details) {
    Json event{{"kind", kind}, {"axis", axis}, {"tick", end - 1}};
    event.update(details);
    events.push_back(std::move(event));
  };
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    const auto problem = buses_[i]->state().problem;
    if (problem.has_value() == !told_of_buses_[i].there) continue;
    told_of_buses_[i].there = !problem;
    Json details{{"bus", buses_[i]->plan().link}, {"connected", !problem}};
    if (problem) details["problem"] = {{"what", problem->what}, {"where", problem->where}, {"hint", problem->hint}};
    tell("bus", nullptr, std::move(details));
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const DriveBus::DriveState state = state_of(axes_[i]);
    Told& told = told_[i];
    if (state.problem.has_value() == told.there) tell("power", axes_[i].name, {{"powered", !state.problem}});
    told.there = !state.problem;
    if (state.problem) continue;
    const std::string name = drive::name(state.status.state());
    if (name != told.state) tell("state", axes_[i].name, {{"state", name}});
    told.state = name;
    if (state.error_code == told.error_code) continue;
    const std::uint16_t code = state.error_code != 0 ? state.error_code : told.error_code;
    tell(state.error_code != 0 ? "fault" : "fault_gone", axes_[i].name, {{"code", fmt::format("0x{:04X}", code)}});
    told.error_code = state.error_code;
  }
  return events;
}

}  // namespace servodrome::studio
