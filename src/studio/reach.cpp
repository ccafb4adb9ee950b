#include "studio/reach.hpp"

#include <fmt/format.h>
#include <limits>

#include "studio/order.hpp"

namespace servodrome::studio {
namespace {

struct Bounds {
  std::int32_t lowest;
  std::int32_t highest;
};

// nullopt: the object is absent, or contains no limits.
std::optional<Bounds> bounds_in(master::ObjectClient& objects, std::uint16_t index, master::SoftwareLimitSubs subs) {
  using Limits = std::numeric_limits<std::int32_t>;
  const auto lowest = objects.read_if_present<std::int32_t>(index, subs.lowest);
  const auto highest = objects.read_if_present<std::int32_t>(index, subs.highest);
  if (!lowest || !highest || *lowest >= *highest) return std::nullopt;
  if (*lowest == Limits::min() && *highest == Limits::max()) return std::nullopt;
  return Bounds{*lowest, *highest};
}

}  // namespace

Travel travel_by_objects(master::ObjectClient& objects, const master::AxisOptions& options, const drive::Policy& policy,
                         bool homed) {
  Travel travel;
  const auto demand = objects.read_if_present<std::int32_t>(0x6062);
  travel.place = demand ? *demand : master::Axis402(objects, options).position();
  if (policy.software_limits_need_homing && !homed) return travel;
  const auto limits = bounds_in(objects, 0x607D, options.dialect.software_limits);
  if (!limits) return travel;
  if (!policy.software_limits_switch_range_off && bounds_in(objects, 0x607B, {1, 2})) return travel;
  travel.ends = {{limits->lowest, false, "the lowest position of 607Dh"},
                 {limits->highest, true, "the highest position of 607Dh"}};
  return travel;
}

void require_within_travel(const Order& order, const Travel& travel, const std::string& axis) {
  if (!order.target) return;
  const std::int64_t target = order.target->number + (order.target->relative ? travel.place : 0);
  const TravelEnd* nearest = nullptr;
  for (const TravelEnd& end : travel.ends) {
    const std::int64_t sign = end.highest ? 1 : -1;
    const bool goes_beyond = sign * (target - end.position) > 0 && sign * (target - travel.place) > 0;
    if (goes_beyond && (nearest == nullptr || sign * (end.position - nearest->position) < 0)) nearest = &end;
  }
  if (nearest == nullptr) return;
  const auto shown = [&order](std::int64_t position) {
    return fmt::format("{:.{}f}", static_cast<double>(position) / order.scale.units().position,
                       order.in_revolutions ? 3 : 0);
  };
  throw api::ApiError{
      409,
      fmt::format("the move would end at {}, beyond {} at {} ({})", shown(target), nearest->what,
                  shown(nearest->position), order.in_revolutions ? "revolutions" : "units of the drive"),
      axis, "give a nearer target, or send \"beyond\": true to move to the end on purpose"};
}

}  // namespace servodrome::studio
