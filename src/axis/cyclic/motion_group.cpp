#include "axis/cyclic/motion_group.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "axis/cyclic/quick_stop.hpp"
#include "links/time.hpp"
#include "master/emergency.hpp"

namespace servodrome::master {

namespace {

std::string description_of_fault(const MotionAxis& axis) {
  if (axis.error_code() == 0) return name(axis.fault());
  return fmt::format("{}, 603Fh is {:04X}h {}", name(axis.fault()), axis.error_code(),
                     text_of_error_code(axis.error_code()));
}

}  // namespace

MotionGroup::MotionGroup(CyclicBus& bus, std::span<const MotionAxisOptions> options) : bus_(bus) {
  for (std::size_t i = 0; i < bus.size(); ++i) {
    const MotionAxisOptions own = options.empty() ? MotionAxisOptions{} : options[std::min(i, options.size() - 1)];
    axes_.emplace_back(CyclicAxis(bus.image(i)), bus.period(), own);
  }
  bus_.on_cycle([this] { cycle(); });
}

MotionGroup::~MotionGroup() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    try {
      request_quick_stop(bus_.image(i));
    } catch (...) {
      // The end of the bus stops this drive.
    }
  }
  bus_.on_cycle({});
}

void MotionGroup::cycle() {
  for (std::size_t i = 0; i < axes_.size(); ++i) axes_[i].read(bus_.is_fresh(i));
  if (program_) program_();
  if (watch_ && !seen_) seen_ = watch_();
  for (MotionAxis& axis : axes_) axis.advance();
  if (on_set_points_) on_set_points_();
  for (MotionAxis& axis : axes_) axis.write();
}

// The fault of the first axis that is switched on and has one, as a MasterError.
std::exception_ptr MotionGroup::present_fault() const {
  for (const MotionAxis& axis : axes_) {
    if (!axis.is_switched_on() || axis.is_resetting() || axis.fault() == AxisFault::none) continue;
    return std::make_exception_ptr(
        MasterError(description_of_fault(axis), axis.axis().where(), remedy_of(axis.fault())));
  }
  return nullptr;
}

bool MotionGroup::wait_until(const std::function<bool()>& done, Time timeout) {
  return run_until(done, timeout, [this] {
    if (const auto fault = present_fault()) std::rethrow_exception(fault);
  });
}

bool MotionGroup::run_until(const std::function<bool()>& done, Time timeout, const std::function<void()>& after_cycle) {
  const Time end = bus_.now() + timeout;
  seen_ = false;
  watch_ = done;
  struct Unwatch {
    std::function<bool()>& watch;
    ~Unwatch() { watch = {}; }
  } const unwatch{watch_};
  while (!seen_ && bus_.now() < end) {
    bus_.wait(std::min(bus_.period(), end - bus_.now()));
    after_cycle();
  }
  return seen_;
}

void MotionGroup::wait(Time span) {
  wait_until([] { return false; }, span);
}

void MotionGroup::enable(Time timeout) {
  for (MotionAxis& axis : axes_) axis.switch_on(true);
  const auto enabled = [](const MotionAxis& axis) { return axis.is_enabled(); };
  if (wait_until([&] { return std::all_of(axes_.begin(), axes_.end(), enabled); }, timeout)) return;
  MotionAxis& late = *std::find_if_not(axes_.begin(), axes_.end(), enabled);
  throw MasterError(fmt::format("it is not enabled: it is in state {}, mode {}", drive::name(late.axis().state()),
                                late.axis().mode()),
                    late.axis().where(), "check its supply, enable and safety inputs, and the modes it has (6502h)");
}

void MotionGroup::disable(const MotionLimits& limits, Time timeout) {
  if (!SetPointGenerator(links::to_seconds(bus_.period())).run_at(0.0, limits)) {
    throw MasterError("it is not disabled: a limit is not above 0", "motion group", "give limits above 0");
  }
  for (MotionAxis& axis : axes_) {
    // An axis with a fault has stopped already, or set-points cannot stop it.
    if (axis.fault() != AxisFault::none) axis.switch_on(false);
    axis.abort_homing();
    axis.run_at(0.0, limits);
  }
  std::exception_ptr first_fault;
  const auto note_fault = [&] {
    if (!first_fault) first_fault = present_fault();
  };
  const auto stands = [](const MotionAxis& axis) {
    return !axis.is_enabled() || (!axis.is_homing() && axis.is_done());
  };
  if (!run_until([&] { return std::all_of(axes_.begin(), axes_.end(), stands); }, timeout, note_fault)) {
    for (MotionAxis& axis : axes_) {
      if (!stands(axis)) axis.quick_stop();
    }
    note_fault();
  }
  for (MotionAxis& axis : axes_) axis.switch_on(false);
  const auto is_off = [](const MotionAxis& axis) {
    const PowerState state = axis.axis().state();
    return axis.has_read_inputs() && state != PowerState::operation_enabled && state != PowerState::quick_stop_active &&
           state != PowerState::fault_reaction_active;
  };
  const bool are_off = run_until([&] { return std::all_of(axes_.begin(), axes_.end(), is_off); }, timeout, note_fault);
  if (first_fault) std::rethrow_exception(first_fault);
  if (are_off) return;
  MotionAxis& late = *std::find_if_not(axes_.begin(), axes_.end(), is_off);
  const PowerState state = late.axis().state();
  throw MasterError(
      late.has_read_inputs() ? fmt::format("it stays in {}", drive::name(state)) : "its process data were not received",
      late.axis().where(), "check the bus; switch its power off");
}

void MotionGroup::reset_faults(Time timeout) {
  const Time end = bus_.now() + timeout;
  // Before its first cycle a group does not know the faults of its drives.
  const auto has_read = [](const MotionAxis& axis) { return axis.has_read_inputs(); };
  run_until([&] { return std::all_of(axes_.begin(), axes_.end(), has_read); }, timeout, [] {});
  for (MotionAxis& axis : axes_) {
    if (axis.fault() != AxisFault::none) axis.reset_fault();
  }
  // However this call ends, no reset goes on afterwards: it would reset a later fault, too.
  struct Cancel {
    std::deque<MotionAxis>& axes;
    ~Cancel() {
      for (MotionAxis& axis : axes) axis.cancel_reset();
    }
  } const cancel{axes_};
  const auto sound = [](const MotionAxis& axis) { return axis.fault() == AxisFault::none; };
  const Time left = std::max(end - bus_.now(), bus_.period());
  if (wait_until([&] { return std::all_of(axes_.begin(), axes_.end(), sound); }, left)) return;
  MotionAxis& late = *std::find_if_not(axes_.begin(), axes_.end(), sound);
  throw MasterError(fmt::format("the fault cannot be reset: {}", description_of_fault(late)), late.axis().where(),
                    "remove its cause; some faults need power off and on");
}

double MotionGroup::start_together(std::span<const double> targets, std::span<const MotionLimits> limits) {
  if (targets.size() != axes_.size() || limits.empty()) {
    throw MasterError(fmt::format("{} targets and {} limits for {} axes", targets.size(), limits.size(), axes_.size()),
                      "motion group", "give a target for each axis, and limits");
  }
  const auto limits_of = [&](std::size_t axis) { return limits[std::min(axis, limits.size() - 1)]; };
  std::vector<double> durations;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    SetPointGenerator alone(axes_[i].generator().period_s());
    alone.reset(axes_[i].set_point());
    if (!axes_[i].is_enabled() || axes_[i].is_homing() || !alone.move_to(targets[i], 0.0, limits_of(i))) {
      throw MasterError(fmt::format("it cannot start a move to {}", targets[i]), axes_[i].axis().where(),
                        "enable it, and give a finite target and limits above 0");
    }
    durations.push_back(alone.duration_s());
  }
  const double longest = *std::max_element(durations.begin(), durations.end());
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (durations[i] == 0.0) continue;
    // Stretching a profile in time by the factor k divides velocities by k, accelerations by k^2 and jerks by k^3.
    const double k = longest / durations[i];
    MotionLimits own = limits_of(i);
    own.velocity /= k;
    own.acceleration /= k * k;
    own.deceleration /= k * k;
    own.jerk /= k * k * k;
    axes_[i].move_to(targets[i], 0.0, own);
  }
  return longest;
}

bool MotionGroup::all_done() const {
  return std::all_of(axes_.begin(), axes_.end(), [](const MotionAxis& axis) { return axis.is_done(); });
}

}  // namespace servodrome::master
