#pragma once

#include <cstdint>
#include <utility>

namespace servodrome::ethercat {

// One sync manager channel: the rules by which master and application pass a buffer to each other (ETG.1000.4 clause
// 6.5). Knows where its area is and whose turn it is; the bytes are the controller's.
//
// The side that writes and the side that reads open a buffer at its first byte and close it at its last.
struct alignas(32) SyncManager {  // so that those of the process data share a cache line
  enum class Mode : std::uint8_t { buffered, mailbox };

  // Registers 0800h..0807h + 8n.
  static constexpr std::uint8_t activate_enable = 0x01;
  static constexpr std::uint8_t activate_repeat = 0x02;
  static constexpr std::uint8_t pdi_disable = 0x01;
  static constexpr std::uint8_t pdi_repeat = 0x02;
  static constexpr std::uint8_t control_watchdog = 0x40;

  // Takes over the registers; `memory_end` is the first address that does not exist. Whatever was in the buffers is
  // gone.
  void configure(const std::uint8_t* registers, std::uint32_t memory_end);

  bool contains(std::uint32_t address) const {
    return guards && address - start < (mode == Mode::buffered ? 3U * length : length);
  }
  bool contains_user_area(std::uint32_t address, std::uint32_t bytes) const {
    return active && address >= start && address + bytes <= std::uint32_t{start} + length;
  }

  // May `bytes` at `offset` be accessed now by the side that writes (reads)? If so, where they are, as an offset into
  // the memory; otherwise -1. Follow with `wrote` (`read`).
  std::int32_t writing_at(std::uint32_t offset);
  std::int32_t reading_at(std::uint32_t offset);
  // Returns true when this access closed the buffer.
  bool wrote(std::uint32_t offset, std::uint32_t bytes);
  bool read(std::uint32_t offset, std::uint32_t bytes);

  // The same for a whole buffer of three at once: where it is; then it is closed.
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

  // A mailbox that was read is full again with what it held: the answer to a repeat request.
  void refill() { unread = 1; }

  // Register 0805h + 8n.
  std::uint8_t status() const;

  std::uint16_t start = 0;
  std::uint16_t length = 0;
  Mode mode = Mode::buffered;
  bool guards = false;  // enabled by the master, and its area exists
  bool active = false;  // by the application as well; else the area cannot be accessed
  bool master_writes = false;
  bool interrupts_master = false;
  bool interrupts_application = false;
  bool triggers_watchdog = false;

  // What a whole buffer changes lies together.
  std::uint32_t unread = 0;  // written buffers the reader has not begun to read; of a mailbox one, until it is read
  bool valid = false;        // buffered: written at least once
  bool write_open = false;
  bool interrupt_write = false;  // status bit 0
  bool interrupt_read = false;   // status bit 1
  bool read_open = false;
  // Addresses in the memory; of a mailbox there is only the first.
  std::uint16_t write_buffer = 0;
  std::uint16_t last_buffer = 0;  // last one that was completely written
  std::uint16_t read_buffer = 0;
};

// In the path of every process data frame, hence here.
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
