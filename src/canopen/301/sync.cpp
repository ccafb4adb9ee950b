#include "canopen/301/sync.hpp"

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;

namespace {
constexpr std::uint16_t cob_id_sync = 0x1005;
constexpr std::uint16_t counter_overflow = 0x1019;
constexpr std::uint16_t unexpected_length = 0x8240;
}  // namespace

void Sync::configure() {
  present_ = dictionary_.find(cob_id_sync, 0) != nullptr;
  const auto cob_id = value_of<std::uint32_t>(dictionary_, cob_id_sync, 0, 0x80);
  can_id_ = static_cast<std::uint16_t>(cob_id & cob_id::can_id_mask);
  const bool was_producing = producing_;
  const Time old_period = period_;
  period_ = std::chrono::microseconds(value_of<std::int64_t>(dictionary_, 0x1006, 0, 0));
  window_ = std::chrono::microseconds(value_of<std::int64_t>(dictionary_, 0x1007, 0, 0));
  overflow_ = value_of<std::uint8_t>(dictionary_, counter_overflow, 0, 0);
  // A device without 1019h has no counter and accepts SYNCs of any length.
  length_matters_ = dictionary_.find(counter_overflow, 0) != nullptr;
  expected_length_ = overflow_ != 0 ? 1 : 0;
  producing_ = profile_.sync_producer && (cob_id & cob_id::bit_30) != 0 && period_ != Time{0};
  if (!producing_) {
    deadline_ = never;
  } else if (!was_producing || old_period != period_) {
    // The first SYNC is sent within one period (CiA 301 7.5.2.5), with counter 1.
    counter_ = 1;
    deadline_ = link_.now() + period_;
    link_.wake_at(deadline_);
  }
}

AbortCode Sync::check(const dictionary::Entry& entry, std::uint32_t value) const {
  if (entry.index == counter_overflow) {
    // Can be changed only while 1006h is 0 (CiA 301 7.5.2.22).
    if (period_ != Time{0}) return AbortCode::device_state;
    return value == 1 || value > 240 ? AbortCode::value_invalid : AbortCode::none;
  }
  if (entry.index != cob_id_sync) return AbortCode::none;
  const auto present = value_of<std::uint32_t>(dictionary_, cob_id_sync, 0, 0);
  const std::uint32_t can_id = value & cob_id::can_id_mask;
  const bool id_changes = can_id != (present & cob_id::can_id_mask);
  const bool was_producer = (present & cob_id::bit_30) != 0;
  const bool becomes_producer = (value & cob_id::bit_30) != 0;
  if (!cob_id::is_base(value) || (id_changes && cob_id::is_restricted(can_id))) return AbortCode::value_invalid;
  if (id_changes && (profile_.sync_cob_id_fixed || was_producer)) return AbortCode::value_invalid;
  if (becomes_producer && !profile_.sync_producer) return AbortCode::value_invalid;
  return AbortCode::none;
}

void Sync::set_allowed(bool allowed) {
  if (allowed && !allowed_) {
    counter_ = 1;
    if (producing_) {
      deadline_ = link_.now() + period_;
      link_.wake_at(deadline_);
    }
  }
  allowed_ = allowed;
}

bool Sync::check_length(std::uint8_t length) {
  if (!length_matters_) return true;
  const bool wrong = length != expected_length_;
  if (wrong != length_error_) {
    length_error_ = wrong;
    if (wrong) {
      emergency_.begin(CommunicationError::sync_length, unexpected_length);
    } else {
      emergency_.end(CommunicationError::sync_length);
    }
  }
  return !wrong;
}

bool Sync::poll(std::uint8_t& counter) {
  if (!allowed_ || deadline_ == never) return false;
  if (link_.now() < deadline_) {
    link_.wake_at(deadline_);
    return false;
  }
  Frame frame;
  frame.id = can_id_;
  frame.length = expected_length_;
  frame.data[0] = overflow_ != 0 ? counter_ : std::uint8_t{0};
  counter = frame.data[0];
  link_.transmit_newest(frame, place_);  // at most one SYNC waits for the bus
  counter_ = counter_ >= overflow_ ? std::uint8_t{1} : static_cast<std::uint8_t>(counter_ + 1);
  // The next deadline is relative to the last one, so that delays of poll do not accumulate; after a long pause it
  // restarts.
  deadline_ += period_;
  if (deadline_ <= link_.now()) deadline_ = link_.now() + period_;
  link_.wake_at(deadline_);
  return true;
}

}  // namespace servodrome::canopen
