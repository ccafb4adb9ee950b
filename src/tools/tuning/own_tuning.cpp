#include "tools/tuning/own_tuning.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>

#include "catalogue/product.hpp"
#include "links/time.hpp"
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

std::int64_t kvp_of(ObjectClient& objects, const catalogue::TuningDialect& dialect) {
  return objects.read<std::uint16_t>(dialect.gains[0].object.index, dialect.gains[0].object.sub);
}

// Ends the motion if the axis is too far from its start: with a great inertia the ramp is slow, so that the axis moves
// a long way.
class TravelLimit {
 public:
  TravelLimit(Axis402& axis, const AxisUnits& units, double revolutions)
      : axis_(axis), units_(units), start_(axis.position()), revolutions_(revolutions) {}

  void operator()(const AxisStatus& present) const {
    const auto way =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(present.position) - static_cast<std::uint32_t>(start_));
    const double turned = way / units_.position;
    if (std::abs(turned) <= revolutions_) return;
    throw MasterError(
        fmt::format("the axis is {:.2f} revolutions from its start; the limit is {:g}", turned, revolutions_),
        axis_.objects().where(), "allow more with --travel");
  }

 private:
  Axis402& axis_;
  AxisUnits units_;
  std::int32_t start_;
  double revolutions_;
};

// Moves back and forth until kvp has settled (it is the same after a whole cycle, and least_legs moves have been made),
// at most for options.seconds. Returns true if it has settled.
bool learn_inertia(Axis402& axis, const catalogue::TuningDialect& dialect, const AxisUnits& units,
                   const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  const double rps = std::min(most_rps, options.travel_revolutions / (2.0 * leg_s));
  const auto speed = static_cast<std::int32_t>(std::lround(rps * units.velocity));
  const auto ramp = static_cast<std::uint32_t>(std::lround(acceleration_rps2 * units.acceleration));
  const MotionProfile profile{.acceleration = ramp, .deceleration = ramp};
  const Time end = objects.now() + links::from_seconds(options.seconds);
  const TravelLimit within_travel(axis, units, options.travel_revolutions);
  std::int64_t kvp = kvp_of(objects, dialect);
  bool has_settled = false;
  for (int leg = 0; !has_settled && objects.now() < end; ++leg) {
    axis.run_at(leg % 2 == 0 ? speed : -speed, profile, std::chrono::seconds(5), within_travel);
    axis.hold_for(links::from_seconds(leg_s), within_travel);
    if (options.progress)
      options.progress("identifying the inertia", std::min(1.0, static_cast<double>(leg) / least_legs));
    const std::int64_t now = kvp_of(objects, dialect);
    has_settled = leg >= least_legs && leg % 2 == 1 && now == kvp;
    if (leg % 2 == 1) kvp = now;
  }
  axis.stop();
  return has_settled;
}

void find_resonances(Axis402& axis, const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  const auto before = objects.read<std::uint8_t>(notch_control.index, notch_control.sub);
  objects.write<std::uint8_t>(notch_control.index, notch_control.sub, before | analyse_actual_speed);
  const Time start = objects.now();
  for (;;) {
    axis.hold_for(std::chrono::milliseconds(100));
    const double seconds = links::to_seconds(objects.now() - start);
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

void try_to(const std::function<void()>& call) {
  try {
    call();
  } catch (const MasterError&) {
    // The original error is reported; this one is ignored.
  }
}

// The drive changes kvp while it learns the inertia. Without succeed() or put_back() the destructor ends the learning
// and restores the old gains, for example after an exception of the caller.
class Learning {
 public:
  Learning(ObjectClient& objects, const std::vector<GainValue>& gains)
      : objects_(objects), gains_(gains), control_(objects.read<std::uint8_t>(place.index, place.sub)) {}
  ~Learning() {
    if (is_over_) return;
    try {
      put_back();
    } catch (...) {
      // Another exception has ended the tuning, and is reported.
    }
  }
  Learning(const Learning&) = delete;
  Learning& operator=(const Learning&) = delete;

  void begin() { set(control_ | learns_and_adjusts_kvp); }
  void end() { set(control_); }
  void succeed() { is_over_ = true; }
  // Returns what happened to the gains, for the user.
  std::string put_back() {
    is_over_ = true;
    try_to([this] { end(); });
    return put_back_gains(objects_, gains_);
  }

 private:
  static constexpr ObjectAddress place = auto_tuning_control;
  void set(int value) { objects_.write<std::uint8_t>(place.index, place.sub, static_cast<std::uint8_t>(value)); }

  ObjectClient& objects_;
  const std::vector<GainValue>& gains_;
  std::uint8_t control_;
  bool is_over_ = false;
};

}  // namespace

OwnTuningResult tune_by_itself(Axis402& axis, const catalogue::TuningDialect& dialect, const AxisUnits& units,
                               const OwnTuningOptions& options) {
  ObjectClient& objects = axis.objects();
  if (!dialect.tunes_itself) {
    throw MasterError("this drive has no automatic tuning that servodrome supports", objects.where(),
                      "omit --auto: then the loop is measured, over EtherCAT or CAN");
  }
  OwnTuningResult result;
  result.before = read_gains(objects, dialect);
  Learning learning(objects, result.before);
  try {
    axis.enable();
    learning.begin();
    result.inertia_settled = learn_inertia(axis, dialect, units, options);
    learning.end();
    find_resonances(axis, options);
    result.after = read_gains(objects, dialect);
    axis.disable();
    learning.succeed();
  } catch (const MasterError& error) {
    try_to([&] { axis.stop(); });
    try_to([&] { axis.disable(); });
    const std::string remedy = fmt::format("{}; {}", error.remedy(), learning.put_back());
    if (dynamic_cast<const Cancelled*>(&error) != nullptr) throw Cancelled(error.happened(), error.where(), remedy);
    throw MasterError(error.happened(), error.where(), remedy);
  } catch (...) {
    // For example, the progress cannot be printed. The destructor of `learning` restores the old gains.
    axis.try_to_switch_off();
    throw;
  }
  return result;
}

std::string note_of(const OwnTuningResult& result) {
  std::string note =
      "the drive chose these gains, and nothing was measured before and after; `tune` without --auto measures the loop";
  if (!result.inertia_settled) {
    note += "; the drive was still changing Kvp when the time to learn the inertia was over: repeat the tuning";
  }
  for (std::size_t i = 0; i < result.after.size(); ++i) {
    const catalogue::GainRole role = result.after[i].gain->role;
    if (role != catalogue::GainRole::velocity_kp && role != catalogue::GainRole::position_kp) continue;
    if (result.after[i].number >= result.before[i].number) continue;
    note += fmt::format("; {} is lower than before: the {} loop is slower", result.after[i].gain->name,
                        role == catalogue::GainRole::velocity_kp ? "velocity" : "position");
  }
  return note;
}

}  // namespace servodrome::master::tuning
