// The EtherCAT state machine (ETG.1000.6 clause 6.4): the possible state changes, the checks before them, and refusals.
#include <utility>

#include "ethercat/slave/slave.hpp"

namespace servodrome::ethercat {

namespace {

constexpr unsigned state_mask = 0x0F;
constexpr unsigned acknowledge_bit = 0x10;     // in AL control: acknowledge; in AL status: error
constexpr unsigned identification_bit = 0x20;  // in AL control and AL status

constexpr unsigned used_sync_managers = 4;  // two for the mailbox, two for process data

constexpr bool is_state(unsigned value) { return value == 1 || value == 2 || value == 3 || value == 4 || value == 8; }

// Up by one step, down by any number of steps; Bootstrap only from and to Init (ETG.1000.6 table 102).
constexpr bool exists(AlState from, AlState to) {
  if (from == to || to == AlState::init) return true;
  switch (from) {
    case AlState::init: return to == AlState::pre_operational || to == AlState::bootstrap;
    case AlState::pre_operational: return to == AlState::safe_operational;
    case AlState::bootstrap: return false;
    case AlState::safe_operational: return to == AlState::pre_operational || to == AlState::operational;
    case AlState::operational: return to == AlState::pre_operational || to == AlState::safe_operational;
  }
  return false;
}

bool follows(const SyncManager& channel, const AreaRule& rule, bool master_writes) {
  return channel.active && channel.mode == SyncManager::Mode::mailbox && channel.master_writes == master_writes &&
         channel.start == rule.start && channel.length >= rule.least_length && channel.length <= rule.greatest_length;
}

}  // namespace

void Slave::report() {
  unsigned status = static_cast<unsigned>(state_) | (error_ ? acknowledge_bit : 0U);
  auto code = static_cast<std::uint16_t>(code_);
  if (identifies_ && !error_) {
    // The answer to an identification request: the station alias (ETG.1020 clause 14).
    status |= identification_bit;
    code = load_u16(esc_.registers(reg::station_alias));
  }
  esc_.set_al_status(static_cast<std::uint16_t>(status), code);
}

void Slave::refuse(AlStatusCode code) {
  error_ = code != AlStatusCode::none;
  code_ = code;
  report();
}

void Slave::al_control_written(Time now) {
  const unsigned control = esc_.take_al_control();
  const unsigned wanted = control & state_mask;
  const bool acknowledges = (control & acknowledge_bit) != 0;
  // While an error is active, only its acknowledgement and Init (the first request of every master) are accepted.
  if (error_ && !acknowledges && wanted != static_cast<unsigned>(AlState::init)) return;
  const bool had_error = std::exchange(error_, false);
  const AlStatusCode code_before = std::exchange(code_, AlStatusCode::none);
  identifies_ = (control & identification_bit) != 0;
  const Time awaited_until = std::exchange(operational_until_, never);
  if (!is_state(wanted)) return refuse(AlStatusCode::unknown_requested_state);
  const auto to = static_cast<AlState>(wanted);
  if (!exists(state_, to)) return refuse(AlStatusCode::invalid_requested_state_change);
  if (had_error && to == state_ && interposer_ != nullptr && !interposer_->acknowledges()) return refuse(code_before);
  // A master may have started pulses and assigned them to the application; they must not run on for the next master.
  if (to == AlState::init) esc_.stop_own_pulses();
  if (const AlStatusCode code = change_state(to, now); code != AlStatusCode::none) refuse(code);
  // A repeated request for the same state does not extend the waiting time.
  if (operational_until_ != never) operational_until_ = std::min(operational_until_, awaited_until);
}

AlStatusCode Slave::change_state(AlState to, Time now) {
  if (to == state_) {
    open_process_data(inputs_run(), inputs_run());
    report();
    return AlStatusCode::none;
  }
  AlStatusCode code = check_transition(to);
  if (code == AlStatusCode::none) code = events_.may_change(state_, to);
  if (code != AlStatusCode::none) return code;
  if (interposer_ != nullptr) {
    if (const auto refusal = interposer_->refuses(state_, to)) {
      refuse(*refusal);
      return AlStatusCode::none;
    }
  }
  if (to == AlState::operational) {
    open_process_data(true, true);
    operational_until_ = now + profile_.operational_timeout;
    report();  // an acknowledged error is cleared during the wait for outputs
    await_operational(now);
    return AlStatusCode::none;
  }
  enter(to, AlStatusCode::none, now);
  return AlStatusCode::none;
}

AlStatusCode Slave::check_transition(AlState to) {
  switch (to) {
    case AlState::bootstrap:
      if (!profile_.bootstrap) return AlStatusCode::bootstrap_not_supported;
      return check_mailbox(profile_.bootstrap_out, profile_.bootstrap_in,
                           AlStatusCode::invalid_mailbox_configuration_bootstrap);
    case AlState::pre_operational:
      if (state_ != AlState::init) return AlStatusCode::none;
      if (!esc_.sii().loaded()) return AlStatusCode::eeprom_error;
      return check_mailbox(profile_.mailbox_out, profile_.mailbox_in, AlStatusCode::invalid_mailbox_configuration);
    case AlState::safe_operational:
      return state_ == AlState::pre_operational ? check_process_data() : AlStatusCode::none;
    default: return AlStatusCode::none;
  }
}

AlStatusCode Slave::check_mailbox(const AreaRule& out, const AreaRule& in, AlStatusCode failure) const {
  const bool good =
      follows(esc_.sync_manager(Mailbox::out), out, true) && follows(esc_.sync_manager(Mailbox::in), in, false);
  return good ? AlStatusCode::none : failure;
}

// Sync managers 2 and 3 must match the mapped PDOs, and all later ones must be off (ETG.1020 table 11).
AlStatusCode Slave::check_process_data_channels() const {
  const auto fits = [this](unsigned n, std::uint16_t bytes, std::uint16_t start, bool master_writes) {
    const SyncManager& channel = esc_.sync_manager(n);
    if (bytes == 0) return !channel.guards;
    return channel.guards && channel.length == bytes && channel.start == start &&
           channel.master_writes == master_writes && channel.mode == SyncManager::Mode::buffered;
  };
  if (!fits(2, outputs_.bytes(), profile_.outputs_start, true)) return AlStatusCode::invalid_output_configuration;
  if (!fits(3, inputs_.bytes(), profile_.inputs_start, false)) return AlStatusCode::invalid_input_configuration;
  for (unsigned n = used_sync_managers; n < Esc::sync_managers; ++n) {
    if (esc_.sync_manager(n).guards) return AlStatusCode::invalid_sync_manager_configuration;
  }
  return AlStatusCode::none;
}

// Pre-Operational to Safe-Operational: checks that the PDOs are possible and their channels are configured.
AlStatusCode Slave::check_process_data() {
  if (outputs_.resolve() != dictionary::AbortCode::none) return AlStatusCode::invalid_output_mapping;
  if (inputs_.resolve() != dictionary::AbortCode::none) return AlStatusCode::invalid_input_mapping;
  const AlStatusCode code = check_process_data_channels();
  return code == AlStatusCode::none ? choose_synchronisation() : code;
}

void Slave::enter(AlState to, AlStatusCode cause, Time now) {
  const AlState from = state_;
  state_ = to;
  if (to == AlState::init || from == AlState::init || from == AlState::bootstrap) {
    reset_mailbox();
  }
  if (to == AlState::init) forget_synchronisation();
  if (!inputs_run()) open_process_data(false, false);
  if (to == AlState::safe_operational && from == AlState::pre_operational) {
    open_process_data(true, true);
    start_exchange();
  }
  if (to == AlState::safe_operational && cause != AlStatusCode::none) hold_process_data_back();
  operational_until_ = never;
  if (!inputs_run()) outputs_at_ = inputs_at_ = late_sync0_at_ = shifted_at_ = never;
  report();
  events_.state_changed(from, to, cause, now);
}

bool Slave::fall_back(AlState state, AlStatusCode code, Time now) {
  if (state > state_ || !exists(state_, state)) return false;
  error_ = code != AlStatusCode::none;
  code_ = code;
  if (state == state_) {
    operational_until_ = never;
    if (state == AlState::safe_operational) hold_process_data_back();
    report();
    return true;
  }
  enter(state, code, now);
  return true;
}

// The application enables sync managers 2 and 3 only while their process data are exchanged. So a master sees by its
// working counters which data are not exchanged.
void Slave::open_process_data(bool outputs, bool inputs) {
  const bool inputs_were_open = esc_.sync_manager(3).active;
  esc_.disable_sync_manager(2, !outputs);
  esc_.disable_sync_manager(3, !inputs);
  if (inputs && !inputs_were_open && inputs_run()) give_inputs();
}

// After a fall-back from Operational, or a refused change to it: until the master acknowledges the error, the outputs
// are disabled, or the inputs if the slave has no outputs.
void Slave::hold_process_data_back() {
  const bool has_outputs = outputs_.bytes() != 0;
  open_process_data(!has_outputs, has_outputs);
}

// Safe-Operational to Operational: enters it as soon as outputs have come, and also SYNC0 if it times them. Outputs
// whose watchdog has expired do not count.
void Slave::await_operational(Time now) {
  const bool outputs = outputs_.bytes() == 0 || (outputs_seen_ && !esc_.process_data_watchdog().expired());
  const bool pulses = sync_type_ != SyncType::dc_sync0 || sync_seen_;
  if (outputs && pulses) {
    missed_ = 0;
    outputs_fresh_ = true;
    enter(AlState::operational, AlStatusCode::none, now);
    return;
  }
  if (now < operational_until_) return;
  operational_until_ = never;
  hold_process_data_back();
  refuse(pulses ? AlStatusCode::no_valid_outputs : AlStatusCode::no_sync);
}

// The master enabled, disabled or changed sync managers.
void Slave::follow_configuration(Time now) {
  const auto mailbox_good = [this] {
    const bool boots = state_ == AlState::bootstrap;
    return check_mailbox(boots ? profile_.bootstrap_out : profile_.mailbox_out,
                         boots ? profile_.bootstrap_in : profile_.mailbox_in,
                         AlStatusCode::invalid_mailbox_configuration) == AlStatusCode::none;
  };
  if (mailbox_runs() && !mailbox_good()) {
    fall_back(AlState::init, AlStatusCode::invalid_mailbox_configuration, now);
    return;
  }
  if (!inputs_run()) return;
  const AlStatusCode code = check_process_data_channels();
  if (code != AlStatusCode::none) fall_back(AlState::pre_operational, code, now);
}

}  // namespace servodrome::ethercat
