#pragma once

#include <cstdint>
#include <utility>

namespace servodrome::ethercat {

// One sync manager channel: the rules by which master and application hand a buffer to each other (ETG.1000.4 clause
// 6.5). The channel stores the position of its area and which side may access it; the controller owns the bytes.
//
// Each side opens a buffer with an access to its first byte and closes it with an access to its last byte.
struct alignas(32) SyncManager {  // aligned so that both process data channels share a cache line
  enum class Mode : std::uint8_t { buffered, mailbox };

  // Registers 0800h..0807h + 8n.
  static constexpr std::uint8_t activate_enable = 0x01;
  static constexpr std::uint8_t activate_repeat = 0x02;
  static constexpr std::uint8_t pdi_disable = 0x01;
  static constexpr std::uint8_t pdi_repeat = 0x02;
  static constexpr std::uint8_t control_watchdog = 0x40;

  // Loads the registers; `memory_end` is the first address that does not exist. Discards the content of the buffers.
  void configure(const std::uint8_t* registers, std::uint32_t memory_end);

  bool contains(std::uint32_t address) const {
    return guards && address - start < (mode == Mode::buffered ? 3U * length : length);
  }
  bool contains_user_area(std::uint32_t address, std::uint32_t bytes) const {
    return active && address >= start && address + bytes <= std::uint32_t{start} + length;
  }

  // Returns the address in the memory if the writing (reading) side may access `offset` now, otherwise -1. Call
  // `wrote` (`read`) after the access.
  std::int32_t writing_at(std::uint32_t offset);
  std::int32_t reading_at(std::uint32_t offset);
  // Returns true if this access closed the buffer.
  bool wrote(std::uint32_t offset, std::uint32_t bytes);
  bool read(std::uint32_t offset, std::uint32_t bytes);

  // Accesses a whole buffer of a three-buffer area in one step: opens it, closes it and returns its address.
  std::uint32_t write_whole() {
    const std::uint16_t at = write_buffer;
    write_buffer = std::exchange(last_buffer, at);
    write_open = interrupt_read = false;
    valid = interrupt_write = true;
    ++unread;
    return at;
  }
  std::uint32_t read_whole() {
    if (unread != 0) std::swap(read_buffer, last_buffer);
    unread = 0;
    read_open = interrupt_write = false;
    interrupt_read = true;
    return read_buffer;
  }

  // Answer to a repeat request: marks a mailbox that was read as full again, with the same content.
  void refill() { unread = 1; }

  // Register 0805h + 8n.
  std::uint8_t status() const;

  std::uint16_t start = 0;
  std::uint16_t length = 0;
  Mode mode = Mode::buffered;
  bool guards = false;  // the master enabled the channel, and its area exists
  bool active = false;  // the application enabled it as well; otherwise the area cannot be accessed
  bool master_writes = false;
  bool interrupts_master = false;
  bool interrupts_application = false;
  bool triggers_watchdog = false;

  // Members that a whole buffer access changes lie together.
  std::uint32_t unread = 0;  // written buffers that the reader has not begun to read; mailbox: 1 until it is read
  bool valid = false;        // buffered: written at least once
  bool write_open = false;
  bool interrupt_write = false;  // status bit 0
  bool interrupt_read = false;   // status bit 1
  bool read_open = false;
  // Addresses in the memory; a mailbox has only the first.
  std::uint16_t write_buffer = 0;
  std::uint16_t last_buffer = 0;  // last buffer that was completely written
  std::uint16_t read_buffer = 0;
};

// These functions are inline because every process data frame calls them.
inline std::int32_t SyncManager::writing_at(std::uint32_t offset) {
  if (offset >= length) return -1;
  if (mode == Mode::mailbox) {
    if (unread != 0 || (!write_open && offset != 0)) return -1;
    if (offset == 0) interrupt_read = false;
    write_open = true;
    return static_cast<std::int32_t>(start + offset);
  }
  if (!write_open && offset != 0) return -1;
  write_open = true;
  if (offset == 0) interrupt_read = false;
  return static_cast<std::int32_t>(write_buffer + offset);
}

inline std::int32_t SyncManager::reading_at(std::uint32_t offset) {
  if (offset >= length) return -1;
  if (mode == Mode::mailbox) {
    if (unread == 0 || (!read_open && offset != 0)) return -1;
    if (offset == 0) interrupt_write = false;
    read_open = true;
    return static_cast<std::int32_t>(start + offset);
  }
  if (!valid || (!read_open && offset != 0)) return -1;
  if (offset == 0) {
    if (unread != 0) std::swap(read_buffer, last_buffer);
    unread = 0;
    interrupt_write = false;
    read_open = true;
  }
  return static_cast<std::int32_t>(read_buffer + offset);
}

inline bool SyncManager::wrote(std::uint32_t offset, std::uint32_t bytes) {
  if (offset + bytes < length) return false;
  write_open = false;
  interrupt_write = true;
  ++unread;
  if (mode == Mode::buffered) {
    valid = true;
    std::swap(write_buffer, last_buffer);
  }
  return true;
}

inline bool SyncManager::read(std::uint32_t offset, std::uint32_t bytes) {
  if (offset + bytes < length) return false;
  read_open = false;
  interrupt_read = true;
  if (mode == Mode::mailbox) unread = 0;
  return true;
}

}  // namespace servodrome::ethercat
