#include "canopen/301/rpdo.hpp"

#include <algorithm>
#include <utility>

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;

namespace {
constexpr std::uint16_t rpdo_parameter = 0x1400;
constexpr std::uint16_t rpdo_mapping = 0x1600;
constexpr std::uint16_t not_processed = 0x8210;
constexpr std::uint16_t length_exceeded = 0x8220;
constexpr std::uint16_t timeout = 0x8250;
// A length error ends with the next frame of correct length, or after this time without a wrong one.
constexpr Time length_error_time = std::chrono::seconds(1);
}  // namespace

void Rpdos::configure() {
  operational_ = false;
  window_end_ = never;
  pending_count_ = 0;
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    pdos_[i] = {};
    configure(static_cast<std::uint16_t>(i));
  }
}

void Rpdos::configure(std::uint16_t number) {
  Rpdo& pdo = pdos_[number];
  const auto index = static_cast<std::uint16_t>(rpdo_parameter + number);
  const auto mapping_index = static_cast<std::uint16_t>(rpdo_mapping + number);
  // Data that wait for SYNC belong to the old configuration: the PDO may have another type or mapping now, or be
  // invalid (CiA 301 7.5.2.35, 7.5.2.36).
  drop_pending(number);
  pdo.exists = dictionary_.find(index, 1) != nullptr;
  if (!pdo.exists) return;
  const auto cob_id = value_of<std::uint32_t>(dictionary_, index, 1, cob_id::invalid);
  pdo.valid = (cob_id & cob_id::invalid) == 0;
  pdo.can_id = static_cast<std::uint16_t>(cob_id & cob_id::can_id_mask);
  pdo.synchronous = value_of<std::uint8_t>(dictionary_, index, 2, 255) <= last_synchronous_type;
  pdo.event_time = std::chrono::milliseconds(value_of<int>(dictionary_, index, 5, 0));
  const auto count = value_of<std::uint8_t>(dictionary_, mapping_index, 0, 0);
  if (resolve_all(dictionary_, profile_, Direction::receive, mapping_index, count, objects(number), pdo.mapping) !=
      AbortCode::none) {
    pdo.valid = false;  // a stored or default mapping that this device does not support
  }
  if (!pdo.valid || pdo.event_time == Time{0}) {
    pdo.deadline = never;
    end_timeout(pdo);
  } else if (pdo.deadline != never) {
    // A shorter time acts at once, a longer one from the next reception on (CiA 301 7.5.2.35).
    pdo.deadline = std::min(pdo.deadline, link_.now() + pdo.event_time);
    link_.wake_at(pdo.deadline);
  }
}

void Rpdos::drop_pending(std::uint16_t number) {
  if (!std::exchange(pdos_[number].pending, false)) return;
  const auto waiting = pending_.first(pending_count_);
  pending_count_ = static_cast<std::size_t>(std::remove(waiting.begin(), waiting.end(), number) - waiting.begin());
}

void Rpdos::end_timeout(Rpdo& pdo) {
  if (!std::exchange(pdo.timed_out, false)) return;
  emergency_.end(CommunicationError::rpdo_timeout);
  events_.communication_restored(LossCause::rpdo_timeout);
}

AbortCode Rpdos::check(const dictionary::Entry& entry, std::uint32_t value) const {
  const PdoConfiguration rules{dictionary_, profile_};
  if (entry.index >= rpdo_mapping) {
    return rules.check_mapping(Direction::receive,
                               static_cast<std::uint16_t>(entry.index - rpdo_mapping + rpdo_parameter), entry, value,
                               entries_);
  }
  switch (entry.sub) {
    case 1: return rules.check_cob_id(entry.index, value);
    case 2:
      return profile_.rpdo_types.contains(static_cast<std::uint8_t>(value)) ? AbortCode::none
                                                                            : AbortCode::value_invalid;
    default: return AbortCode::none;
  }
}

void Rpdos::set_operational(bool operational) {
  operational_ = operational;
  for (std::size_t i = 0; i < pending_count_; ++i) pdos_[pending_[i]].pending = false;
  pending_count_ = 0;
  for (Rpdo& pdo : pdos_) pdo.deadline = never;
}

bool Rpdos::check_length(Rpdo& pdo, std::uint8_t length) {
  const std::uint8_t expected = pdo.mapping.bytes();
  const auto update = [this](bool& state, bool now, CommunicationError error, std::uint16_t code) {
    if (state == now) return;
    state = now;
    if (now) {
      emergency_.begin(error, code);
    } else {
      emergency_.end(error);
    }
  };
  update(pdo.too_short, length < expected, CommunicationError::rpdo_too_short, not_processed);
  update(pdo.too_long, profile_.rpdo_excess_length_is_reported && length > expected, CommunicationError::rpdo_too_long,
         length_exceeded);
  pdo.length_error_end = pdo.too_short || pdo.too_long ? link_.now() + length_error_time : never;
  link_.wake_at(pdo.length_error_end);
  return length >= expected;
}

void Rpdos::receive_one(std::uint16_t number, Rpdo& pdo, const Frame& frame) {
  if (pdo.mapping.count == 0) return;
  if (frame.length != pdo.mapping.bytes() || pdo.too_short || pdo.too_long) {
    if (!check_length(pdo, frame.length)) return;
  }
  if (pdo.event_time != Time{0}) {
    end_timeout(pdo);
    pdo.deadline = link_.now() + pdo.event_time;
    link_.wake_at(pdo.deadline);
  }
  std::uint64_t word = 0;
  std::memcpy(&word, frame.data.data(), sizeof word);
  if (!pdo.synchronous) {
    tell(number, unpack(dictionary_, mapped(number), word));
    return;
  }
  // After the synchronous window no PDO is accepted until the next SYNC (CiA 301 7.5.2.7).
  if (link_.now() > window_end_) return;
  pdo.received = word;
  if (!pdo.pending) {
    pdo.pending = true;
    pending_[pending_count_++] = number;
  }
}

std::span<const MappedObject> Rpdos::mapped(std::uint16_t number) {
  return std::span<const MappedObject>(objects(number)).first(pdos_[number].mapping.count);
}

void Rpdos::tell(std::uint16_t number, std::uint64_t to_tell) {
  tell_owners(dictionary_, mapped(number), to_tell);
  events_.rpdo_written(number);
}

void Rpdos::sync(Time window_end) {
  window_end_ = window_end;
  // First writes all values, then calls the owners; `received` keeps the bits of the owners to call.
  for (std::size_t i = 0; i < pending_count_; ++i) {
    Rpdo& pdo = pdos_[pending_[i]];
    pdo.pending = pdo.pending && pdo.valid;
    if (pdo.pending) pdo.received = unpack(dictionary_, mapped(pending_[i]), pdo.received);
  }
  for (std::size_t i = 0; i < pending_count_; ++i) {
    Rpdo& pdo = pdos_[pending_[i]];
    if (!pdo.pending) continue;
    pdo.pending = false;
    tell(pending_[i], pdo.received);
  }
  pending_count_ = 0;
}

void Rpdos::end_length_errors() {
  for (Rpdo& pdo : pdos_) {
    if (pdo.length_error_end > link_.now()) {
      link_.wake_at(pdo.length_error_end);
      continue;
    }
    pdo.length_error_end = never;
    if (std::exchange(pdo.too_short, false)) emergency_.end(CommunicationError::rpdo_too_short);
    if (std::exchange(pdo.too_long, false)) emergency_.end(CommunicationError::rpdo_too_long);
  }
}

void Rpdos::poll() {
  end_length_errors();
  if (!operational_) return;
  for (Rpdo& pdo : pdos_) {
    if (pdo.deadline > link_.now()) {
      link_.wake_at(pdo.deadline);
      continue;
    }
    pdo.deadline = never;
    // The timeout of one PDO is not a communication error in the sense of 1029h.
    const LossReaction reaction =
        events_.communication_lost(LossCause::rpdo_timeout, {timeout, ErrorBehaviour::no_change});
    pdo.timed_out = true;
    if (reaction.emergency_code != 0) emergency_.begin(CommunicationError::rpdo_timeout, reaction.emergency_code);
  }
}

}  // namespace servodrome::canopen
