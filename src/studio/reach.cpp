#include "studio/reach.hpp"

#include <fmt/format.h>

#include "catalogue/product.hpp"
#include "drive/axis.hpp"
#include "studio/order.hpp"

namespace servodrome::studio {
namespace {

// The pair stays 0, which means "off", if the drive does not have the object.
void read_span(master::ObjectClient& objects, std::uint16_t index, catalogue::SoftwareLimitSubs subs,
               std::int32_t& lowest, std::int32_t& highest) {
  const auto low = objects.read_if_present<std::int32_t>(index, subs.lowest);
  const auto high = objects.read_if_present<std::int32_t>(index, subs.highest);
  if (!low || !high) return;
  lowest = *low;
  highest = *high;
}

std::int64_t wrapped(std::int64_t position, const PositionSpan& range) {
  const std::int64_t length = range.highest - range.lowest + 1;
  const std::int64_t within = (position - range.lowest) % length;
  return range.lowest + (within < 0 ? within + length : within);
}

}  // namespace

Travel travel_by_objects(master::ObjectClient& objects, const master::AxisOptions& options, const drive::Policy& policy,
                         bool homed) {
  // A drive::Axis with these objects, as in the drive core, decides which limits act. Its counts are units of 6064h.
  drive::Objects values;
  read_span(objects, 0x607D, options.product->dialect.software_limits, values.min_position_limit,
            values.max_position_limit);
  if (options.product->dialect.has_position_range) {
    read_span(objects, 0x607B, {}, values.min_position_range_limit, values.max_position_range_limit);
  }
  drive::Axis axis{.objects = values, .policy = policy};
  axis.homed = homed;

  Travel travel;
  const auto demand = objects.read_if_present<std::int32_t>(0x6062);
  travel.place = demand ? *demand : master::Axis402(objects, options).position();
  if (axis.position_range() != 0) {
    travel.wraps_within = {values.min_position_range_limit, values.max_position_range_limit};
  }
  if (!axis.software_limits_active()) return travel;
  travel.place -= axis.turn_of(travel.place);
  const auto [least, greatest] = axis.software_limits();
  travel.limits = {least, greatest};
  // Where 607Dh leaves an end of the range 607Bh free, that end is the limit.
  travel.ends = {
      {least, false,
       least == values.min_position_limit ? "the lowest position of 607Dh" : "the lowest position of 607Bh", true},
      {greatest, true,
       greatest == values.max_position_limit ? "the highest position of 607Dh" : "the highest position of 607Bh",
       true}};
  return travel;
}

void require_within_travel(const Order& order, const Travel& travel, const std::string& axis) {
  if (!order.target) return;
  std::int64_t target = order.target->number;
  if (order.target->relative) {
    target += travel.place;
  } else if (travel.wraps_within) {
    target = wrapped(target, *travel.wraps_within);
  }
  const TravelEnd* nearest = nullptr;
  for (const TravelEnd& end : travel.ends) {
    const std::int64_t sign = end.highest ? 1 : -1;
    const bool is_beyond = sign * (target - end.position) > end.slack;
    const bool goes_beyond = is_beyond && (end.limits_target || sign * (target - travel.place) > 0);
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
