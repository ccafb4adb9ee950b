#include "ethercat/esc/sync_manager.hpp"

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
  guards = (registers[6] & activate_enable) != 0 && length != 0 && start >= reg::process_memory &&
           start + size <= memory_end;
  active = guards && (registers[7] & pdi_disable) == 0;
  write_buffer = start;
  last_buffer = static_cast<std::uint16_t>(start + length);
  read_buffer = static_cast<std::uint16_t>(start + 2U * length);
}

std::uint8_t SyncManager::status() const {
  unsigned value = (interrupt_write ? 0x01U : 0U) | (interrupt_read ? 0x02U : 0U);
  if (mode == Mode::mailbox) {
    value |= unread != 0 ? 0x08U : 0U;
  } else {
    const unsigned newest = unread != 0 ? last_buffer : read_buffer;
    value |= (valid ? (newest - start) / length : 3U) << 4;
  }
  value |= (read_open ? 0x40U : 0U) | (write_open ? 0x80U : 0U);
  return static_cast<std::uint8_t>(value);
}

}  // namespace servodrome::ethercat
