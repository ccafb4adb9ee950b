#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace servodrome::dictionary {

// Non-volatile memory as a Store needs it: an EEPROM, a part of a flash, a file. Byte addressed from 0; a write
// replaces what was there. Callers stay within `size`.
class Medium {
 public:
  virtual std::uint32_t size() const = 0;
  // False when the memory did not answer; then nothing is known about the bytes.
  virtual bool read(std::uint32_t address, std::span<std::byte> bytes) = 0;
  virtual bool write(std::uint32_t address, std::span<const std::byte> bytes) = 0;
  // Returns when everything written before outlives a loss of power. Nothing written later may arrive earlier.
  virtual bool flush() = 0;

 protected:
  ~Medium() = default;
};

// A medium that forgets: for a device without non-volatile memory, whose values live as long as the `memory` it is
// given.
class RamMedium final : public Medium {
 public:
  explicit RamMedium(std::span<std::byte> memory) : memory_(memory) {}

  std::uint32_t size() const override { return static_cast<std::uint32_t>(memory_.size()); }
  bool read(std::uint32_t address, std::span<std::byte> bytes) override {
    std::copy_n(memory_.begin() + address, bytes.size(), bytes.begin());
    return true;
  }
  bool write(std::uint32_t address, std::span<const std::byte> bytes) override {
    std::copy(bytes.begin(), bytes.end(), memory_.begin() + address);
    return true;
  }
  bool flush() override { return true; }

 private:
  std::span<std::byte> memory_;
};

}  // namespace servodrome::dictionary
