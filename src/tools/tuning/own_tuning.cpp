#include "tools/tuning/own_tuning.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "tools/tuning/session.hpp"

namespace servodrome::master::tuning {
namespace {

constexpr ObjectAddress auto_tuning_control{0x2340, 0x10};
constexpr std::uint8_t learns_and_adjusts_kvp = 0x03;
constexpr ObjectAddress notch_control{0x60F9, 0x04};
constexpr std::uint8_t analyse_actual_speed = 0xA0;
constexpr std::uint8_t analysis_runs = 0x80;
constexpr double leg_s = 0.4;
constexpr double most_rps = 5.0;
constexpr double acceleration_rps2 = 100.0;
constexpr int least_legs = 6;  // minimum of moves, so that the estimate has settled
constexpr double analysis_timeout_s = 20.0;

std::int64_t kvp_of(ObjectClient& objects, const TuningDialect& dialect) {
  return objects.read<std::uint16_t>(dialect.gains[0].object.index, dialect.gains[0].object.sub);
}

// Moves back and forth until kvp has settled: it is the same after a whole cycle, and least_legs moves have been made.
void learn_inertia(Axis402& axis, const TuningDialect& dialect, const AxisUnits& units,
                   const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  const double rps = std::min(most_rps, options.travel_revolutions / (2.0 * leg_s));
  const auto speed = static_cast<std::int32_t>(std::lround(rps * units.velocity));
  const auto ramp = static_cast<std::uint32_t>(std::lround(acceleration_rps2 * units.acceleration));
  const MotionProfile profile{.acceleration = ramp, .deceleration = ramp};
  const Time end = objects.now() + std::chrono::duration_cast<Time>(std::chrono::duration<double>(options.seconds));
  std::int64_t kvp = kvp_of(objects, dialect);
  for (int leg = 0; objects.now() < end; ++leg) {
    axis.run_at(leg % 2 == 0 ? speed : -speed, profile, std::chrono::seconds(5));
    axis.hold_for(std::chrono::duration_cast<Time>(std::chrono::duration<double>(leg_s)));
    if (options.progress)
      options.progress("identifying the inertia", std::min(1.0, static_cast<double>(leg) / least_legs));
    const std::int64_t now = kvp_of(objects, dialect);
    if (leg >= least_legs && leg % 2 == 1 && now == kvp) break;
    if (leg % 2 == 1) kvp = now;
  }
  axis.stop();
}

void find_resonances(Axis402& axis, const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  const auto before = objects.read<std::uint8_t>(notch_control.index, notch_control.sub);
  objects.write<std::uint8_t>(notch_control.index, notch_control.sub, before | analyse_actual_speed);
  const Time start = objects.now();
  for (;;) {
    axis.hold_for(std::chrono::milliseconds(100));
    const double seconds = std::chrono::duration<double>(objects.now() - start).count();
    if (options.progress) options.progress("searching for resonances", std::min(1.0, seconds / 4.0));
    const auto control = objects.read<std::uint8_t>(notch_control.index, notch_control.sub);
    if ((control & analysis_runs) == 0) return;
    if (seconds > analysis_timeout_s) {
      throw MasterError(
          fmt::format("its search for resonances (60F9:04) has not ended after {:g} s", analysis_timeout_s),
          objects.where(), "see `servodrome faults`");
    }
  }
}

}  // namespace

OwnTuningResult tune_by_itself(Axis402& axis, const TuningDialect& dialect, const AxisUnits& units,
                               const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  if (!dialect.tunes_itself) {
    throw MasterError("this drive has no automatic tuning that servodrome supports", objects.where(),
                      "omit --auto: then the loop is measured, over EtherCAT or CAN");
  }
  OwnTuningResult result;
  result.before = read_gains(objects, dialect);
  const auto control = objects.read<std::uint8_t>(auto_tuning_control.index, auto_tuning_control.sub);
  const auto set_control = [&](std::uint8_t value) {
    objects.write<std::uint8_t>(auto_tuning_control.index, auto_tuning_control.sub, value);
  };
  const auto leave = [&](const auto& call) {
    try {
      call();
    } catch (const MasterError&) {
      // The original error is reported; this one is ignored.
    }
  };
  try {
    axis.enable();
    set_control(control | learns_and_adjusts_kvp);
    learn_inertia(axis, dialect, units, options);
    set_control(control);
    find_resonances(axis, options);
    result.after = read_gains(objects, dialect);
    axis.disable();
  } catch (const MasterError& error) {
    leave([&] { axis.stop(); });
    leave([&] { axis.disable(); });
    leave([&] { set_control(control); });
    const std::string remedy = fmt::format("{}; {}", error.remedy(), put_back_gains(objects, result.before));
    if (dynamic_cast<const Cancelled*>(&error) != nullptr) throw Cancelled(error.happened(), error.where(), remedy);
    throw MasterError(error.happened(), error.where(), remedy);
  }
  return result;
}

}  // namespace servodrome::master::tuning
