#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <utility>

#include "watch_terms.hpp"

// Checks shown and latched positions, and the reaction to a lost master.
namespace servodrome::motion {

// Detects changes of the user coordinates: home, direction, range, unit.
void Watch::look_at_frame() {
  const drive::Units& units = drive_.axis().units;
  const Frame frame{drive_.position_offset(),
                    units.position.numerator,
                    units.position.denominator,
                    objects_.min_position_range_limit,
                    objects_.max_position_range_limit,
                    units.position_inverted,
                    units.velocity_inverted};
  if (frame != std::exchange(frame_, frame)) frame_since_ = tick_;
  if (tick_ % ms(2) == 0) way_ = {Way{position_, position_}, way_[0]};
  way_[0].low = std::min(way_[0].low, position_);
  way_[0].high = std::max(way_[0].high, position_);
}

// The position of a cyclic target in counts of the shaft: of all positions with these 32 bits the one nearest to the
// demand.
double Watch::nearest_place_of(std::int64_t user) const {
  const drive::Axis& axis = drive_.axis();
  const std::int64_t now = axis.units.to_user(axis.demand.position + drive_.position_offset());
  const std::int64_t way =
      static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(user - now)));
  return static_cast<double>(axis.units.to_counts(now + way) - drive_.position_offset());
}

// Checks 6064h against the shaft, in the product's units.
void Watch::shown_position() {
  if (tick_ % ms(1) != 0 || tick_ - frame_since_ < ms(5) || tick_ - spoiled_ < ms(20)) return;
  const drive::Units& units = drive_.axis().units;
  const bool special = units.position_inverted ||
                       objects_.min_position_range_limit != objects_.max_position_range_limit ||
                       std::abs(position_ + static_cast<double>(frame_.offset)) / units.position.value() > 2e9;
  if (!special) return;
  const std::int64_t shown = axis_.device().bus_dictionary().number(0x6064);
  const std::int64_t range = drive_.axis().position_range();
  if (range != 0 && (shown < objects_.min_position_range_limit || shown > objects_.max_position_range_limit))
    return fail("position-is-untrue", fmt::format("6064h is {}, out of 607Bh", shown));
  const double counts = (position_ + static_cast<double>(frame_.offset)) * (units.position_inverted ? -1.0 : 1.0);
  const double round = range != 0 ? static_cast<double>(range) : 4294967296.0;
  // Does not judge a shaft that a load drives so fast that it passes most of the range within a cycle.
  if (std::max(way_[0].high, way_[1].high) - std::min(way_[0].low, way_[1].low) > 0.4 * round * units.position.value())
    return;
  const double off = std::remainder(static_cast<double>(shown) - counts / units.position.value(), round) *
                     units.position.value() * (units.position_inverted ? -1.0 : 1.0);
  // 6064h may be as old as a cycle of the drive.
  const double slack = 3.0 + units.position.value();
  const double low = std::min(way_[0].low, way_[1].low) - slack;
  const double high = std::max(way_[0].high, way_[1].high) + slack;
  if (position_ + off < low || position_ + off > high)
    fail("position-is-untrue", fmt::format("6064h is {}, {:.1f} counts beside the shaft", shown, off));
}

// A touch probe must latch a position where the shaft has just been.
void Watch::touch_probes() {
  const drive::TouchProbe& probe = drive_.touch_probe();
  if (tick_ - spoiled_ < ms(20) || !was_powered_) {
    for (std::size_t slot = 0; slot < latched_.size(); ++slot) latched_[slot] = probe.position(slot);
    return;
  }
  const bool deviation =
      // the latched value is no position
      probe.capability().index_value == drive::TouchProbeCapability::IndexValue::deviation;
  const double low = std::min(way_[0].low, way_[1].low) - 2.0;
  const double high = std::max(way_[0].high, way_[1].high) + 2.0;
  for (std::size_t slot = 0; slot < latched_.size(); ++slot) {
    const auto latched = static_cast<double>(probe.position(slot));
    if (std::exchange(latched_[slot], probe.position(slot)) == probe.position(slot) || deviation) continue;
    if (probe.position(slot) == 0) continue;  // NMT reset node clears it
    if (latched < low || latched > high) {
      fail("probe-is-untrue", fmt::format("{:X}h latches {:.0f} counts beside the shaft's way", 0x60BA + slot,
                                          latched < low ? latched - low : latched - high));
    }
  }
}

// The loss of a master whose heartbeat was received must end the operation, as 6007h says (CiA 301 7.2.8.3.2.2, CiA
// 402-2 6007h).
void Watch::lost_master() {
  const canopen::Node* node = axis_.device().can_node();
  if (node == nullptr || around_->last_heartbeat < 0) return;
  if (tick_ % ms(1) == 0) {
    const auto consumer = static_cast<std::uint32_t>(axis_.device().bus_dictionary().number(0x1016, 1));
    if (consumer != std::exchange(consumer_, consumer)) consumer_since_ = tick_;
  }
  constexpr std::uint32_t of_master = 127;
  // The loss itself makes the node pre-operational (1029h).
  const canopen::NmtState nmt = node->nmt_state();
  const bool left = nmt == canopen::NmtState::pre_operational && nmt_since_ > around_->last_heartbeat;
  const bool hears = nmt == canopen::NmtState::operational || left;
  const std::int64_t since = std::max({consumer_since_, left ? 0 : nmt_since_, around_->joined}) + ms(5);
  const bool watched = consumer_ >> 16 == of_master && (consumer_ & 0xFFFF) != 0 && !around_->cut &&
                       around_->quiet_bus && hears && around_->last_heartbeat > since;
  // Checked exactly when the reaction is due, because an operation that begins later is a new one.
  const std::int64_t due = around_->last_heartbeat + ms(static_cast<double>(consumer_ & 0xFFFF) + 5.0);
  if (!watched || tick_ != due) return;
  const bool has_option = axis_.device().bus_dictionary().find(0x6007, 0) != nullptr;
  const std::int16_t option = objects_.abort_connection_option_code;
  const bool ends = !has_option || option == 1 || ((option == 2 || option == 3) && !lost_by_fault_only_);
  if (ends && state_ == PowerState::operation_enabled && tick_ - state_since_ > ms(12))
    fail("lost-master-ignored",
         fmt::format("the heartbeat is {:.1f} ms old, 6007h is {}",
                     static_cast<double>(tick_ - around_->last_heartbeat) / ticks_per_ms, option));
}

}  // namespace servodrome::motion
