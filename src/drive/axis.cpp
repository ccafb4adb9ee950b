#include "drive/axis.hpp"

#include <limits>

namespace servodrome::drive {

bool Axis::range_set() const {
  const std::int32_t low = objects.min_position_range_limit;
  const std::int32_t high = objects.max_position_range_limit;
  const bool all = low == std::numeric_limits<std::int32_t>::min() && high == std::numeric_limits<std::int32_t>::max();
  return low < high && !all;
}

Axis::UserLimits Axis::software_limits() const {
  UserLimits limits{objects.min_position_limit, objects.max_position_limit};
  if (policy.limits.software_switches_range_off || !range_set()) return limits;
  return {std::max<std::int64_t>(limits.least, objects.min_position_range_limit),
          std::min<std::int64_t>(limits.greatest, objects.max_position_range_limit)};
}

bool Axis::software_limits_active() const {
  const std::int32_t low = objects.min_position_limit;
  const std::int32_t high = objects.max_position_limit;
  if (low >= high) return false;
  if (low == std::numeric_limits<std::int32_t>::min() && high == std::numeric_limits<std::int32_t>::max()) return false;
  // If 607Dh allows the whole range 607Bh, there are no limits, because positions wrap around.
  const bool whole_range = !policy.limits.software_switches_range_off && range_set() &&
                           low <= objects.min_position_range_limit && high >= objects.max_position_range_limit;
  const UserLimits limits = software_limits();
  return !whole_range && limits.least < limits.greatest && (homed || !policy.limits.software_needs_homing);
}

bool Axis::beyond_software_limits() const {
  if (!software_limits_active()) return false;
  const auto beyond = [limits = software_limits()](std::int64_t user) {
    return user < limits.least || user > limits.greatest;
  };
  return beyond(to_user_position(position())) || beyond(to_user_position(generator.nearest_position())) ||
         (commanded && beyond(*commanded));
}

bool Axis::at_position_limit() const { return at_limit(true) || at_limit(false); }

bool Axis::held_by_position_limit() const {
  const double velocity = generator.velocity();
  return ((at_limit(false) || stopped_at < 0) && velocity <= 0.0) ||
         ((at_limit(true) || stopped_at > 0) && velocity >= 0.0);
}

// `positive` selects the limit switch and the software limit towards larger counts.
bool Axis::at_limit(bool positive) const {
  if (active(positive ? Signal::positive_limit : Signal::negative_limit)) return true;
  if (!software_limits_active()) return false;
  const UserLimits limits = software_limits();
  const std::int64_t user = to_user_position(generator.nearest_position());
  return positive != units.position_inverted ? user >= limits.greatest : user <= limits.least;
}

bool Axis::keeps_software_limits() const {
  return policy.limits.target_beyond != OutOfLimits::fault && software_limits_active();
}

namespace {
constexpr double endless = std::numeric_limits<double>::infinity();
}  // namespace

Axis::Room Axis::kept_room_from(Counts place) const {
  return keeps_software_limits() ? room_from(place) : Room{endless, endless};
}

Axis::Room Axis::room_from(Counts place) const {
  if (!software_limits_active()) return {endless, endless};
  if (const std::int64_t turn = turn_of(place); turn != 0) place -= units.to_counts(turn);
  const UserLimits limits = software_limits();
  const auto [low, high] = std::minmax({units.to_counts(limits.least), units.to_counts(limits.greatest)});
  return {static_cast<double>(place - low), static_cast<double>(high - place)};
}

bool Axis::near_software_limit(double velocity, double deceleration) const {
  if (velocity == 0.0 || !keeps_software_limits()) return false;
  const double way = deceleration > 0.0 ? velocity * velocity / (2.0 * deceleration) : 0.0;
  const Room room = kept_room_from(demand.loop == Loop::position ? generator.nearest_position() : position());
  return (velocity < 0.0 ? room.below : room.above) < way + std::abs(velocity) * cycle_s;
}

double Axis::approach_velocity(double velocity, double deceleration) const {
  if (velocity == 0.0 || deceleration <= 0.0) return std::numeric_limits<double>::infinity();
  const Room room = kept_room_from(generator.nearest_position());
  const double way = velocity < 0.0 ? room.below : room.above;
  if (way < 0.0) return 0.0;
  return std::sqrt(2.0 * deceleration * (way + std::abs(velocity) * cycle_s));
}

bool Axis::too_fast_for_software_limit(double deceleration) const {
  if (deceleration <= 0.0 || !software_limits_active()) return false;
  const MotionState next = generator.after(cycle_s);
  constexpr double least = 1.0;  // counts: tolerance for the rounding of a planned motion that ends at a limit
  constexpr double most = 1e15;  // counts, farther than any limit
  const double way = std::clamp(next.velocity * next.velocity / (2.0 * deceleration) - least, 0.0, most);
  const Counts end = generator.nearest_position() + round_to_integer(next.position + std::copysign(way, next.velocity));
  return static_cast<double>(nearest_within_software_limits(end) - end) * next.velocity < 0.0;
}

Counts Axis::nearest_within_software_limits(Counts target) const {
  if (!software_limits_active()) return target;
  const std::int64_t turn = turn_of_demand();
  const UserLimits limits = software_limits();
  const auto [least, greatest] =
      std::minmax({units.to_counts(turn + limits.least), units.to_counts(turn + limits.greatest)});
  return std::clamp(target, least, greatest);
}

std::int64_t Axis::position_range() const {
  if (!range_set()) return 0;
  if (policy.limits.software_switches_range_off && software_limits_active()) return 0;
  return std::int64_t{objects.max_position_range_limit} - objects.min_position_range_limit + 1;
}

bool Axis::limits_bound_range() const {
  return software_limits_active() && (objects.min_position_limit > objects.min_position_range_limit ||
                                      objects.max_position_limit < objects.max_position_range_limit);
}

std::int64_t Axis::turn_of(Counts place) const {
  const std::int64_t shown = to_user_position(place);
  const std::int64_t turn = units.to_user(place) - shown;
  if (!software_limits_active()) return turn;
  const UserLimits limits = software_limits();
  const std::int64_t range = position_range();
  const std::int64_t length = range != 0 ? range : std::int64_t{1} << 32;
  // One count beyond an end of the range the shown position jumps to the other end, and the limits would jump with it.
  if (shown - limits.greatest > limits.least + length - shown) return turn + length;
  if (limits.least - shown > shown + length - limits.greatest) return turn - length;
  return turn;
}

std::int64_t Axis::within_limits_of_turn(std::int64_t user) const {
  const std::int64_t turn = turn_of_demand();
  const UserLimits limits = software_limits();
  return turn + std::clamp(user - turn, limits.least, limits.greatest);
}

std::int64_t Axis::to_user_position(Counts application) const {
  const std::int64_t user = units.to_user(application);
  const std::int64_t range = position_range();
  if (range == 0) return wrap_to_32_bits(user);
  const std::int64_t low = objects.min_position_range_limit;
  const std::int64_t within = (user - low) % range;
  return low + (within < 0 ? within + range : within);
}

}  // namespace servodrome::drive
