#include "canopen/301/emergency.hpp"

#include <algorithm>

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

namespace {
constexpr std::uint8_t generic_error = 0x01;
constexpr std::uint8_t communication_error_bit = 0x10;
constexpr std::uint16_t error_field = 0x1003;
}  // namespace

void Emergency::start() {
  queued_ = 0;
  device_bits_ = 0;
  not_before_ = Time{0};
  clear_history();
}

void Emergency::configure(std::uint8_t node_id) {
  node_id_ = node_id;
  active_.fill(0);
  update_register();
  reconfigure();
}

void Emergency::reconfigure() {
  const auto cob_id = value_of<std::uint32_t>(dictionary_, 0x1014, 0, 0x80U + node_id_);
  valid_ = (cob_id & cob_id::invalid) == 0;
  can_id_ = static_cast<std::uint16_t>(cob_id & cob_id::can_id_mask);
  inhibit_time_ = std::chrono::microseconds(100) * value_of<int>(dictionary_, 0x1015, 0, 0);
}

void Emergency::update_register() {
  std::uint8_t bits = device_bits_;
  if (communication_error()) bits |= communication_error_bit;
  error_register_ = bits == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(bits | generic_error);
  if (std::byte* place = storage_of(dictionary_, 0x1001, 0)) *place = std::byte{error_register_};
}

void Emergency::raise(std::uint16_t code, std::uint8_t bits, const std::array<std::uint8_t, 5>& vendor) {
  device_bits_ = static_cast<std::uint8_t>(device_bits_ | bits | generic_error);
  update_register();
  record(code, vendor);
  queue(code, vendor);
}

void Emergency::hold(std::uint8_t bits) {
  device_bits_ = static_cast<std::uint8_t>(device_bits_ | bits | generic_error);
  update_register();
}

void Emergency::clear(std::uint8_t remaining, const std::array<std::uint8_t, 5>& vendor) {
  if (device_bits_ == 0) return;
  device_bits_ = remaining;
  update_register();
  if (tells_reset()) queue(0, vendor);
}

bool Emergency::tells_reset() const {
  return profile_.emergency_on_error_reset && (!profile_.error_reset_tells_the_last_only || error_register_ == 0);
}

bool Emergency::communication_error() const {
  return std::any_of(active_.begin(), active_.end(), [](std::uint16_t count) { return count != 0; });
}

void Emergency::begin(CommunicationError error, std::uint16_t code) {
  ++active_[static_cast<std::size_t>(error)];
  update_register();
  record(code, {});
  queue(code, {});
}

void Emergency::end(CommunicationError error) {
  std::uint16_t& count = active_[static_cast<std::size_t>(error)];
  if (count == 0) return;
  --count;
  update_register();
  if (count == 0 && tells_reset()) queue(0, {});
}

// The newest error goes to sub-index 1, older errors move up and the oldest is dropped (CiA 301 7.5.2.4).
void Emergency::record(std::uint16_t code, const std::array<std::uint8_t, 5>& vendor) {
  std::byte* count = storage_of(dictionary_, error_field, 0);
  if (count == nullptr) return;
  std::uint32_t moving = code | std::uint32_t{vendor[0]} << 16 | std::uint32_t{vendor[1]} << 24;
  const unsigned used = std::to_integer<unsigned>(*count);
  for (unsigned sub = 1; sub <= used + 1 && sub < 255; ++sub) {
    std::byte* place = storage_of(dictionary_, error_field, static_cast<std::uint8_t>(sub));
    if (place == nullptr) return;
    std::uint32_t displaced = 0;
    std::memcpy(&displaced, place, sizeof displaced);
    std::memcpy(place, &moving, sizeof moving);
    moving = displaced;
    if (sub > used) *count = std::byte{static_cast<std::uint8_t>(sub)};
  }
}

void Emergency::clear_history() {
  const std::uint32_t nothing = 0;
  if (std::byte* count = storage_of(dictionary_, error_field, 0)) *count = std::byte{0};
  for (unsigned sub = 1; sub < 255; ++sub) {
    std::byte* place = storage_of(dictionary_, error_field, static_cast<std::uint8_t>(sub));
    if (place == nullptr) return;
    std::memcpy(place, &nothing, sizeof nothing);
  }
}

// If the queue is full, the newest EMCY is dropped: the first cause is more important, and the history 1003h does not
// depend on the queue.
void Emergency::queue(std::uint16_t code, const std::array<std::uint8_t, 5>& vendor) {
  if (queued_ == queue_.size()) return;
  Frame& frame = queue_[queued_++];
  frame = {};
  frame.length = 8;
  frame.data = {static_cast<std::uint8_t>(code),
                static_cast<std::uint8_t>(code >> 8),
                error_register_,
                vendor[0],
                vendor[1],
                vendor[2],
                vendor[3],
                vendor[4]};
  send_waiting();
}

void Emergency::set_allowed(bool allowed) {
  allowed_ = allowed;
  send_waiting();
}

void Emergency::send_waiting() {
  if (!allowed_) return;
  std::uint8_t sent = 0;
  while (sent < queued_) {
    if (valid_) {
      if (link_.now() < not_before_) {
        link_.wake_at(not_before_);
        break;
      }
      queue_[sent].id = can_id_;
      if (!link_.transmit(queue_[sent])) {
        link_.wake_at(link_.now() + Link::retry_time);
        break;
      }
      not_before_ = link_.now() + inhibit_time_;
    }
    ++sent;
  }
  if (sent == 0) return;
  for (std::uint8_t i = sent; i < queued_; ++i) queue_[i - sent] = queue_[i];
  queued_ = static_cast<std::uint8_t>(queued_ - sent);
}

void Emergency::poll() {
  if (queued_ != 0) send_waiting();
}

}  // namespace servodrome::canopen
