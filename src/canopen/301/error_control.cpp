#include "canopen/301/error_control.hpp"

#include <algorithm>

#include "canopen/connection_set.hpp"
#include "canopen/object_access.hpp"

namespace servodrome::canopen {

namespace {
constexpr std::uint8_t guarding_toggle_bit = 0x80;
}  // namespace

void ErrorControl::configure(std::uint8_t node_id) {
  can_id_ = static_cast<std::uint16_t>(connection_set::error_control + node_id);
  toggle_ = false;
  lost_ = false;
  heartbeat_time_ = Time{0};
  heartbeat_deadline_ = never;
  life_deadline_ = never;
  place_ = Link::no_place;  // a heartbeat still in the queue keeps its place before the boot-up message
  reconfigure();
}

void ErrorControl::reconfigure() {
  const Time heartbeat = std::chrono::milliseconds(value_of<int>(dictionary_, 0x1017, 0, 0));
  if (heartbeat != heartbeat_time_) {
    heartbeat_time_ = heartbeat;
    heartbeat_deadline_ = heartbeat == Time{0} ? never : link_.now();  // the first heartbeat is due at once
    link_.wake_at(heartbeat_deadline_);
  }
  life_time_ = std::chrono::milliseconds(std::int64_t{value_of<int>(dictionary_, 0x100C, 0, 0)} *
                                         value_of<int>(dictionary_, 0x100D, 0, 0));
  if (life_time_ == Time{0} || !guarding_allowed()) {
    life_deadline_ = never;
  } else if (life_deadline_ != never) {
    // A shorter life time acts at once, a longer one from the next request on (CiA 301 7.2.8.2.2.1).
    life_deadline_ = std::min(life_deadline_, link_.now() + life_time_);
    link_.wake_at(life_deadline_);
  }
}

// The boot-up message is the first error control message; the heartbeat period starts with it.
void ErrorControl::boot_up() {
  link_.transmit(message(0));
  if (heartbeat_time_ != Time{0}) {
    heartbeat_deadline_ = link_.now() + heartbeat_time_;
    link_.wake_at(heartbeat_deadline_);
  }
}

Frame ErrorControl::message(std::uint8_t state) const {
  Frame frame;
  frame.id = can_id_;
  frame.length = 1;
  frame.data[0] = state;
  return frame;
}

bool ErrorControl::guard_request(NmtState state) {
  if (!guarding_allowed()) return false;
  link_.transmit(
      message(static_cast<std::uint8_t>(static_cast<std::uint8_t>(state) | (toggle_ ? guarding_toggle_bit : 0U))));
  toggle_ = !toggle_;
  // Life guarding starts with the first request (CiA 301 7.2.8.2.2.1).
  if (life_time_ != Time{0}) {
    life_deadline_ = link_.now() + life_time_;
    link_.wake_at(life_deadline_);
  }
  const bool was_lost = lost_;
  lost_ = false;
  return was_lost;
}

bool ErrorControl::poll(NmtState state) {
  const Time now = link_.now();
  if (heartbeat_deadline_ <= now) {
    link_.transmit_newest(message(static_cast<std::uint8_t>(state)), place_);  // at most one heartbeat waits
    heartbeat_deadline_ += heartbeat_time_;
    if (heartbeat_deadline_ <= now) heartbeat_deadline_ = now + heartbeat_time_;
  }
  link_.wake_at(heartbeat_deadline_);
  if (life_deadline_ <= now) {
    life_deadline_ = never;
    lost_ = true;
    return true;
  }
  link_.wake_at(life_deadline_);
  return false;
}

}  // namespace servodrome::canopen
