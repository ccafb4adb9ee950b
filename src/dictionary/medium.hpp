#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace servodrome::dictionary {

// Interface to the non-volatile memory of a Store: an EEPROM, a part of a flash, a file. Byte-addressed from 0; a write
// replaces the bytes. Callers stay within `size`.
class Medium {
 public:
  virtual std::uint32_t size() const = 0;
  // False if the memory does not respond; the bytes are undefined then.
  virtual bool read(std::uint32_t address, std::span<std::byte> bytes) = 0;
  virtual bool write(std::uint32_t address, std::span<const std::byte> bytes) = 0;
  // Returns when all earlier writes are safe against a loss of power. Later writes must not be stored before them.
  virtual bool flush() = 0;

 protected:
  ~Medium() = default;
};

// A volatile medium, for a device without non-volatile memory: values exist as long as the `memory` passed to it.
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
