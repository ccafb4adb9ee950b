#include "ethercat/slave/slave.hpp"

#include "dictionary/store.hpp"

namespace servodrome::ethercat {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

// Events that can require work on the mailbox: a message was written or read, a repeat request, a state change.
constexpr std::uint32_t mailbox_events = reg::al_event::sync_manager0 << Mailbox::out |
                                         reg::al_event::sync_manager0 << Mailbox::in |
                                         reg::al_event::sync_manager_activation | reg::al_event::al_control;

}  // namespace

Slave::Slave(Esc& esc, dictionary::Dictionary& dictionary, const Profile& profile, SlaveEvents& events,
             SlaveMemory memory)
    : esc_(esc),
      dictionary_(dictionary),
      profile_(profile),
      events_(events),
      mailbox_(esc, memory.mailbox_waiting, memory.mailbox_last),
      sdo_(dictionary, profile.complete_access, memory.sdo),
      information_(dictionary, profile),
      outputs_(dictionary, Direction::outputs, profile, memory.outputs),
      inputs_(dictionary, Direction::inputs, profile, memory.inputs) {
  dictionary_.set_listener(dictionary::Owner::communication, this);
}

void Slave::start(Time now) {
  const AlState before = state_;
  state_ = AlState::init;
  error_ = identifies_ = false;
  code_ = AlStatusCode::none;
  operational_until_ = outputs_at_ = inputs_at_ = late_sync0_at_ = shifted_at_ = sampled_at_ = never;
  measures_cycle_ = false;
  loop_at_ = never;
  reset_mailbox();
  esc_.settle(~0U);
  esc_.put_off(0);
  open_process_data(false, false);
  report();
  forget_synchronisation();
  const bool shifts = (profile_.synchronisation & sync_support::dc_sync0) != 0;
  set_sync_parameter(sync_parameter::types_supported,
                     profile_.synchronisation | (shifts ? sync_support::local_shift : 0));
  set_sync_parameter(sync_parameter::least_cycle_time, profile_.least_cycle.count());
  if (before != AlState::init) events_.state_changed(before, AlState::init, AlStatusCode::none, now);
}

void Slave::poll(Time now) {
  if (puts_off(now)) return;
  sampled_at_ = never;
  overrun_ = false;
  esc_.put_off(0);
  esc_.set_quiet_until(Esc::unknown);
  esc_.poll(now);
  const std::uint32_t events = esc_.attention();
  esc_.settle(events);
  if ((events & Esc::attention_reset) != 0) {
    start(now);
    return;
  }
  if ((events & reg::al_event::watchdog_process_data) != 0 && state_ == AlState::operational) {
    fall_back(AlState::safe_operational, AlStatusCode::sync_manager_watchdog, now);
  }
  // Process data come before a state request, because they arrived in the old state.
  if ((events & reg::al_event::sync_manager0 << 2) != 0) outputs_arrived(now);
  if (now >= shifted_at_) exchange_shifted(now);  // shifts of the previous SYNC0
  if ((events & reg::al_event::sync0) != 0) sync0_came(now);
  if ((events & reg::al_event::sync_manager0 << 2) != 0) miss_sync0(now);
  if ((events & reg::al_event::sync_manager0 << 3) != 0 && inputs_run() && sync_type_ == SyncType::sync_manager &&
      outputs_.bytes() == 0) {
    exchange_event(0x1C33, now);  // without outputs, the reading of the inputs is the event
  }
  if ((events & reg::al_event::sync_manager_activation) != 0) follow_configuration(now);
  if ((events & reg::al_event::al_control) != 0) al_control_written(now);
  if (operational_until_ != never) await_operational(now);
  if ((events & mailbox_events) != 0 && mailbox_runs()) serve_mailbox();
}

bool Slave::puts_off(Time now) {
  if (sampling_cycle_ == Time{0}) return false;
  const std::uint32_t events = esc_.attention();
  if (events == 0 || (events & ~process_data_events) != 0) return false;
  if (sampled_at_ == never) sampled_at_ = (now / sampling_cycle_ + 1) * sampling_cycle_;
  if (now >= sampled_at_ || now >= next_deadline()) return false;
  esc_.put_off(overrun_ ? process_data_events : events);
  return true;
}

void Slave::process_image_updated(Time now) {
  loop_ = loop_at_ == never ? Time{0} : now - loop_at_;
  loop_at_ = now;
  if (inputs_run() && (overrun_ || sync_type_ == SyncType::free_run)) give_inputs();
}

void Slave::emergency(std::uint16_t error_code, std::uint8_t error_register, const std::array<std::uint8_t, 5>& data) {
  if (!mailbox_runs() || emergency_count_ == emergencies_.size()) return;
  emergencies_[emergency_count_++] = {error_code, error_register, data};
  if (!serves_mailbox_) serve_mailbox();  // otherwise it follows the answer to the request that caused it
}

void Slave::release_mail() {
  if (!mailbox_runs()) return;
  mailbox_.release();
  if (!serves_mailbox_) serve_mailbox();
}

void Slave::written(const Entry& entry) {
  const auto value = [&] { return dictionary_.number(entry.index, entry.sub); };
  if (entry.index == 0x1C32 && entry.sub == sync_parameter::type) wanted_sync_type_ = static_cast<SyncType>(value());
  if (entry.index != 0x1C32 && entry.index != 0x1C33) return;
  if (entry.sub == sync_parameter::get_cycle_time) cycle_measurement_written(static_cast<unsigned>(value()));
}

// ---- Mailbox ----

void Slave::reset_mailbox() {
  mailbox_.reset();
  sdo_.reset();
  information_.reset();
  foe_.reset();
  emergency_count_ = 0;
}

void Slave::serve_mailbox() {
  serves_mailbox_ = true;
  serve_letters();
  serves_mailbox_ = false;
}

void Slave::serve_letters() {
  mailbox_.follow_master();
  Message message;
  while (mailbox_.open(message)) {
    if (information_.has_next()) {
      information_.next(message);
      mailbox_.send(message);
      continue;
    }
    if (emergency_count_ != 0) {
      const Emergency& first = emergencies_[0];
      begin_coe(message, CoeService::emergency);
      message.u16(first.code);
      message.u8(first.error_register);
      message.bytes(std::span<const std::uint8_t>(first.data));
      mailbox_.send(message);
      std::copy(emergencies_.begin() + 1, emergencies_.end(), emergencies_.begin());
      --emergency_count_;
      continue;
    }
    Mailbox::Request request;
    if (!mailbox_.receive(request)) return;
    serve(request, message);
    mailbox_.done();
  }
}

void Slave::serve(const Mailbox::Request& request, Message& reply) {
  const bool coe = request.type == MailboxType::coe && state_ != AlState::bootstrap;
  const bool foe = request.type == MailboxType::foe && foe_.offered();
  if (request.data.empty()) {
    mailbox_.send_error(MailboxError::invalid_size);
  } else if (coe) {
    serve_coe(request, reply);
  } else if (!foe) {
    mailbox_.send_error(MailboxError::unsupported_protocol);
  } else if (request.data.size() < FoeServer::least_request) {
    mailbox_.send_error(MailboxError::size_too_short);
  } else {
    const std::size_t packet = esc_.sync_manager(Mailbox::out).length - mailbox_header_size - FoeServer::least_request;
    foe_.receive(request.data, packet, reply);
    if (reply.length != 0) mailbox_.send(reply);
  }
}

void Slave::serve_coe(const Mailbox::Request& request, Message& reply) {
  constexpr std::size_t least_sdo = 8;
  constexpr std::size_t least_information = 4;
  if (request.data.size() < coe_header_size) {
    mailbox_.send_error(MailboxError::size_too_short);
    return;
  }
  const auto service = static_cast<CoeService>(load_u16(request.data.data()) >> 12);
  const std::span<const std::uint8_t> data = request.data.subspan(coe_header_size);
  switch (service) {
    case CoeService::sdo_request:
      if (data.size() < least_sdo) {
        mailbox_.send_error(MailboxError::size_too_short);
        return;
      }
      sdo_.receive(data, reply);
      break;
    case CoeService::sdo_information:
      if (data.size() < least_information) {
        mailbox_.send_error(MailboxError::size_too_short);
        return;
      }
      information_.receive(data, reply);
      break;
    default: mailbox_.send_error(MailboxError::service_not_supported); return;
  }
  if (reply.length != 0) mailbox_.send(reply);
}

// ---- Objects ----

// Checks SDO writes of the objects that the slave owns (ETG.1000.6 clause 5.6.7, ETG.1020 clause 12).
AbortCode Slave::check(const Entry& entry, std::span<const std::byte> bytes) {
  const auto value = static_cast<std::uint32_t>(dictionary::decode_number(dictionary::Type::unsigned64, bytes));
  const std::uint16_t index = entry.index;
  if (index == 0x1010 || index == 0x1011) {
    // The write cannot fail after this check. Therefore the parameters are stored or reset here, where an error can be
    // returned.
    const bool storing = index == 0x1010;
    if (value != (storing ? dictionary::save_signature : dictionary::load_signature)) {
      return AbortCode::cannot_transfer_or_store;
    }
    const dictionary::Area areas = dictionary::area_of_storage_sub(entry.sub);
    return storing ? events_.store(areas) : events_.restore_defaults(areas);
  }
  // 0: a synchronisation error is only shown in 1C32h:20. 1, or the described device's own default: it ends
  // Operational.
  if (index == 0x10F1 && entry.sub == 1) {
    return value <= 1 || value == static_cast<std::uint32_t>(entry.default_value) ? AbortCode::none
                                                                                  : AbortCode::value_invalid;
  }
  if (index == 0x1C32 || index == 0x1C33) {
    if (!entry.writable()) return AbortCode::none;
    const bool shifts = entry.sub == sync_parameter::shift_time;
    if (entry.sub != sync_parameter::type && !shifts) return AbortCode::none;
    if (inputs_run()) return AbortCode::device_state;
    if (shifts) return AbortCode::none;
    const bool inputs = index == 0x1C33;
    // 22h in the inputs means: synchronised with the outputs' sync manager.
    const std::uint32_t type = inputs && value == 0x22 ? 1 : value;
    return type < 16 && (profile_.synchronisation >> type & 1) != 0 ? AbortCode::none : AbortCode::value_invalid;
  }
  const bool outputs = index == 0x1C12 || (index >= 0x1600 && index < 0x1800);
  const bool inputs = index == 0x1C13 || (index >= 0x1A00 && index < 0x1C00);
  if (!outputs && !inputs) return AbortCode::none;
  if (state_ != AlState::pre_operational) return AbortCode::device_state;
  const ProcessImage& image = outputs ? outputs_ : inputs_;
  const bool assigns = index >= 0x1C00;
  if (entry.sub != 0) {
    if (dictionary_.number(index, 0) != 0) return AbortCode::sub_index_0_not_zero;
    return assigns ? image.check_pdo(static_cast<std::uint16_t>(value)) : image.check_entry(value);
  }
  if (assigns) return image.check_assignment(value);
  return value == 0 ? AbortCode::none : image.check_count(index, value);
}

}  // namespace servodrome::ethercat
