#include "studio/line_drives.hpp"

#include "api/error.hpp"
#include "axis/cia402_words.hpp"
#include "axis/cyclic/object_cyclic_bus.hpp"
#include "catalogue/product.hpp"
#include "drive/drive.hpp"
#include "studio/service_objects.hpp"

namespace servodrome::studio {

std::vector<std::string> LineDrives::names() const {
  std::vector<std::string> names;
  for (const auto& axis : line_.axes()) names.push_back(axis->settings().name);
  return names;
}

line::Axis& LineDrives::find(const std::string& axis) const { return *line_.find_axis(axis); }

void LineDrives::require_ready(const std::string& axis) const {
  if (find(axis).powered()) return;
  throw api::ApiError{409, "the axis has no power", axis, "switch it on: POST .../power {\"action\": \"on\"}"};
}

std::vector<std::string> LineDrives::injected(const std::string& name) const {
  line::Axis& axis = find(name);
  std::vector<std::string> names;
  for (const plant::InjectionName& known : plant::injection_names) {
    if (axis.plant().injected(known.injection)) names.emplace_back(known.name);
  }
  for (unsigned cause = 1; cause < 256; ++cause) {
    const drive::FaultRow* row = axis.device().drive().row(static_cast<drive::Cause>(cause));
    if (row != nullptr && axis.injected(row->cause)) names.emplace_back(drive::name(row->cause));
  }
  return names;
}

std::unique_ptr<master::ObjectClient> LineDrives::open(const std::string& axis, Wait wait) {
  return std::make_unique<ServiceObjects>(line_, find(axis), std::move(wait));
}

master::AxisOptions LineDrives::options(const std::string& axis) const { return options_for(find(axis)); }

std::string LineDrives::product(const std::string& axis) const {
  return std::string(find(axis).settings().product->name);
}

std::optional<catalogue::AxisUnits> LineDrives::units(const std::string& axis) { return units_of(line_, find(axis)); }

master::AxisLimits LineDrives::limits(const std::string& axis) {
  ServiceObjects objects(line_, find(axis));
  return master::Axis402(objects, options_for(find(axis))).limits();
}

// Also the stops and the limit switches of the machine.
Travel LineDrives::travel(const std::string& name) {
  line::Axis& axis = find(name);
  const drive::Drive& drive = axis.device().drive();
  ServiceObjects objects(line_, axis);
  Travel travel = travel_by_objects(objects, options_for(axis), drive.policy(), drive.homed());
  if (travel.wraps_within) return travel;
  const drive::Units& units = drive.axis().units;
  const std::int64_t actual = master::Axis402(objects, options_for(axis)).position();
  const plant::Parameters& parameters = axis.plant().parameters();
  // A move to an end itself is within the travel, also if the axis stands some counts beside its demand.
  const std::int64_t slack =
      std::abs(units.to_user(static_cast<std::int64_t>(parameters.encoder.counts_per_revolution / 100)));
  const auto add = [&](std::int64_t counts, bool high, const char* what) {
    if (counts == plant::no_low_limit || counts == plant::no_high_limit) return;
    travel.ends.push_back({.position = actual + units.to_user(counts - axis.plant().position_counts()),
                           .highest = high != units.position_inverted,
                           .what = what,
                           .slack = slack});
  };
  add(parameters.load.low_stop_counts, false, "the negative stop");
  add(parameters.load.high_stop_counts, true, "the positive stop");
  for (std::size_t i = 0; i < parameters.switch_count; ++i) {
    const plant::Switch& fitted = parameters.switches[i];
    if (fitted.from_counts == plant::no_low_limit) add(fitted.to_counts, false, "the negative limit switch");
    if (fitted.to_counts == plant::no_high_limit) add(fitted.from_counts, true, "the positive limit switch");
  }
  return travel;
}

// Uses object accesses: at the service port they are as quick as process data.
api::Json LineDrives::in_cycles(const std::string&, master::ObjectClient& objects, const master::CanDrive& exchanged,
                                const std::function<bool()>& cancelled,
                                const std::function<void(const char* doing, double share)>& progress,
                                const Work& work) {
  constexpr master::Time period = std::chrono::milliseconds(1);
  master::ObjectCyclicBus bus(objects, exchanged.rpdos.front(), exchanged.tpdos.front(), period);
  CyclicAccess access{bus, 0, objects, cancelled, progress};
  return work(access);
}

std::vector<std::optional<JobError>> LineDrives::stop_all() {
  std::vector<std::optional<JobError>> errors;
  for (const auto& axis : line_.axes()) {
    const std::string& name = axis->settings().name;
    std::optional<JobError>& wrong = errors.emplace_back();
    axis->note_command();
    const auto enabled = [&axis] { return axis->device().drive().state() == drive::PowerState::operation_enabled; };
    if (!axis->powered()) continue;
    const auto controlword = static_cast<std::uint16_t>(axis->device().dictionary().number(0x6040));
    const bool commanded = master::commands_operation(controlword);
    const drive::PowerState state = axis->device().drive().state();
    // The drive is told to enable, and waits for its DC link or its brake.
    const bool waits =
        commanded && (state == drive::PowerState::ready_to_switch_on || state == drive::PowerState::switched_on);
    ServiceObjects objects(line_, *axis);
    if (!enabled() && !waits) {
      try {
        // A fault may have ended a motion, whose target is still in the drive.
        master::Axis402(objects, options_for(*axis)).take_back_targets_of_idle_axis();
      } catch (const master::MasterError&) {
        // The axis has no torque: it needs no stop.
      }
      continue;
    }
    try {
      objects.write<std::uint16_t>(0x6040, 0, master::command_word::quick_stop);
      if (enabled()) wrong = JobError{"the drive did not execute the quick stop", name, "switch its power off"};
      master::Axis402(objects, options_for(*axis)).take_back_targets();  // they would act at the next enabling
    } catch (const master::MasterError& error) {
      wrong = JobError{error.happened(), error.where(), error.remedy()};
    }
  }
  return errors;
}

}  // namespace servodrome::studio
