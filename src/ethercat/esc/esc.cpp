#include "ethercat/esc/esc.hpp"

#include <algorithm>

namespace servodrome::ethercat {

bool Esc::addressed(std::uint16_t station) const {
  if (station == load_u16(&memory_[reg::station_address])) return true;
  const bool alias_enabled = (memory_[reg::dl_control + 3] & 0x01) != 0;
  return alias_enabled && station == load_u16(&memory_[reg::station_alias]);
}

// Quick path for an LRW: the slave has one buffer in each direction, and the datagram has the address and length of the
// last one that fit() accepted, or maps nothing of this slave. Returns false, without any effect, in every other case.
[[gnu::always_inline]] inline bool Esc::exchange_buffers(Datagram datagram) {
  if (datagram.logical() != fit_.logical || datagram.length != fit_.length) return !reach_.touches(datagram);
  SyncManager& outputs = *fit_.writing;
  SyncManager& inputs = *fit_.reading;
  if (!inputs.valid) return false;
  copy_few(&memory_[outputs.write_whole()], datagram.data() + fit_.outputs, outputs.length);
  if (outputs.triggers_watchdog) process_data_came();
  copy_few(datagram.data() + fit_.inputs, &memory_[inputs.read_whole()], inputs.length);
  attention_ |= fit_.events;
  datagram.count(gain(true, true, true));
  return true;
}

// Returns true if a datagram reads registers in one block of which none is computed or acknowledged by reading, such as
// AL status.
[[gnu::always_inline]] inline bool Esc::is_plain(Datagram datagram) const {
  const std::uint32_t address = datagram.offset();
  if (address % 16 + datagram.length > 16 || address >= reg::process_memory) return false;
  return !live_register_blocks[address / 16] && ecat_events_ == 0;
}

// Quick path for a broadcast read of 16 plain bits. Returns false, without any effect, for any other.
[[gnu::always_inline]] inline bool Esc::combine_word(Datagram datagram) {
  if (datagram.length != 2 || !is_plain(datagram)) return false;
  datagram.set_position(datagram.position() + 1U);
  store_u16(datagram.data(), load_u16(datagram.data()) | load_u16(&memory_[datagram.offset()]));
  datagram.count(gain(true, false, false));
  return true;
}

// Quick path for a read of plain registers of this slave. Returns false, without any effect, for any other.
[[gnu::always_inline]] inline bool Esc::read_plain(Datagram datagram) {
  if (datagram.length == 0 || !is_plain(datagram)) return false;
  copy_few(datagram.data(), &memory_[datagram.offset()], datagram.length);
  datagram.count(gain(true, false, false));
  return true;
}

// Quick path for the datagrams of every cycle and for those addressed to another slave. Returns false without any
// effect.
[[gnu::always_inline]] inline bool Esc::execute_at_once(Datagram datagram) {
  switch (datagram.command) {
    case Command::lrw: return exchange_buffers(datagram);
    case Command::brd: return combine_word(datagram);
    case Command::fprd: return !addressed(datagram.position()) || read_plain(datagram);
    default: return false;
  }
}

// ETG.1000.4 clause 5.4: every slave increments position addresses and broadcast addresses; the addressed slave finds
// 0.
void Esc::execute(Datagram& datagram) {
  const auto pass = [&datagram] {
    const std::uint16_t position = datagram.position();
    datagram.set_position(position + 1U);
    return position == 0;
  };
  switch (datagram.command) {
    case Command::nop: break;
    case Command::aprd:
      if (pass()) exchange(datagram, true, false, false);
      break;
    case Command::apwr:
      if (pass()) exchange(datagram, false, true, false);
      break;
    case Command::aprw:
      if (pass()) exchange(datagram, true, true, false);
      break;
    case Command::fprd:
      if (addressed(datagram.position())) exchange(datagram, true, false, false);
      break;
    case Command::fpwr:
      if (addressed(datagram.position())) exchange(datagram, false, true, false);
      break;
    case Command::fprw:
      if (addressed(datagram.position())) exchange(datagram, true, true, false);
      break;
    case Command::brd: pass(), exchange(datagram, true, false, true); break;
    case Command::bwr: pass(), exchange(datagram, false, true, false); break;
    case Command::brw: pass(), exchange(datagram, true, true, true); break;
    case Command::lrd: exchange_logical(datagram, true, false); break;
    case Command::lwr: exchange_logical(datagram, false, true); break;
    case Command::lrw:
      if (!fit(datagram) || !exchange_buffers(datagram)) exchange_logical(datagram, true, true);
      break;
    case Command::armw: {
      const bool reads = pass();
      exchange(datagram, reads, !reads, false);
      break;
    }
    case Command::frmw: {
      const bool reads = addressed(datagram.position());
      exchange(datagram, reads, !reads, false);
      break;
    }
    default: return;  // unknown command: passed on unchanged
  }
}

// Executes quick-path datagrams inline. The first other datagram calls process_rest(), a function of its own, so that
// the quick path need not save registers of the CPU.
unsigned Esc::process(Frame& frame, Time now) {
  now_ = now;
  ++frames_;
  effects_ = processes_only() ? effect_marks : 0U;
  const std::span<Datagram> datagrams = frame.datagrams();
  Datagram* at = datagrams.data();
  Datagram* const end = at + datagrams.size();
  if (!raises_events_) {
    while (at != end && execute_at_once(*at)) ++at;
    if (at == end) return effects_;
  }
  return process_rest({at, end});
}

unsigned Esc::process_rest(std::span<Datagram> datagrams) {
  const std::uint16_t event_mask = load_u16(&memory_[reg::ecat_event_mask]);
  for (Datagram& datagram : datagrams) {
    if (!execute_at_once(datagram)) execute(datagram);
    if (event_mask != 0) datagram.raise_interrupt(ecat_event_request() & event_mask);
  }
  if (frame_end_work_) end_frame();
  if ((effects_ & effect_receive_times) != 0) latch_port_time(0, now_);
  return effects_;
}

void Esc::end_frame() {
  frame_end_work_ = false;
  registers_unlocked_ = memory_unlocked_ = false;
  memory_[reg::register_write_enable] = memory_[reg::write_enable] = 0;
  sii_.frame_ended();
  if (reset_pending_) {
    power_on(now_);
    attention_ |= attention_reset;
  }
}

void Esc::set_link(unsigned port, bool link) {
  if (link_[port] == link) return;
  link_[port] = link;
  if (!link) increment(reg::lost_links + port);
  configure_ports();
}

void Esc::configure_ports() {
  for (unsigned port = 0; port < ports; ++port) {
    const unsigned control = memory_[reg::dl_control + 1] >> 2 * port & 3U;
    switch (control) {
      case 0: loop_closed_[port] = !link_[port]; break;
      case 1: loop_closed_[port] = loop_closed_[port] || !link_[port]; break;  // opens when DL control is written
      case 2: loop_closed_[port] = false; break;
      default: loop_closed_[port] = true;
    }
  }
  unsigned status = (sii_.loaded() ? 0x01U : 0U) | (pdi_watchdog_.expired() ? 0U : 0x02U) | 0x5000U;
  for (unsigned port = 0; port < ports; ++port) {
    status |= link_[port] ? 0x10U << port : 0U;
    status |= loop_closed_[port] ? 0x100U << 2 * port : 0U;
    status |= link_[port] && !loop_closed_[port] ? 0x200U << 2 * port : 0U;
  }
  // With both loops closed no master could open one again. Therefore port 0 accepts frames, whatever DL status shows.
  if (loop_closed_[0] && loop_closed_[1]) loop_closed_[0] = !link_[0];
  if (status == load_u16(&memory_[reg::dl_status])) return;
  store_u16(&memory_[reg::dl_status], status);
  ecat_events_ |= reg::ecat_event::dl_status;
}

void Esc::frame_at_closed_port(unsigned port) {
  const unsigned control = memory_[reg::dl_control + 1] >> 2 * port & 3U;
  if (control != 1 || !link_[port]) return;
  loop_closed_[port] = false;
  configure_ports();
}

void Esc::latch_port_time(unsigned port, Time arrival) {
  store_u32(&memory_[reg::receive_time_port + 4U * port], static_cast<std::uint32_t>(clock_.local_time(arrival)));
}

void Esc::latch_edge(unsigned unit, bool rising, Time now) {
  std::uint8_t& status = memory_[reg::latch0_status + unit];
  const unsigned edge = rising ? 0 : 1;
  const bool single = (memory_[reg::latch0_control + unit] >> edge & 1) != 0;
  status = static_cast<std::uint8_t>((status & 3U) | (rising ? 4U : 0U));
  if (single && (status >> edge & 1) != 0) return;
  store(&memory_[reg::latch_times + 16U * unit + 8U * edge], clock_.system_time(now));
  if (!single) return;
  status = static_cast<std::uint8_t>(status | 1U << edge);
  const bool application_controls = (memory_[reg::cyclic_unit_control] >> (4 + unit) & 1) != 0;
  if (application_controls) {
    attention_ |= reg::al_event::latch;
  } else {
    ecat_events_ |= reg::ecat_event::latch;
  }
}

std::uint16_t Esc::ecat_event_request() const {
  unsigned request = ecat_events_;
  for (unsigned n = 0; n < sync_managers; ++n) {
    const SyncManager& channel = sync_managers_[n];
    if (!channel.active || !channel.interrupts_master) continue;
    // The event is the action of the other side: it filled a buffer, or it read one.
    const bool event = channel.master_writes ? channel.interrupt_read : channel.interrupt_write;
    if (event) request |= static_cast<unsigned>(reg::ecat_event::sync_manager0) << n;
  }
  return static_cast<std::uint16_t>(request);
}

std::uint32_t Esc::al_event_request() const {
  std::uint32_t request = attention_ & (reg::al_event::latch | reg::al_event::sync_manager_activation |
                                        reg::al_event::watchdog_process_data);
  if (al_control_pending_) request |= reg::al_event::al_control;
  if (clock_.sync_level(0, now_)) request |= reg::al_event::sync0;
  if (clock_.sync_level(1, now_)) request |= reg::al_event::sync1;
  for (unsigned n = 0; n < sync_managers; ++n) {
    const SyncManager& channel = sync_managers_[n];
    if (!channel.active || !channel.interrupts_application) continue;
    const bool event = channel.master_writes ? channel.interrupt_write : channel.interrupt_read;
    if (event) request |= reg::al_event::sync_manager0 << n;
  }
  return request;
}

// ---- The application's side ----

std::uint16_t Esc::take_al_control() {
  al_control_pending_ = false;
  settle(reg::al_event::al_control);
  return load_u16(&memory_[reg::al_control]);
}

void Esc::set_al_status(std::uint16_t status, std::uint16_t code) {
  store_u16(&memory_[reg::al_status], status);
  store_u16(&memory_[reg::al_status_code], code);
  ecat_events_ |= reg::ecat_event::al_status;
}

std::span<std::uint8_t> Esc::open_for_reading(unsigned n) {
  SyncManager& channel = sync_managers_[n];
  if (!channel.active || !channel.master_writes) return {};
  const std::int32_t place = channel.reading_at(0);
  if (place < 0) return {};
  return std::span(memory_).subspan(static_cast<std::size_t>(place), channel.length);
}

void Esc::close_reading(unsigned n) {
  SyncManager& channel = sync_managers_[n];
  if (channel.read_open) channel.read(0, channel.length);
}

std::span<std::uint8_t> Esc::open_for_writing(unsigned n) {
  SyncManager& channel = sync_managers_[n];
  if (!channel.active || channel.master_writes) return {};
  const std::int32_t place = channel.writing_at(0);
  if (place < 0) return {};
  return std::span(memory_).subspan(static_cast<std::size_t>(place), channel.length);
}

void Esc::close_writing(unsigned n) {
  SyncManager& channel = sync_managers_[n];
  if (channel.write_open) channel.wrote(0, channel.length);
}

bool Esc::repeat_requested(unsigned n) const {
  const std::uint8_t* registers = &memory_[reg::sync_manager + 8U * n];
  return ((registers[6] & SyncManager::activate_repeat) != 0) != ((registers[7] & SyncManager::pdi_repeat) != 0);
}

void Esc::repeat(unsigned n) {
  sync_managers_[n].refill();
  acknowledge_repeat(n);
}

void Esc::acknowledge_repeat(unsigned n) {
  std::uint8_t* registers = &memory_[reg::sync_manager + 8U * n];
  registers[7] = static_cast<std::uint8_t>((registers[7] & ~SyncManager::pdi_repeat) |
                                           (registers[6] & SyncManager::activate_repeat));
}

void Esc::disable_sync_manager(unsigned n, bool disabled) {
  std::uint8_t& control = memory_[reg::sync_manager + 8U * n + 7];
  const bool was = (control & SyncManager::pdi_disable) != 0;
  if (was == disabled) return;
  control = static_cast<std::uint8_t>(control ^ SyncManager::pdi_disable);
  configure_sync_manager(n);
}

// ---- Time ----

void Esc::expire_watchdogs() {
  if (process_data_watchdog_.check(now_)) attention_ |= reg::al_event::watchdog_process_data;
  if (pdi_watchdog_.check(now_)) configure_ports();
}

unsigned Esc::poll(Time now) {
  now_ = now;
  expire_watchdogs();
  if (now >= dl_control_until_) {
    dl_control_until_ = never;
    memory_[reg::dl_control] = static_cast<std::uint8_t>(memory_[reg::dl_control] & ~0x02U);
    memory_[reg::dl_control + 1] = lasting_loops_;
    configure_ports();
  }
  const unsigned fired = clock_.poll_sync(now);
  attention_ |= fired << 2;
  return fired;
}

}  // namespace servodrome::ethercat
