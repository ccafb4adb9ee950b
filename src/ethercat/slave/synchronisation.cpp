// Time of the exchange between process data and objects: in free run, at the sync manager's event, or at SYNC0
// (ETG.1020 clause 17).
#include <algorithm>
#include <utility>

#include "ethercat/slave/slave.hpp"

namespace servodrome::ethercat {

namespace {
constexpr std::uint16_t output_parameter = 0x1C32;
constexpr std::uint16_t input_parameter = 0x1C33;
constexpr std::uint16_t error_settings = 0x10F1;
constexpr std::uint8_t local_error_reaction = 1;
constexpr std::uint8_t sync_error_limit = 2;
constexpr std::uint32_t missed_step = 3;  // ETG.1020, object 10F1h
constexpr Time least_sync0_patience = std::chrono::milliseconds(1);
// 1C32h:08
constexpr unsigned measure_bit = 0x01;
constexpr unsigned reset_counters_bit = 0x02;
}  // namespace

void Slave::set_sync_parameter(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  const dictionary::Entry* entry = dictionary_.find(index, sub);
  std::byte* place = entry == nullptr ? nullptr : dictionary_.storage(*entry);
  if (place == nullptr) return;
  const auto bytes = dictionary::encode_number(value);
  std::memcpy(place, bytes.data(), dictionary::size_of(entry->type));
}

void Slave::set_sync_parameter(std::uint8_t sub, std::int64_t value) {
  set_sync_parameter(output_parameter, sub, value);
  set_sync_parameter(input_parameter, sub, value);
}

// The distributed clock has priority: if the master activated SYNC0, it is used even before the first pulse
// (await_operational waits for it). 1C32h:01 then shows the chosen type; the next choice considers only a value that a
// master wrote there.
AlStatusCode Slave::choose_synchronisation() {
  const DistributedClock::Sync& sync0 = esc_.clock().sync(0);
  const bool pulses = sync0.enabled;
  const dictionary::Entry* entry = dictionary_.find(output_parameter, sync_parameter::type);
  const auto factory = static_cast<SyncType>(entry == nullptr ? 0 : entry->default_value);
  SyncType wanted = wanted_sync_type_.value_or(factory);
  output_shift_ = Time{dictionary_.number(output_parameter, sync_parameter::shift_time)};
  input_shift_ = Time{dictionary_.number(input_parameter, sync_parameter::shift_time)};
  const bool wants_pulses = wanted == SyncType::dc_sync0;
  const auto supports = [this](std::uint16_t type) { return (profile_.synchronisation & type) != 0; };
  if (pulses) {
    if (!supports(sync_support::dc_sync0)) return AlStatusCode::synchronization_not_supported;
    if (static_cast<std::int64_t>(sync0.step) < profile_.least_cycle.count()) {
      return profile_.cycle_too_short;
    }
    // A shift beyond the next SYNC0 would never take effect.
    if (std::max(output_shift_, input_shift_).count() >= static_cast<std::int64_t>(sync0.step)) {
      return AlStatusCode::invalid_dc_sync_configuration;
    }
    wanted = SyncType::dc_sync0;
  } else if (wants_pulses) {
    return AlStatusCode::invalid_dc_sync_configuration;
  } else if (wanted == SyncType::free_run && !supports(sync_support::free_run)) {
    if (!supports(sync_support::sync_manager)) return AlStatusCode::free_run_not_supported;
    wanted = SyncType::sync_manager;
  }
  sync_type_ = wanted;
  const auto step = static_cast<std::int64_t>(pulses ? sync0.step : 0);
  show_synchronisation();
  set_sync_parameter(sync_parameter::sync0_cycle_time, step);
  if (pulses) set_sync_parameter(sync_parameter::cycle_time, step);
  return AlStatusCode::none;
}

// Inputs that follow the outputs' sync manager show the type 22h (ETG.1020 table 72).
void Slave::show_synchronisation() {
  constexpr std::int64_t with_outputs = 0x22;
  const auto type = static_cast<std::int64_t>(sync_type_);
  const bool follows = sync_type_ == SyncType::sync_manager && outputs_.bytes() != 0;
  set_sync_parameter(output_parameter, sync_parameter::type, type);
  set_sync_parameter(input_parameter, sync_parameter::type, follows ? with_outputs : type);
}

// On entering Init: restores the factory values for the next master.
void Slave::forget_synchronisation() {
  wanted_sync_type_.reset();
  for (const std::uint16_t index : {output_parameter, input_parameter}) {
    const dictionary::Entry* type = dictionary_.find(index, sync_parameter::type);
    if (type != nullptr) set_sync_parameter(index, sync_parameter::type, type->default_value);
  }
}

void Slave::start_exchange() {
  outputs_seen_ = sync_seen_ = outputs_fresh_ = overrun_ = false;
  missed_ = 0;
  outputs_at_ = inputs_at_ = late_sync0_at_ = shifted_at_ = last_exchange_ = last_event_ = never;
  set_sync_parameter(sync_parameter::events_missed, 0);
  set_sync_parameter(sync_parameter::cycle_too_short, 0);
  set_sync_parameter(sync_parameter::shift_too_short, 0);
  show_sync_error(false);
  give_inputs();  // so that the first read returns data
}

// A cycle without new outputs from the master changes nothing: outputs that were copied before are not new set-points.
void Slave::take_outputs(Time now) {
  if (outputs_.bytes() != 0) {
    if (esc_.sync_manager(2).unread == 0) return;
    const std::span<const std::uint8_t> image = esc_.open_for_reading(2);
    if (image.empty()) return;
    if (state_ == AlState::operational) outputs_.write_objects(image);
    esc_.close_reading(2);
  }
  if (state_ == AlState::operational) events_.process_data(now);
}

void Slave::give_inputs() {
  // Without inputs of a cycle before, the master would read nothing.
  const bool can_keep = interposer_ != nullptr && esc_.sync_manager(3).valid;
  if (can_keep && interposer_->keeps_inputs(esc_.now())) return;
  const std::span<std::uint8_t> image = esc_.open_for_writing(3);
  if (image.empty()) return;
  inputs_.read_objects(image);
  esc_.close_writing(3);
}

// Exchanges that 1C32h:03 and 1C33h:03 delay after SYNC0, and a SYNC0 that the interposer delays.
void Slave::exchange_shifted(Time now) {
  if (now >= outputs_at_) {
    outputs_at_ = never;
    take_outputs(now);
  }
  if (now >= inputs_at_) {
    inputs_at_ = never;
    give_inputs();
  }
  const unsigned pulses = now >= late_sync0_at_ ? late_pulses_ : 0;
  if (pulses != 0) late_sync0_at_ = never;
  shifted_at_ = std::min(late_sync0_at_, std::min(outputs_at_, inputs_at_));
  for (unsigned n = 0; n < pulses; ++n) sync0_arrived(now);
}

// 1C32h:08 and 1C33h:08 act as one: bit 0 starts measuring the cycle, bit 1 resets the event counters.
void Slave::cycle_measurement_written(unsigned command) {
  measures_cycle_ = (command & measure_bit) != 0;
  last_exchange_ = shortest_cycle_ = never;
  set_sync_parameter(sync_parameter::get_cycle_time, command & measure_bit);
  if ((command & reset_counters_bit) == 0) return;
  for (const std::uint8_t counter :
       {sync_parameter::events_missed, sync_parameter::cycle_too_short, sync_parameter::shift_too_short}) {
    set_sync_parameter(counter, 0);
  }
}

// Increments a counter of 1C32h or 1C33h; FFFFh wraps to 0.
void Slave::count(std::uint16_t index, std::uint8_t counter) {
  set_sync_parameter(index, counter, dictionary_.number(index, counter) + 1);
}

// Handles one event of the sync manager that times the exchange, or several that were deferred. Events closer together
// than 1C32h:05 leave the application too little time: in Operational 1C32h:0C counts them (1C33h:0C without outputs).
// With sampling, the following process data are then handled just before the next control cycle, and the inputs are
// copied after it.
void Slave::exchange_event(std::uint16_t index, Time now) {
  const Time events = std::max(1U, esc_.sync_manager(2).unread) * profile_.least_cycle;
  const Time before = std::exchange(last_event_, state_ == AlState::operational ? now : never);
  const bool too_short = before != never && now - before < events;
  if (sync_type_ == SyncType::sync_manager) {
    if (too_short) count(index, sync_parameter::cycle_too_short);
    if (measures_cycle_) measure_cycle(now);
  }
  take_outputs(now);
  overrun_ = too_short && sampling_cycle_ != Time{0} && loop_at_ != never && loop_ != Time{0};
  if (overrun_) {
    sampled_at_ = loop_at_ + ((now - loop_at_) / loop_ + 1) * loop_;
    esc_.put_off(process_data_events);
  } else {
    give_inputs();
  }
}

// Stores the shortest time between two events of the sync manager as the cycle time.
void Slave::measure_cycle(Time now) {
  const Time before = std::exchange(last_exchange_, now);
  if (before == never || now - before >= shortest_cycle_) return;
  shortest_cycle_ = now - before;
  set_sync_parameter(sync_parameter::cycle_time, shortest_cycle_.count());
}

void Slave::outputs_arrived(Time now) {
  if (!inputs_run() || !esc_.sync_manager(2).active) return;
  outputs_seen_ = outputs_fresh_ = true;
  if (sync_type_ == SyncType::dc_sync0) {
    // If the pulses have ended, the next frame detects it.
    if (state_ == AlState::operational && !esc_.clock().sync(0).pending) {
      fall_back(AlState::safe_operational, AlStatusCode::fatal_sync_error, now);
    }
    // The frame passed before this cycle's inputs were ready.
    if (state_ == AlState::operational && inputs_at_ != never) count(input_parameter, sync_parameter::shift_too_short);
    return;
  }
  exchange_event(output_parameter, now);
}

void Slave::sync0_came(Time now) {
  if (interposer_ == nullptr || !inputs_run() || sync_type_ != SyncType::dc_sync0) {
    sync0_arrived(now);
    return;
  }
  const SlaveInterposer::Pulse pulse = interposer_->sync0(now);
  if (pulse.delay <= Time{0}) {
    for (unsigned n = 0; n < pulse.times; ++n) sync0_arrived(now);
  } else if (pulse.times != 0 && late_sync0_at_ == never) {
    late_sync0_at_ = now + pulse.delay;
    late_pulses_ = pulse.times;
    shifted_at_ = std::min(shifted_at_, late_sync0_at_);
  }
}

// Called after a frame: checks whether the pulses have ended although the controller's unit still runs, because its
// clock was stopped or has jumped.
void Slave::miss_sync0(Time now) {
  if (sync_type_ != SyncType::dc_sync0 || state_ != AlState::operational) return;
  const Time two_cycles{static_cast<std::int64_t>(2 * esc_.clock().sync(0).step)};
  if (now - last_sync0_ <= std::max(two_cycles, least_sync0_patience)) return;
  fall_back(AlState::safe_operational, AlStatusCode::fatal_sync_error, now);
}

void Slave::sync0_arrived(Time now) {
  if (!inputs_run() || sync_type_ != SyncType::dc_sync0) return;
  sync_seen_ = true;
  last_sync0_ = now;
  esc_.clock().acknowledge_sync(0);
  if (state_ == AlState::operational && outputs_.bytes() != 0) {
    if (outputs_fresh_) {
      if (missed_ > 0) --missed_;
      if (sync_error_ && missed_ <= static_cast<std::uint32_t>(dictionary_.number(error_settings, sync_error_limit))) {
        show_sync_error(false);
      }
    } else {
      count_missed(now);
    }
  }
  outputs_fresh_ = false;
  outputs_at_ = now + output_shift_;
  inputs_at_ = now + input_shift_;
  exchange_shifted(now);
  events_.sync0(now);
}

// A cycle without outputs. Too many of them end the synchronous operation (10F1h).
void Slave::count_missed(Time now) {
  missed_ += missed_step;
  set_sync_parameter(sync_parameter::events_missed,
                     dictionary_.number(output_parameter, sync_parameter::events_missed) + 1);
  const std::int64_t limit = dictionary_.number(error_settings, sync_error_limit);
  if (limit == 0 || missed_ <= static_cast<std::uint32_t>(limit)) return;
  show_sync_error(true);
  if (stays_with_sync_errors()) {
    missed_ = static_cast<std::uint32_t>(limit) + missed_step;  // limits the count to one step above the limit
    return;
  }
  fall_back(AlState::safe_operational, AlStatusCode::synchronization_error, now);
}

// 10F1h:01 is 0 and writable. A read-only 0, which some makers have, does not count.
bool Slave::stays_with_sync_errors() const {
  const dictionary::Entry* entry = dictionary_.find(error_settings, local_error_reaction);
  return entry != nullptr && entry->writable() && dictionary_.number(error_settings, local_error_reaction) == 0;
}

void Slave::show_sync_error(bool error) {
  sync_error_ = error;
  set_sync_parameter(sync_parameter::sync_error, error ? 1 : 0);
}

}  // namespace servodrome::ethercat
