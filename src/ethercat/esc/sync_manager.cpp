#include "ethercat/esc/sync_manager.hpp"

#include <utility>

#include "ethercat/bytes.hpp"
#include "ethercat/esc/registers.hpp"

namespace servodrome::ethercat {

void SyncManager::configure(const std::uint8_t* registers, std::uint32_t memory_end) {
  *this = {};
  const std::uint8_t control = registers[4];
  start = load_u16(registers);
  length = load_u16(registers + 2);
  mode = (control & 0x03) == 0x02 ? Mode::mailbox : Mode::buffered;
  master_writes = (control & 0x0C) == 0x04;
  interrupts_master = (control & 0x10) != 0;
  interrupts_application = (control & 0x20) != 0;
  triggers_watchdog = (control & control_watchdog) != 0;
  const std::uint32_t size = (mode == Mode::buffered ? 3U : 1U) * length;
  active = (registers[6] & activate_enable) != 0 && (registers[7] & pdi_disable) == 0 && length != 0 &&
           start >= reg::process_memory && start + size <= memory_end;
}

std::int32_t SyncManager::writing_at(std::uint32_t offset) {
  if (offset >= length) return -1;
  if (mode == Mode::mailbox) {
    if (full || (!write_open && offset != 0)) return -1;
    if (offset == 0) interrupt_read = false;
    write_open = true;
    return place(0, offset);
  }
  if (!write_open && offset != 0) return -1;
  write_open = true;
  if (offset == 0) interrupt_read = false;
  return place(write_buffer, offset);
}

std::int32_t SyncManager::reading_at(std::uint32_t offset) {
  if (offset >= length) return -1;
  if (mode == Mode::mailbox) {
    if (!full || (!read_open && offset != 0)) return -1;
    if (offset == 0) interrupt_write = false;
    read_open = true;
    return place(0, offset);
  }
  if (!valid || (!read_open && offset != 0)) return -1;
  if (offset == 0) {
    if (full) std::swap(read_buffer, last_buffer);
    full = false;
    interrupt_write = false;
    read_open = true;
  }
  return place(read_buffer, offset);
}

bool SyncManager::wrote(std::uint32_t offset, std::uint32_t bytes) {
  if (offset + bytes < length) return false;
  write_open = false;
  interrupt_write = true;
  full = true;
  if (mode == Mode::buffered) {
    valid = true;
    std::swap(write_buffer, last_buffer);
  }
  return true;
}

bool SyncManager::read(std::uint32_t offset, std::uint32_t bytes) {
  if (offset + bytes < length) return false;
  read_open = false;
  interrupt_read = true;
  if (mode == Mode::mailbox) full = false;
  return true;
}

std::uint8_t SyncManager::status() const {
  unsigned value = (interrupt_write ? 0x01U : 0U) | (interrupt_read ? 0x02U : 0U);
  if (mode == Mode::mailbox) {
    value |= full ? 0x08U : 0U;
  } else {
    value |= (valid ? full ? last_buffer : read_buffer : 3U) << 4;
  }
  value |= (read_open ? 0x40U : 0U) | (write_open ? 0x80U : 0U);
  return static_cast<std::uint8_t>(value);
}

}  // namespace servodrome::ethercat
