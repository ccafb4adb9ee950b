#pragma once

#include <cstdint>
#include <span>

#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// CRC-8 over the first 14 bytes of the slave information, stored in its word 7: polynomial 07h, initial value FFh
// (ETG.1000.6 clause 5.4).
std::uint8_t sii_checksum(std::span<const std::uint8_t> first_14_bytes);

// The interface to the slave information memory (EEPROM), registers 0500h..050Fh (ETG.1000.4 clause 6.4).
class SiiInterface {
 public:
  // Access time of the memory. An I2C EEPROM needs about 0.1 ms for a read and 5 ms for a write.
  struct Timing {
    Time read{std::chrono::microseconds(100)};
    Time write{std::chrono::milliseconds(5)};
  };

  // `memory` is the content, which writes change. Empty: no memory is fitted.
  SiiInterface(std::span<std::uint8_t> memory, Timing timing) : memory_(memory), timing_(timing) {}

  void power_on();

  // Returns true if the first 16 bytes exist and their checksum is right.
  bool load();
  bool loaded() const { return loaded_; }
  std::span<std::uint8_t> memory() const { return memory_; }
  // Returns true if a word has been written since the last call. For a caller that stores the memory permanently.
  bool take_written() {
    const bool written = written_;
    written_ = false;
    return written;
  }

  enum class Side : std::uint8_t { master, application };
  bool granted(Side side) const { return (application_has_it() ? Side::application : Side::master) == side; }

  // Register access, offsets from 0500h. `byte_written` only stores the byte; `run` starts a command.
  std::uint8_t byte(std::uint8_t offset, Time now);
  // Returns false if this side has no write access now.
  bool byte_written(std::uint8_t offset, std::uint8_t value, Side side, Time now);
  // Call it after an access that wrote 0503h: starts the command.
  void run(Side side, Time now);
  // Returns true if a reload command has finished since the last call.
  bool take_reloaded() {
    const bool reloaded = reloaded_;
    reloaded_ = false;
    return reloaded;
  }
  void frame_ended() { write_enabled_ = false; }

 private:
  enum class Command : std::uint8_t { none = 0, read = 1, write = 2, reload = 4 };

  // The application has the interface as soon as the master offers it, and keeps it until the application releases it
  // or the master forces it back.
  bool application_has_it() const { return ((configuration_ | pdi_access_) & 1) != 0; }
  bool busy(Time now);
  void finish();

  std::span<std::uint8_t> memory_;
  Timing timing_;
  std::uint8_t configuration_ = 0;
  std::uint8_t pdi_access_ = 0;
  std::uint32_t address_ = 0;  // in words
  std::uint8_t data_[8]{};
  std::uint8_t command_ = 0;  // bits 8..10 of the control register as written
  bool loaded_ = false;
  bool checksum_error_ = false;
  bool acknowledge_error_ = false;
  bool write_enable_error_ = false;
  bool write_enabled_ = false;
  bool command_written_ = false;
  bool written_ = false;
  bool reloaded_ = false;
  Command running_ = Command::none;
  std::uint16_t write_data_ = 0;
  Time done_at_ = never;
};

}  // namespace servodrome::ethercat
