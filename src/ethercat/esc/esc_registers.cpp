// Behaviour of individual registers: the bits that a master may write, and the effects of reading and writing
// (ETG.1000.4 clause 6).
#include <algorithm>
#include <utility>

#include "ethercat/esc/esc.hpp"

namespace servodrome::ethercat {

namespace {

constexpr std::uint32_t user_memory = 0x0F80;

// Writable bits of every register byte, as the master sees it. Registers that act instead of storing a value (counters,
// system time) count as writable.
constexpr auto writable = [] {
  std::array<std::uint8_t, reg::process_memory> mask{};
  const auto allow = [&mask](unsigned address, unsigned bytes, std::uint8_t bits = 0xFF) {
    for (unsigned i = 0; i < bytes; ++i) mask[address + i] = bits;
  };
  allow(reg::station_address, 2);
  allow(reg::register_write_enable, 2, 0x01);
  allow(reg::write_enable, 2, 0x01);
  allow(reg::reset_ecat, 1);
  allow(reg::dl_control, 1, 0x03);
  allow(reg::dl_control + 1, 1);
  allow(reg::dl_control + 2, 1, 0x0F);
  allow(reg::dl_control + 3, 1, 0x01);
  allow(reg::physical_offset, 2);
  allow(reg::al_control, 1, 0x3F);
  allow(reg::run_led_override, 2);
  allow(reg::ecat_event_mask, 2);
  allow(reg::rx_errors, 14);
  allow(reg::lost_links, 4);
  allow(reg::watchdog_divider, 2);
  allow(reg::watchdog_pdi, 2);
  allow(reg::watchdog_process_data, 2);
  allow(reg::watchdog_process_data_count, 2);
  allow(reg::sii_configuration, 16);
  for (unsigned n = 0; n < Esc::fmmus; ++n) {
    const unsigned base = reg::fmmu + Fmmu::size * n;
    allow(base, 6);
    allow(base + 6, 2, 0x07);
    allow(base + 8, 2);
    allow(base + 10, 1, 0x07);
    allow(base + 11, 1, 0x03);
    allow(base + 12, 1, 0x01);
  }
  for (unsigned n = 0; n < Esc::sync_managers; ++n) {
    const unsigned base = reg::sync_manager + 8 * n;
    allow(base, 4);
    allow(base + 4, 1, 0x7F);
    allow(base + 6, 1, 0xC3);
  }
  allow(reg::receive_time_port, 4);
  allow(reg::system_time, 8);
  allow(reg::system_time_offset, 12);
  allow(reg::speed_counter_start, 2);
  allow(reg::system_time_filter, 2, 0x0F);
  allow(reg::cyclic_unit_control, 1, 0x31);
  allow(reg::sync_activation, 1);
  allow(reg::sync_start_time, 8);
  allow(reg::sync0_cycle, 8);
  allow(reg::latch0_control, 2, 0x03);
  allow(user_memory, 0x80);
  return mask;
}();

constexpr bool touches(std::uint32_t first, std::uint32_t length, std::uint32_t address, std::uint32_t bytes = 1) {
  return first < address + bytes && address < first + length;
}

}  // namespace

void Esc::power_on(Time now) {
  memory_.fill(0);
  sync_managers_ = {};
  fmmus_ = {};
  settle(~0U);
  put_off(0);
  quiet_until_ = unknown;
  ecat_events_ = 0;
  al_control_pending_ = sync_active_ = raises_events_ = false;
  frame_end_work_ = registers_unlocked_ = memory_unlocked_ = reset_pending_ = false;
  reset_progress_ = lasting_loops_ = 0;
  dl_control_until_ = never;
  loop_closed_ = {true, true};
  now_ = now;

  memory_[reg::type] = 0x11;  // a controller of the ET1100 family
  store_u16(&memory_[reg::build], 2);
  memory_[reg::fmmu_count] = fmmus;
  memory_[reg::sync_manager_count] = sync_managers;
  memory_[reg::ram_size] = static_cast<std::uint8_t>((memory_size - reg::process_memory) / 1024);
  memory_[reg::port_descriptor] = 0x0F;  // ports 0 and 1: MII
  // DC, 64 bits wide; enhanced MII link detection; FCS errors counted apart; enhanced DC SYNC activation.
  store_u16(&memory_[reg::features], 0x01CC);
  memory_[reg::dl_control] = 0x01;
  memory_[reg::dl_control + 2] = 0x07;
  store_u16(&memory_[reg::al_control], 0x0001);
  store_u16(&memory_[reg::al_status], 0x0001);
  store_u32(&memory_[reg::al_event_mask], 0x00FFFF0F);
  store_u16(&memory_[reg::watchdog_divider], 2498);  // 100 us
  store_u16(&memory_[reg::watchdog_pdi], 1000);      // 100 ms
  store_u16(&memory_[reg::watchdog_process_data], 1000);
  store_u16(&memory_[reg::speed_counter_start], 0x1000);
  memory_[reg::system_time_filter] = 4;
  memory_[reg::speed_counter_filter] = 12;

  process_data_watchdog_ = {};
  pdi_watchdog_ = {};
  clock_.reset(now);
  load_sii_anew();
  configure_mappings();
  configure_watchdogs();
  configure_ports();
  ecat_events_ = 0;
}

void Esc::load_sii_anew() {
  sii_.power_on();
  load_from_sii();
  store_u16(&memory_[reg::station_alias], sii_.loaded() ? load_u16(&sii_.memory()[8]) : 0U);
}

// ETG.1000.6 table 16: PDI control and configuration, SYNC pulse length. The station alias is loaded at power-on only.
void Esc::load_from_sii() {
  if (!sii_.loaded()) return;
  const std::span<const std::uint8_t> words = sii_.memory();
  store_u16(&memory_[reg::pdi_control], load_u16(&words[0]));
  store_u16(&memory_[reg::pdi_configuration], load_u16(&words[2]));
  store_u16(&memory_[reg::sync_pulse_length], load_u16(&words[4]));
  store_u16(&memory_[reg::pdi_configuration + 2], load_u16(&words[6]));
}

// ---- Reading ----

void Esc::refresh_block(std::uint32_t block) {
  switch (block * 16) {
    case reg::reset_ecat: memory_[reg::reset_ecat] = reset_progress_; break;
    case reg::ecat_event_request: store_u16(&memory_[reg::ecat_event_request], ecat_event_request()); break;
    case reg::al_event_request: store_u32(&memory_[reg::al_event_request], al_event_request()); break;
    case reg::watchdog_status:
      expire_watchdogs();
      memory_[reg::watchdog_status] = process_data_watchdog_.expired() ? 0 : 1;
      memory_[reg::watchdog_process_data_count] = process_data_watchdog_.count();
      memory_[reg::watchdog_pdi_count] = pdi_watchdog_.count();
      break;
    case reg::sii_configuration:
      for (std::uint8_t i = 0; i < 16; ++i) memory_[reg::sii_configuration + i] = sii_.byte(i, now_);
      if (sii_.take_reloaded()) {
        load_from_sii();
        configure_ports();
      }
      break;
    case reg::system_time: store(&memory_[reg::system_time], clock_.system_time(now_)); break;
    case reg::system_time_offset: store_u32(&memory_[reg::system_time_difference], clock_.difference()); break;
    case reg::speed_counter_start:
      store(&memory_[reg::speed_counter_difference], clock_.speed_counter_difference());
      break;
    case reg::cyclic_unit_control:
      memory_[reg::sync0_status] = clock_.sync_level(0, now_) ? 1 : 0;
      memory_[reg::sync1_status] = clock_.sync_level(1, now_) ? 1 : 0;
      memory_[reg::sync_activation_status] &= 0x04U;
      for (unsigned n = 0; n < 2; ++n) {
        const DistributedClock::Sync& sync = clock_.sync(n);
        const bool first_pending = sync.enabled && sync.pending && sync.count == 0;
        memory_[reg::sync_activation_status] |= static_cast<std::uint8_t>(first_pending ? 1U << n : 0U);
      }
      break;
    case reg::sync_start_time:
      if (clock_.sync(0).pending) store(&memory_[reg::sync_start_time], clock_.sync(0).next);
      if (clock_.sync(1).pending) store(&memory_[reg::next_sync1], clock_.sync(1).next);
      break;
    default:
      if (block < reg::sync_manager / 16 || block >= reg::sync_manager / 16 + sync_managers / 2) break;
      for (unsigned n = 2 * (block - reg::sync_manager / 16), end = n + 2; n < end; ++n) {
        memory_[reg::sync_manager + 8 * n + 5] = sync_managers_[n].status();
      }
  }
}

void Esc::registers_read(std::uint32_t address, std::uint32_t length) {
  const auto acknowledge = [&](std::uint16_t event, std::uint32_t first, std::uint32_t bytes) {
    if (touches(address, length, first, bytes)) ecat_events_ = static_cast<std::uint16_t>(ecat_events_ & ~event);
  };
  acknowledge(reg::ecat_event::dl_status, reg::dl_status, 2);
  acknowledge(reg::ecat_event::al_status, reg::al_status, 2);
  if (!touches(address, length, reg::latch_times, 32)) return;
  for (unsigned edge = 0; edge < 4; ++edge) {
    const bool of_the_master = (memory_[reg::cyclic_unit_control] >> (4 + edge / 2) & 1) == 0;
    if (!of_the_master || !touches(address, length, reg::latch_times + 8 * edge)) continue;
    std::uint8_t& status = memory_[reg::latch0_status + edge / 2];
    status = static_cast<std::uint8_t>(status & ~(1U << edge % 2));
  }
  if (((memory_[reg::latch0_status] | memory_[reg::latch1_status]) & 3) == 0) {
    ecat_events_ = static_cast<std::uint16_t>(ecat_events_ & ~reg::ecat_event::latch);
  }
}

std::uint8_t Esc::read_byte(std::uint16_t address, Time now) {
  now_ = now;
  if (address < reg::process_memory) refresh(address, 1);
  return memory_[address];
}

// ---- Writing ----

bool Esc::may_write(std::uint32_t address, std::uint32_t sync_managers_enabled) const {
  const bool protects = (memory_[reg::register_write_protection] & 1) != 0 && !registers_unlocked_;
  const bool protects_all = (memory_[reg::write_protection] & 1) != 0 && !memory_unlocked_;
  if (protects_all) return address == reg::write_enable;
  if (protects && address < user_memory) {
    return address == reg::register_write_enable || address == reg::write_enable;
  }
  if (address == reg::al_control || address == reg::al_control + 1U) return !al_control_pending_;
  if (address >= reg::sync_manager && address < reg::sync_manager + 8U * sync_managers) {
    // The settings of an enabled channel are read-only.
    return address % 8 > 4 || (sync_managers_enabled >> (address - reg::sync_manager) / 8 & 1) == 0;
  }
  // Registers that 0980h assigns to the application: the pulses, each latch.
  if (address >= reg::sync_activation && address <= reg::latch1_control) {
    const unsigned unit = address < reg::latch0_control ? 0 : 4 + address - reg::latch0_control;
    return (memory_[reg::cyclic_unit_control] >> unit & 1) == 0;
  }
  return true;
}

bool Esc::take_register_bytes(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  // The enable bits from before this datagram decide which channels are in use.
  std::uint32_t enabled = 0;
  std::array<std::uint8_t, sync_managers> activation;
  for (unsigned n = 0; n < sync_managers; ++n) {
    activation[n] = memory_[reg::sync_manager + 8 * n + 6];
    enabled |= (activation[n] & SyncManager::activate_enable) != 0 ? 1U << n : 0U;
  }

  // All bytes are stored first, then each block acts on its own bytes. Bytes that were refused do not act.
  const auto length = static_cast<std::uint32_t>(bytes.size());
  const std::uint32_t first_block = address / 16;
  const std::uint32_t blocks = (address + length - 1) / 16 - first_block + 1;
  struct Taken {
    std::uint8_t begin, end;  // within the block
  };
  std::array<Taken, max_payload / 16 + 2> taken;
  std::fill_n(taken.begin(), blocks, Taken{16, 0});
  bool any = false;
  for (std::uint32_t i = 0; i < length; ++i) {
    const std::uint32_t at = address + i;
    const std::uint8_t mask = writable[at];
    if (mask == 0 || !may_write(at, enabled)) continue;
    const auto within = static_cast<std::uint8_t>(at % 16);
    if (at / 16 == reg::sii_configuration / 16) {
      if (!sii_.byte_written(within, bytes[i], SiiInterface::Side::master, now_)) continue;
    } else if (at / 16 != reg::receive_time_port / 16) {  // the written value is ignored
      memory_[at] = static_cast<std::uint8_t>((memory_[at] & ~mask) | (bytes[i] & mask));
    }
    any = true;
    Taken& block = taken[at / 16 - first_block];
    block.begin = std::min(block.begin, within);
    block.end = static_cast<std::uint8_t>(within + 1);
  }
  if (!any) return false;
  quiet_until_ = unknown;
  for (std::uint32_t i = 0; i < blocks; ++i) {
    const Taken part = taken[i];
    if (part.end == 0) continue;
    block_written(first_block + i, (first_block + i) * 16 + part.begin,
                  static_cast<std::uint32_t>(part.end - part.begin));
  }
  for (unsigned n = 0; n < sync_managers; ++n) {
    if (!touches(address, length, reg::sync_manager + 8 * n, 8)) continue;
    const unsigned changed = activation[n] ^ memory_[reg::sync_manager + 8 * n + 6];
    if (changed != 0) attention_ |= reg::al_event::sync_manager_activation;
    if ((changed & SyncManager::activate_enable) != 0 || !sync_managers_[n].active) configure_sync_manager(n);
  }
  return true;
}

void Esc::block_written(std::uint32_t block, std::uint32_t first, std::uint32_t length) {
  const auto wrote = [&](std::uint32_t address, std::uint32_t bytes = 1) {
    return touches(first, length, address, bytes);
  };
  const auto clear = [&](std::uint32_t address, std::uint32_t bytes) {
    std::fill_n(memory_.begin() + address, bytes, std::uint8_t{0});
  };
  switch (block * 16) {
    case reg::register_write_enable:
      if (!wrote(reg::register_write_enable)) break;
      registers_unlocked_ = frame_end_work_ = true;
      break;
    case reg::write_enable:
      configure_mappings();
      if (!wrote(reg::write_enable)) break;
      memory_unlocked_ = frame_end_work_ = true;
      break;
    case reg::reset_ecat:
      if (wrote(reg::reset_ecat)) reset_letter(memory_[reg::reset_ecat]);
      break;
    case reg::dl_control: {
      if (!wrote(reg::dl_control, 2)) break;
      // Only the loop settings are temporary (for 1 s).
      const bool temporary = (memory_[reg::dl_control] & 0x02) != 0;
      dl_control_until_ = temporary ? now_ + std::chrono::seconds(1) : never;
      if (!temporary) lasting_loops_ = memory_[reg::dl_control + 1];
      if (wrote(reg::dl_control + 1)) loop_closed_ = {};
      configure_ports();
      break;
    }
    case reg::ecat_event_mask: raises_events_ = load_u16(&memory_[reg::ecat_event_mask]) != 0; break;
    case reg::al_control:
      if (!wrote(reg::al_control)) break;
      al_control_pending_ = true;
      attention_ |= reg::al_event::al_control;
      break;
    case reg::rx_errors:
      if (wrote(reg::rx_errors, 12)) clear(reg::rx_errors, 12);
      if (wrote(reg::processing_unit_errors)) memory_[reg::processing_unit_errors] = 0;
      if (wrote(reg::pdi_errors)) memory_[reg::pdi_errors] = 0;
      break;
    case reg::lost_links: clear(reg::lost_links, 4); break;
    case reg::watchdog_divider:
    case reg::watchdog_pdi:
    case reg::watchdog_process_data: configure_watchdogs(); break;
    case reg::watchdog_status:
      if (wrote(reg::watchdog_process_data_count, 2)) {
        process_data_watchdog_.clear_count();
        pdi_watchdog_.clear_count();
      }
      break;
    case reg::sii_configuration:
      frame_end_work_ = true;
      if (wrote(reg::sii_control + 1U)) sii_.run(SiiInterface::Side::master, now_);
      break;
    case reg::receive_time_port:
      if (!wrote(reg::receive_time_port)) break;
      store(&memory_[reg::receive_time_processing_unit], clock_.local_time(now_));
      if (latches_ports_) effects_ |= effect_receive_times;
      break;
    case reg::system_time:
      if (wrote(reg::system_time, 4)) clock_.compare(load_u32(&memory_[reg::system_time]), now_);
      break;
    case reg::system_time_offset:
      clock_.set_offset(load<std::uint64_t>(&memory_[reg::system_time_offset]));
      clock_.set_delay(load_u32(&memory_[reg::system_time_delay]));
      break;
    case reg::speed_counter_start:
      if (wrote(reg::system_time_filter, 2)) {
        clock_.set_filters(memory_[reg::system_time_filter], memory_[reg::speed_counter_filter]);
      }
      if (wrote(reg::speed_counter_start, 2)) {
        clock_.set_speed_counter_start(load_u16(&memory_[reg::speed_counter_start]), now_);
        store_u16(&memory_[reg::speed_counter_start], clock_.speed_counter_start());
      }
      break;
    case reg::cyclic_unit_control:
      if (wrote(reg::sync_activation)) configure_sync();
      break;
    case reg::sync_start_time:
      start_time_written(wrote(reg::sync_start_time + 3U), wrote(reg::sync_start_time + 7U));
      break;
    default:
      if (block < reg::fmmu / 16 || block >= reg::fmmu / 16 + fmmus) break;
      fmmus_[block - reg::fmmu / 16] = Fmmu::from(&memory_[block * 16]);
      configure_mappings();
  }
}

void Esc::reset_letter(std::uint8_t letter) {
  constexpr std::array<std::uint8_t, 3> sequence{'R', 'E', 'S'};  // in three consecutive frames
  if (frames_ - reset_frame_ != 1) reset_progress_ = 0;
  reset_progress_ =
      letter == sequence[reset_progress_] ? static_cast<std::uint8_t>(reset_progress_ + 1) : std::uint8_t{0};
  reset_frame_ = frames_;
  if (reset_progress_ < sequence.size()) return;
  reset_progress_ = 0;
  reset_pending_ = frame_end_work_ = true;
}

void Esc::configure_sync_manager(unsigned n) {
  sync_managers_[n].configure(&memory_[reg::sync_manager + 8 * n], memory_size);
  configure_mappings();
  const bool any = std::any_of(sync_managers_.begin(), sync_managers_.end(),
                               [](const SyncManager& channel) { return channel.guards && channel.triggers_watchdog; });
  if (!any) process_data_watchdog_.stop();
}

void Esc::configure_watchdogs() {
  const std::uint16_t divider = load_u16(&memory_[reg::watchdog_divider]);
  const std::uint16_t time = watchdog_dead_ ? 0 : load_u16(&memory_[reg::watchdog_process_data]);
  process_data_watchdog_.set_period(Watchdog::period_of(divider, time));
  pdi_watchdog_.set_period(Watchdog::period_of(divider, load_u16(&memory_[reg::watchdog_pdi])));
}

// Bit 4 of 0981h: the upper half of the start time is derived from the present time. Bit 3: a complete start time
// activates.
void Esc::start_time_written(bool low_half, bool high_half) {
  std::uint8_t& activation = memory_[reg::sync_activation];
  const bool extends = (activation & 0x10) != 0;
  if (extends && low_half) {
    const std::uint64_t system = clock_.system_time(now_);
    const std::uint32_t ahead = load_u32(&memory_[reg::sync_start_time]) - static_cast<std::uint32_t>(system);
    store(&memory_[reg::sync_start_time], system + ahead);
  }
  if ((activation & 0x08) == 0 || !(extends ? low_half : high_half)) return;
  activation = static_cast<std::uint8_t>(activation | 0x01U);
  configure_sync();
}

void Esc::stop_own_pulses() {
  if ((memory_[reg::cyclic_unit_control] & 0x01) == 0) return;
  memory_[reg::sync_activation] = 0;
  configure_sync();
}

void Esc::configure_sync() {
  std::uint8_t& activation = memory_[reg::sync_activation];
  const bool sync0 = (activation & 0x02) != 0;
  const bool sync1 = (activation & 0x04) != 0;
  if ((activation & 0x80) != 0) {  // debug pulse: one pulse at once
    activation = static_cast<std::uint8_t>(activation & ~0x80U);
    attention_ |= (sync0 ? reg::al_event::sync0 : 0U) | (sync1 ? reg::al_event::sync1 : 0U);
  }
  const bool was_active = std::exchange(sync_active_, (activation & 0x01) != 0);
  if (was_active && sync_active_) {
    clock_.enable_sync(0, sync0, now_);
    clock_.enable_sync(1, sync1, now_);
    return;
  }
  std::uint8_t& status = memory_[reg::sync_activation_status];
  status = 0;
  if (!sync_active_) {
    clock_.stop_sync();
    return;
  }
  DistributedClock::SyncSettings settings;
  settings.sync0 = sync0;
  settings.sync1 = sync1;
  settings.check_start_time = (activation & 0x20) != 0;
  settings.short_near_future = (activation & 0x40) != 0;
  settings.start_time = load<std::uint64_t>(&memory_[reg::sync_start_time]);
  settings.sync0_cycle = load_u32(&memory_[reg::sync0_cycle]);
  settings.sync1_cycle = load_u32(&memory_[reg::sync1_cycle]);
  settings.pulse_length = load_u16(&memory_[reg::sync_pulse_length]);
  if (!clock_.start_sync(settings, now_)) status = 0x04;
}

}  // namespace servodrome::ethercat
