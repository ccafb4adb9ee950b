#include "canopen/node.hpp"

#include <algorithm>

#include "canopen/connection_set.hpp"
#include "canopen/object_access.hpp"

namespace servodrome::canopen {

namespace {
constexpr std::uint16_t overrun_code = 0x8110;
constexpr std::uint16_t error_passive_code = 0x8120;
constexpr std::uint16_t bus_off_recovered_code = 0x8140;
constexpr std::uint8_t sdo_length = 8;
constexpr std::uint8_t nmt_length = 2;
constexpr unsigned service_shift = 12;
constexpr std::uint16_t number_mask = 0x0FFF;
}  // namespace

Node::Node(dictionary::Dictionary& dictionary, const Profile& profile, DeviceEvents& events, const NodeMemory& memory)
    : dictionary_(dictionary),
      profile_(profile),
      events_(events),
      link_(memory.transmit_ring),
      emergency_(link_, dictionary, profile),
      rpdos_(link_, dictionary, profile, emergency_, events, memory.rpdos, memory.rpdo_objects, memory.rpdo_pending),
      tpdos_(link_, dictionary, profile, memory.tpdos, memory.tpdo_objects, memory.tpdo_synchronous,
             memory.tpdo_event_driven),
      sync_(link_, dictionary, profile, emergency_),
      sdo_(link_, dictionary, profile, memory.sdo_buffer),
      error_control_(link_, dictionary, profile),
      heartbeat_consumers_(link_, dictionary, profile_, events, memory.heartbeat_consumers),
      lss_(link_, dictionary, events) {
  dictionary.set_listener(dictionary::Owner::communication, this);
}

// ---- NMT (CiA 301 7.3.2) ----

void Node::start(std::uint8_t node_id, Time now) {
  link_.set_now(now);
  link_.clear_wake();
  link_.mute_until(Time{0});
  link_.discard();
  node_id_ = node_id;
  state_ = NmtState::initialising;
  bus_state_ = BusState::error_active;
  emergency_.set_allowed(false);
  sync_.set_allowed(false);  // a producer begins anew, with counter 1
  emergency_.start();
  events_.nmt_state_changed(state_);
  configure();
  boot();
}

void Node::reset(NmtCommand command) {
  node_id_ = lss_.pending_node_id();
  emergency_.set_allowed(false);
  sync_.set_allowed(false);
  rpdos_.set_operational(false);
  tpdos_.set_operational(false);
  state_ = NmtState::initialising;
  events_.nmt_state_changed(state_);
  const dictionary::Area restored =
      command == NmtCommand::reset_node ? profile_.reset_node_restores : profile_.reset_communication_restores;
  events_.reset(command, restored, node_id_);
  configure();
  boot();
}

void Node::configure() {
  link_.clear_wake();
  lss_.start(node_id_);
  emergency_.configure(node_id_);
  rpdos_.configure();
  tpdos_.configure();
  sync_.configure();
  const auto request =
      value_of<std::uint32_t>(dictionary_, 0x1200, 1, connection_set::sdo_request + std::uint32_t{node_id_});
  const auto response =
      value_of<std::uint32_t>(dictionary_, 0x1200, 2, connection_set::sdo_response + std::uint32_t{node_id_});
  sdo_.configure(request & cob_id::can_id_mask, response & cob_id::can_id_mask);
  error_control_.configure(node_id_);
  heartbeat_consumers_.configure();
  rebuild_dispatch();
}

// A node without node-ID stays in initialising and handles only LSS (CiA 305 "LSS waiting").
void Node::boot() {
  if (node_id_ == unconfigured_node_id) return;
  error_control_.boot_up();
  set_state(NmtState::pre_operational);
  if (profile_.starts_operational) set_state(NmtState::operational);
}

void Node::set_state(NmtState state) {
  if (state == state_) return;
  state_ = state;
  events_.nmt_state_changed(state);
  if (state == NmtState::stopped) sdo_.reset();
  emergency_.set_allowed(services_allowed());
  sync_.set_allowed(services_allowed());
  rpdos_.set_operational(state == NmtState::operational);
  tpdos_.set_operational(state == NmtState::operational);
}

void Node::receive_nmt(const Frame& frame) {
  check_length(frame, nmt_length);
  if (frame.length != 2 || (frame.data[1] != 0 && frame.data[1] != node_id_)) return;
  switch (static_cast<NmtCommand>(frame.data[0])) {
    case NmtCommand::start: set_state(NmtState::operational); break;
    case NmtCommand::stop: set_state(NmtState::stopped); break;
    case NmtCommand::enter_pre_operational: set_state(NmtState::pre_operational); break;
    case NmtCommand::reset_node:
    case NmtCommand::reset_communication: reset(static_cast<NmtCommand>(frame.data[0])); break;
    default: break;
  }
}

// ---- received frames ----

void Node::dispatch(std::uint32_t can_id, Service service, unsigned number) {
  std::uint16_t& slot = dispatch_[can_id];
  if (slot == 0) slot = static_cast<std::uint16_t>(static_cast<unsigned>(service) << service_shift | number);
}

// The first service that claims a CAN-ID gets it; RPDOs come last, and several may share one.
void Node::rebuild_dispatch() {
  dispatch_.fill(0);
  if (profile_.lss) dispatch(LssSlave::request_can_id, Service::lss);
  if (node_id_ == unconfigured_node_id) return;
  dispatch(0, Service::nmt);
  if (sync_.present()) dispatch(sync_.can_id(), Service::sync);
  dispatch(sdo_.request_can_id(), Service::sdo);
  for (std::size_t i = 0; i < heartbeat_consumers_.capacity(); ++i) {
    const std::uint8_t watched = heartbeat_consumers_[i].node_id;
    if (watched == 0) continue;
    dispatch(connection_set::error_control + watched, Service::heartbeat, static_cast<unsigned>(i));
  }
  const auto time = value_of<std::uint32_t>(dictionary_, 0x1012, 0, cob_id::invalid | connection_set::time);
  if (profile_.time_consumer && (time & cob_id::invalid) != 0) dispatch(time & cob_id::can_id_mask, Service::time);
  for (std::uint8_t sub = 1; sub < 128; ++sub) {
    const dictionary::Entry* entry = dictionary_.find(0x1028, sub);
    if (entry == nullptr) break;
    const auto emergency = static_cast<std::uint32_t>(dictionary_.number(*entry));
    if ((emergency & cob_id::invalid) == 0) dispatch(emergency & cob_id::can_id_mask, Service::emergency, sub);
  }
  for (std::size_t i = rpdos_.capacity(); i-- > 0;) {
    const auto number = static_cast<std::uint16_t>(i);
    rpdos_.link_same_can_id(number, Rpdo::none);
    if (!rpdos_[i].exists || !rpdos_[i].valid) continue;
    std::uint16_t& slot = dispatch_[rpdos_[i].can_id];
    if (static_cast<Service>(slot >> service_shift) == Service::rpdo) {
      rpdos_.link_same_can_id(number, slot & number_mask);
      slot = 0;
    }
    dispatch(rpdos_[i].can_id, Service::rpdo, number);
  }
}

void Node::receive(const Frame& frame, Time now) {
  link_.set_now(now);
  if (now > link_.wake()) run_due();  // first handles what was due before the frame
  if (frame.extended || frame.id >= dispatch_.size() || link_.muted()) return;
  if (frame.remote) return receive_remote(frame);
  const std::uint16_t slot = dispatch_[frame.id];
  const auto number = static_cast<std::uint16_t>(slot & number_mask);
  switch (static_cast<Service>(slot >> service_shift)) {
    case Service::none: break;
    case Service::rpdo: rpdos_.receive(number, frame); break;
    case Service::sync: {
      std::uint8_t counter = 0;
      if (sync_.receive(frame, counter)) act_on_sync(counter);
      break;
    }
    case Service::sdo:
      if (!services_allowed()) break;
      check_length(frame, sdo_length);
      sdo_.receive(frame);
      break;
    case Service::nmt: receive_nmt(frame); break;
    case Service::heartbeat: receive_heartbeat(static_cast<std::uint8_t>(number), frame); break;
    case Service::time: receive_time(frame); break;
    case Service::emergency: receive_emergency(static_cast<std::uint8_t>(number), frame); break;
    case Service::lss:
      if (lss_.receive(frame)) reset(NmtCommand::reset_communication);
      break;
  }
}

void Node::receive_remote(const Frame& frame) {
  if (node_id_ == unconfigured_node_id) return;
  if (frame.id != error_control_.can_id()) {
    tpdos_.remote_request(frame.id);
  } else if (error_control_.guard_request(state_)) {
    communication_restored(LossCause::life_guarding, CommunicationError::life_guarding);
  }
}

// Writes synchronous RPDOs before the TPDOs are sampled, so that these already reflect them.
void Node::act_on_sync(std::uint8_t counter) {
  rpdos_.sync(sync_.window_end());
  tpdos_.sync(counter);
  events_.sync(counter, link_.now());
}

// TIME OF DAY (CiA 301 7.1.6.6): 28 bits of milliseconds after midnight, then days since 1984-01-01.
void Node::receive_time(const Frame& frame) {
  if (frame.length != 6 || !services_allowed()) return;
  std::uint32_t milliseconds = 0;
  std::uint16_t days = 0;
  std::memcpy(&milliseconds, frame.data.data(), sizeof milliseconds);
  std::memcpy(&days, &frame.data[4], sizeof days);
  events_.time_of_day(milliseconds & 0x0FFFFFFF, days);
}

void Node::receive_heartbeat(std::uint8_t consumer, const Frame& frame) {
  if (heartbeat_consumers_.receive(consumer, frame)) {
    communication_restored(LossCause::heartbeat, CommunicationError::heartbeat);
  }
}

void Node::receive_emergency(std::uint8_t consumer, const Frame& frame) {
  if (frame.length != 8 || !services_allowed()) return;
  std::array<std::uint8_t, 5> vendor{};
  std::copy_n(frame.data.begin() + 3, vendor.size(), vendor.begin());
  events_.emergency_received(consumer, static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8), frame.data[2],
                             vendor);
}

// ---- deadlines ----

void Node::run_due() {
  link_.clear_wake();
  if (link_.muted()) return link_.wake_at(link_.muted_until());
  if (node_id_ == unconfigured_node_id) return;
  std::uint8_t counter = 0;
  if (sync_.poll(counter)) act_on_sync(counter);
  if (error_control_.poll(state_)) communication_lost(LossCause::life_guarding, CommunicationError::life_guarding);
  for (unsigned lost = heartbeat_consumers_.poll(); lost > 0; --lost) {
    communication_lost(LossCause::heartbeat, CommunicationError::heartbeat);
  }
  rpdos_.poll();
  tpdos_.poll();
  sdo_.poll();
  emergency_.poll();
}

// The transmit queue is empty: lost frames can be reported, and a block upload may continue.
bool Node::produce() {
  if (link_.take_overrun()) {
    emergency_.begin(CommunicationError::overrun, overrun_code);
    emergency_.end(CommunicationError::overrun);
    if (link_.next() != nullptr) return true;
  }
  Frame frame;
  return sdo_.produce(frame) && link_.transmit(frame);
}

// ---- communication errors (CiA 301 7.5.2.33, object 1029h) ----

void Node::communication_lost(LossCause cause, CommunicationError error) {
  LossReaction standard;
  standard.behaviour = value_of<ErrorBehaviour>(dictionary_, 0x1029, 1, profile_.error_behaviour);
  if (cause == LossCause::bus_off) standard.emergency_code = 0;  // no EMCY can be sent now
  const LossReaction reaction = events_.communication_lost(cause, standard);
  if (reaction.emergency_code != 0) emergency_.begin(error, reaction.emergency_code);
  if (reaction.behaviour == ErrorBehaviour::stopped) {
    set_state(NmtState::stopped);
  } else if (reaction.behaviour == ErrorBehaviour::pre_operational && state_ == NmtState::operational) {
    set_state(NmtState::pre_operational);
  }
}

// Reports a frame of wrong length as an error that begins and ends at once.
void Node::check_length(const Frame& frame, std::uint8_t expected) {
  if (frame.length == expected || profile_.frame_length_code == 0) return;
  emergency_.begin(CommunicationError::frame_length, profile_.frame_length_code);
  emergency_.end(CommunicationError::frame_length);
}

void Node::communication_restored(LossCause cause, CommunicationError error) {
  if (profile_.errors_clear_on_restored_communication) emergency_.end(error);
  events_.communication_restored(cause);
}

void Node::bus_state(BusState state, Time now) {
  link_.set_now(now);
  if (state == bus_state_ || node_id_ == unconfigured_node_id) return;
  const BusState before = bus_state_;
  bus_state_ = state;
  if (state == BusState::bus_off) {
    tpdos_.bus_off();
    link_.discard();
    sdo_.reset();
    communication_lost(LossCause::bus_off, CommunicationError::bus_off);
    return;
  }
  if (before == BusState::bus_off) {
    if (profile_.bus_off_is_reported_on_recovery) {
      emergency_.begin(CommunicationError::bus_off, bus_off_recovered_code);
      emergency_.end(CommunicationError::bus_off);
    }
    events_.communication_restored(LossCause::bus_off);
  }
  if (state == BusState::error_passive) {
    emergency_.begin(CommunicationError::error_passive, error_passive_code);
  } else {
    emergency_.end(CommunicationError::error_passive);
  }
}

}  // namespace servodrome::canopen
