#include "studio/excitation.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <optional>

#include "axis/cia402_words.hpp"
#include "links/time.hpp"

namespace servodrome::studio {
namespace {

using master::OperationMode;
using master::PowerState;
using std::chrono::duration;
using std::chrono::duration_cast;

constexpr master::Time target_period = std::chrono::milliseconds(1);  // of the targets; a slow bus makes it longer
constexpr double ramp_margin = 20.0;  // ramps are steeper than the excitation by this factor

bool has_mode(master::Axis402& axis, OperationMode mode) {
  const auto supported = axis.objects().read_if_present<std::uint32_t>(0x6502);
  return supported && (*supported >> (static_cast<int>(mode) - 1) & 1U) != 0;
}

// Sets a steep ramp and restores the old value at its end.
class SteepRamp {
 public:
  // Sets `wanted`. If the drive refuses it, tries its half, its quarter and so on, but nothing below the old value.
  // Does not change a ramp of 0: a drive that accepts 0 uses its limit instead.
  SteepRamp(master::ObjectClient& objects, std::uint16_t index, double wanted) : objects_(objects), index_(index) {
    before_ = objects_.read_if_present<std::uint32_t>(index);
    if (!before_ || *before_ == 0) return;
    constexpr double most = std::numeric_limits<std::int32_t>::max();
    for (double ramp = std::min(wanted, most); ramp > *before_; ramp /= 2) {
      try {
        objects_.write<std::uint32_t>(index_, 0, static_cast<std::uint32_t>(ramp));
        return;
      } catch (const master::ObjectError& error) {
        if (!error.answered()) throw;
      }
    }
  }
  ~SteepRamp() {
    try {
      if (before_) objects_.write<std::uint32_t>(index_, 0, *before_);
    } catch (const master::MasterError&) {
      // The original error is reported instead.
    } catch (...) {
      // The task is ending: the exception is ignored.
    }
  }
  SteepRamp(const SteepRamp&) = delete;
  SteepRamp& operator=(const SteepRamp&) = delete;

 private:
  master::ObjectClient& objects_;
  std::uint16_t index_;
  std::optional<std::uint32_t> before_{};
};

// Brakes so that the axis rests within the permitted travel: the drive's ramp may be far too slow for a velocity that
// the excitation has reached.
void come_to_rest(master::Axis402& axis, const Excitation& excitation) {
  master::ObjectClient& objects = axis.objects();
  objects.write<std::int32_t>(0x60FF, 0, 0);
  const double speed = objects.read_if_present<std::int32_t>(0x606C).value_or(0) / excitation.revolution.velocity;
  const double travel = excitation.travel / excitation.revolution.position;
  const double ramp = speed * speed / (2 * travel) * excitation.revolution.acceleration;
  const SteepRamp limit(objects, 0x60C6, ramp);
  const SteepRamp down(objects, 0x6084, ramp);
  axis.set_mode(OperationMode::profile_velocity);
  axis.stop();
}

// Writes one target. A velocity uses cyclic synchronous velocity, which has no trajectory generator, if the drive has
// this mode, otherwise profile velocity. A torque uses profile torque, a position cyclic synchronous position.
class Target {
 public:
  Target(master::Axis402& axis, const Excitation& excitation)
      : axis_(axis), of_(excitation.of), amplitude_(excitation.amplitude) {
    master::ObjectClient& objects = axis_.objects();
    switch (of_) {
      case Excitation::Of::velocity: {
        const bool cyclic = has_mode(axis_, OperationMode::cyclic_synchronous_velocity);
        write(0.0);
        axis_.set_mode(cyclic ? OperationMode::cyclic_synchronous_velocity : OperationMode::profile_velocity);
        const double ramp = ramp_margin * std::abs(amplitude_) * excitation.steepness;
        if (!cyclic) {
          const double per_velocity = excitation.revolution.acceleration / excitation.revolution.velocity;
          up_.emplace(objects, std::uint16_t{0x6083}, ramp * per_velocity);
          down_.emplace(objects, std::uint16_t{0x6084}, ramp * per_velocity);
        }
        break;
      }
      case Excitation::Of::torque:
        write(0.0);
        axis_.set_mode(OperationMode::profile_torque);
        up_.emplace(objects, std::uint16_t{0x6087}, ramp_margin * std::abs(amplitude_) * excitation.steepness);
        break;
      case Excitation::Of::position:
        origin_ = axis_.position();
        write(0.0);
        axis_.set_mode(OperationMode::cyclic_synchronous_position);
        write(0.0);
        break;
    }
    objects.write<std::uint16_t>(0x6040, 0, master::command_word::enable_operation);
  }

  void write(double share) {
    const double value = amplitude_ * share;
    master::ObjectClient& objects = axis_.objects();
    switch (of_) {
      case Excitation::Of::velocity: return objects.write<std::int32_t>(0x60FF, 0, whole<std::int32_t>(value));
      case Excitation::Of::torque: return objects.write<std::int16_t>(0x6071, 0, whole<std::int16_t>(value));
      case Excitation::Of::position:
        return objects.write<std::int32_t>(0x607A, 0, whole<std::int32_t>(static_cast<double>(origin_) + value));
    }
  }

 private:
  template <typename T>
  static T whole(double value) {
    return static_cast<T>(std::clamp(std::round(value), static_cast<double>(std::numeric_limits<T>::min()),
                                     static_cast<double>(std::numeric_limits<T>::max())));
  }

  master::Axis402& axis_;
  Excitation::Of of_;
  double amplitude_;
  std::int32_t origin_ = 0;
  std::optional<SteepRamp> up_{};
  std::optional<SteepRamp> down_{};
};

void follow(master::Axis402& axis, const Excitation& excitation, const std::function<bool()>& cancelled) {
  master::ObjectClient& objects = axis.objects();
  const std::int64_t origin = axis.position();
  Target target(axis, excitation);
  const master::Time began = objects.now();
  for (master::Time next = began;;) {
    const double seconds = links::to_seconds(objects.now() - began);
    if (seconds >= excitation.seconds) break;
    if (cancelled && cancelled()) throw master::Cancelled("cancelled", objects.where(), "start the job again");
    target.write(excitation.shape(seconds));
    if (axis.state() != PowerState::operation_enabled) {
      throw master::MasterError("the drive left operation enabled", objects.where(),
                                "look at the error code; then reset the fault and enable again");
    }
    const std::int64_t distance = axis.position() - origin;
    if (std::abs(static_cast<double>(distance)) > excitation.travel) {
      throw master::MasterError(
          fmt::format("the axis moved {} units from its start, but only {:g} are allowed", distance, excitation.travel),
          objects.where(), "take a smaller amplitude or a higher frequency, or allow more travel");
    }
    next += target_period;
    if (next > objects.now())
      objects.wait(next - objects.now());
    else
      next = objects.now();
  }
  target.write(0.0);
}

}  // namespace

std::function<double(double)> sine_sweep(double from_hz, double to_hz, double seconds) {
  const double growth = std::log(to_hz / from_hz);
  return [=](double t) {
    const double turns = growth == 0.0 ? from_hz * t : from_hz * seconds / growth * std::expm1(growth * t / seconds);
    return std::sin(2.0 * std::numbers::pi * turns);
  };
}

std::function<double(double)> step(double seconds) {
  return [=](double t) { return t < seconds / 2 ? 1.0 : 0.0; };
}

double commanded_distance(const Excitation& excitation) {
  if (excitation.of == Excitation::Of::torque) return 0.0;
  if (excitation.of == Excitation::Of::position) return std::abs(excitation.amplitude);
  constexpr int steps = 20'000;
  const double step_s = excitation.seconds / steps;
  double share_s = 0.0;  // integral of the shape
  double greatest = 0.0;
  for (int i = 0; i < steps; ++i) {
    share_s += excitation.shape((i + 0.5) * step_s) * step_s;
    greatest = std::max(greatest, std::abs(share_s));
  }
  return greatest * std::abs(excitation.amplitude) / excitation.revolution.velocity * excitation.revolution.position;
}

void excite(master::Axis402& axis, const Excitation& excitation, const std::function<bool()>& cancelled) {
  if (axis.state() != PowerState::operation_enabled) {
    throw master::MasterError("the drive is not enabled", axis.objects().where(), "enable it first");
  }
  try {
    follow(axis, excitation, cancelled);
  } catch (...) {
    try {
      come_to_rest(axis, excitation);
    } catch (const master::MasterError&) {
      // The original error is reported instead.
    }
    throw;
  }
  come_to_rest(axis, excitation);
}

}  // namespace servodrome::studio
