#include "canopen/301/tpdo.hpp"

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;

namespace {
constexpr std::uint16_t tpdo_parameter = 0x1800;
constexpr std::uint16_t tpdo_mapping = 0x1A00;
constexpr std::uint8_t acyclic_synchronous = 0;
constexpr std::uint8_t synchronous_remote = 252;
constexpr std::uint8_t manufacturer_event_driven = 254;

// TPDOs that must not be lost, because neither a SYNC nor a remote frame requests them again.
bool by_event(const Tpdo& pdo) { return pdo.type == acyclic_synchronous || pdo.type >= manufacturer_event_driven; }

Frame frame_of(const Tpdo& pdo, std::uint64_t data) {
  Frame frame;
  frame.id = pdo.can_id;
  frame.length = pdo.mapping.bytes();
  std::memcpy(frame.data.data(), &data, sizeof data);
  return frame;
}
}  // namespace

void Tpdos::configure() {
  operational_ = false;
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    const std::uint64_t change_mask = pdos_[i].change_mask;  // set by the device, not part of the communication objects
    link_.withdraw(pdos_[i].place);
    pdos_[i] = {};
    pdos_[i].change_mask = change_mask;
    configure(static_cast<std::uint16_t>(i));
  }
}

void Tpdos::configure(std::uint16_t number) {
  Tpdo& pdo = pdos_[number];
  const auto index = static_cast<std::uint16_t>(tpdo_parameter + number);
  const auto mapping_index = static_cast<std::uint16_t>(tpdo_mapping + number);
  pdo.exists = dictionary_.find(index, 1) != nullptr;
  if (!pdo.exists) return;
  const bool was_valid = pdo.valid;
  const auto cob_id = value_of<std::uint32_t>(dictionary_, index, 1, cob_id::invalid);
  pdo.valid = (cob_id & cob_id::invalid) == 0;
  pdo.remote_allowed = profile_.remote_frames && (cob_id & cob_id::bit_30) == 0;
  pdo.can_id = static_cast<std::uint16_t>(cob_id & cob_id::can_id_mask);
  pdo.type = TransmissionTypes::in_force(value_of<std::uint8_t>(dictionary_, index, 2, 255));
  pdo.inhibit_time = profile_.inhibit_time_unit * value_of<int>(dictionary_, index, 3, 0);
  pdo.event_time = std::chrono::milliseconds(value_of<int>(dictionary_, index, 5, 0));
  pdo.sync_start_value = value_of<std::uint8_t>(dictionary_, index, 6, 0);
  pdo.syncs_left = pdo.type;
  pdo.awaits_sync_start = pdo.sync_start_value != 0 && pdo.type != 0 && pdo.type <= last_synchronous_type;
  pdo.on_change = pdo.type == manufacturer_event_driven ? profile_.type_254_sends_on_change
                  : pdo.type == 255                     ? profile_.type_255_sends_on_change
                                                        : false;
  const auto count = value_of<std::uint8_t>(dictionary_, mapping_index, 0, 0);
  if (resolve_all(dictionary_, profile_, Direction::transmit, mapping_index, count, objects(number), pdo.mapping) !=
      AbortCode::none) {
    pdo.valid = false;  // a stored or default mapping that this device does not support
  }
  if (pdo.mapping.count == 0) pdo.valid = false;
  pdo.event_deadline = never;
  if (operational_ && pdo.valid && pdo.type >= manufacturer_event_driven && pdo.event_time != Time{0}) {
    pdo.event_deadline = link_.now() + pdo.event_time;
    link_.wake_at(pdo.event_deadline);
  }
  if (!pdo.valid) pdo.waiting = false;
  const bool withdrawn = link_.withdraw(pdo.place);  // it waited with the old configuration
  const bool event_triggered = pdo.on_change || pdo.type == acyclic_synchronous;
  if (operational_ && pdo.valid && (!was_valid || withdrawn) && event_triggered) trigger(number);
  rebuild_lists();
}

void Tpdos::rebuild_lists() {
  synchronous_count_ = 0;
  event_driven_count_ = 0;
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    const Tpdo& pdo = pdos_[i];
    if (!pdo.valid) continue;
    if (pdo.type <= last_synchronous_type || pdo.type == synchronous_remote) {
      synchronous_[synchronous_count_++] = static_cast<std::uint16_t>(i);
    }
    if (pdo.type >= manufacturer_event_driven) event_driven_[event_driven_count_++] = static_cast<std::uint16_t>(i);
  }
}

AbortCode Tpdos::check(const dictionary::Entry& entry, std::uint32_t value) const {
  const PdoConfiguration rules{dictionary_, profile_};
  if (entry.index >= tpdo_mapping) {
    return rules.check_mapping(Direction::transmit,
                               static_cast<std::uint16_t>(entry.index - tpdo_mapping + tpdo_parameter), entry, value,
                               entries_);
  }
  switch (entry.sub) {
    case 1: return rules.check_cob_id(entry.index, value);
    case 2:
      return profile_.tpdo_types.contains(static_cast<std::uint8_t>(value)) ? AbortCode::none
                                                                            : AbortCode::value_invalid;
    case 3:
    case 6:
      // Cannot be changed while the PDO is valid (CiA 301 7.5.2.37).
      if (!profile_.valid_pdo_parameters_may_change && rules.is_valid(entry.index)) return AbortCode::value_invalid;
      return entry.sub == 6 && value > 240 ? AbortCode::value_invalid : AbortCode::none;
    default: return AbortCode::none;
  }
}

void Tpdos::set_operational(bool operational) {
  operational_ = operational;
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    Tpdo& pdo = pdos_[i];
    link_.withdraw(pdo.place);
    pdo.waiting = false;
    pdo.event_deadline = never;
    pdo.syncs_left = pdo.type;
    pdo.awaits_sync_start = pdo.sync_start_value != 0 && pdo.type != 0 && pdo.type <= last_synchronous_type;
    if (!operational || !pdo.valid) continue;
    if (pdo.type >= manufacturer_event_driven && pdo.event_time != Time{0}) {
      pdo.event_deadline = link_.now() + pdo.event_time;
      link_.wake_at(pdo.event_deadline);
    }
    // Sends the first value in this operational phase.
    if (pdo.on_change || pdo.type == acyclic_synchronous) trigger(static_cast<std::uint16_t>(i));
  }
}

void Tpdos::bus_off() {
  for (Tpdo& pdo : pdos_) {
    if (link_.withdraw(pdo.place) && by_event(pdo)) hold(pdo);
  }
}

// If the last frame still waits for the bus, it is overwritten with the new data.
void Tpdos::send(Tpdo& pdo, std::uint64_t data) {
  const Time now = link_.now();
  Frame* frame = link_.newest(pdo.place);
  if (frame == nullptr) {
    pdo.waiting = by_event(pdo);
    pdo.not_before = now + Link::retry_time;
    link_.wake_at(pdo.not_before);
    return;
  }
  *frame = frame_of(pdo, data);
  pdo.data = data;
  pdo.waiting = false;
  pdo.not_before = now + pdo.inhibit_time;
  if (pdo.event_deadline != never) {
    pdo.event_deadline = now + pdo.event_time;
    link_.wake_at(pdo.event_deadline);
  }
}

void Tpdos::send_when_allowed(std::uint16_t number, Tpdo& pdo) {
  may_send(pdo) ? send(pdo, pack_data(number, pdo)) : hold(pdo);
}

// Sends TPDOs whose data have changed. A frame that still waits for the bus, for any reason, gets the new data,
// including bits outside the change mask.
void Tpdos::update_event_driven() {
  for (std::size_t i = 0; i < event_driven_count_; ++i) {
    const std::uint16_t number = event_driven_[i];
    Tpdo& pdo = pdos_[number];
    const bool queued = link_.waits(pdo.place);
    const bool watched = pdo.on_change && !pdo.waiting;  // a waiting TPDO is packed again after its inhibit time
    if (!queued && !watched) continue;
    const std::uint64_t data = pack_data(number, pdo);
    if (watched && ((data ^ pdo.data) & pdo.change_mask) != 0) {
      may_send(pdo) ? send(pdo, data) : hold(pdo);
    } else if (queued && data != pdo.data) {
      link_.transmit_newest(frame_of(pdo, data), pdo.place);
      pdo.data = data;
    }
  }
}

void Tpdos::trigger(std::uint16_t number) {
  Tpdo& pdo = pdos_[number];
  if (!operational_ || !pdo.valid) return;
  if (pdo.type == acyclic_synchronous) {
    pdo.waiting = true;
  } else if (pdo.type >= manufacturer_event_driven) {
    send_when_allowed(number, pdo);
  }
}

void Tpdos::sync(std::uint8_t counter) {
  if (!operational_) return;
  for (std::size_t i = 0; i < synchronous_count_; ++i) {
    const std::uint16_t number = synchronous_[i];
    Tpdo& pdo = pdos_[number];
    if (pdo.type == synchronous_remote) {
      pdo.data = pack_data(number, pdo);
    } else if (pdo.type == acyclic_synchronous) {
      const std::uint64_t data = pack_data(number, pdo);
      if (pdo.waiting || ((data ^ pdo.data) & pdo.change_mask) != 0) send(pdo, data);
    } else {
      if (pdo.awaits_sync_start && counter != 0) {
        if (counter != pdo.sync_start_value) continue;
        pdo.awaits_sync_start = false;
        pdo.syncs_left = 1;  // the SYNC with the start value counts as the first one, and the TPDO is sent with it
      }
      if (--pdo.syncs_left != 0) continue;
      pdo.syncs_left = pdo.type;
      send(pdo, pack_data(number, pdo));
    }
  }
}

// A synchronous TPDO answers with the data sampled at the last SYNC, any other with the present data.
void Tpdos::remote_request(std::uint32_t can_id) {
  if (!operational_) return;
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    Tpdo& pdo = pdos_[i];
    if (!pdo.valid || !pdo.remote_allowed || pdo.can_id != can_id) continue;
    if (pdo.type <= last_synchronous_type || pdo.type == synchronous_remote) {
      send(pdo, pdo.data);
    } else {
      send_when_allowed(static_cast<std::uint16_t>(i), pdo);
    }
  }
}

void Tpdos::poll() {
  if (!operational_) return;
  const Time now = link_.now();
  for (std::size_t i = 0; i < pdos_.size(); ++i) {
    Tpdo& pdo = pdos_[i];
    const bool held = pdo.waiting && pdo.type != acyclic_synchronous;
    const bool due = held || pdo.event_deadline <= now;
    if (due && may_send(pdo)) {
      send(pdo, pack_data(i, pdo));
    } else if (due) {
      hold(pdo);
    } else {
      link_.wake_at(pdo.event_deadline);
    }
  }
}

}  // namespace servodrome::canopen
