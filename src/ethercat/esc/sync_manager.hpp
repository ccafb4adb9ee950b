#pragma once

#include <cstdint>
#include <span>

namespace servodrome::ethercat {

// One sync manager channel: the rules by which master and application pass a buffer to each other (ETG.1000.4 clause
// 6.5). Knows where its area is and whose turn it is; the bytes are the controller's.
//
// The side that writes and the side that reads open a buffer at its first byte and close it at its last.
struct SyncManager {
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
    return active && address - start < (mode == Mode::buffered ? 3U * length : length);
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

  // A mailbox that was read is full again with what it held: the answer to a repeat request.
  void refill() { full = true; }

  // Register 0805h + 8n.
  std::uint8_t status() const;

  std::uint16_t start = 0;
  std::uint16_t length = 0;
  Mode mode = Mode::buffered;
  bool active = false;  // enabled by both sides, and its area exists
  bool master_writes = false;
  bool interrupts_master = false;
  bool interrupts_application = false;
  bool triggers_watchdog = false;

  bool full = false;   // mailbox: written and not read; buffered: a buffer the reader has not seen
  bool valid = false;  // buffered: written at least once
  bool write_open = false;
  bool read_open = false;
  bool interrupt_write = false;  // status bit 0
  bool interrupt_read = false;   // status bit 1
  std::uint8_t write_buffer = 0;
  std::uint8_t last_buffer = 1;  // last one that was completely written
  std::uint8_t read_buffer = 2;

 private:
  std::int32_t place(std::uint8_t buffer, std::uint32_t offset) const {
    return static_cast<std::int32_t>(start + buffer * std::uint32_t{length} + offset);
  }
};

}  // namespace servodrome::ethercat
