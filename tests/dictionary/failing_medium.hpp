#pragma once

#include <cstdint>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "dictionary/medium.hpp"

namespace servodrome::dictionary {

// A memory that can lose power at a chosen byte, keep unflushed bytes in a cache, fail to answer, or be worn out.
class FailingMedium final : public Medium {
 public:
  static constexpr std::uint64_t never = std::numeric_limits<std::uint64_t>::max();

  explicit FailingMedium(std::uint32_t size, std::byte fill = std::byte{0}) : memory(size, fill) {}

  std::uint32_t size() const override { return static_cast<std::uint32_t>(memory.size()); }

  bool read(std::uint32_t address, std::span<std::byte> bytes) override {
    if (address + bytes.size() > memory.size()) return out_of_bounds();
    if (reads_until_failure != never && reads_until_failure-- == 0) {
      if (!fails_once) reads_until_failure = 0;
      return false;
    }
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = memory[address + i];
    for (const auto& [place, byte] : cache_) {
      if (place >= address && place < address + bytes.size()) bytes[place - address] = byte;
    }
    return true;
  }

  bool write(std::uint32_t address, std::span<const std::byte> bytes) override {
    if (address + bytes.size() > memory.size()) return out_of_bounds();
    for (const std::byte byte : bytes) {
      if (written == power_ends_after) {
        if (torn_byte_xor != 0 && !dead) memory[address] ^= static_cast<std::byte>(torn_byte_xor);
        dead = true;
        return false;
      }
      ++written;
      if (caching) {
        cache_.emplace_back(address++, byte);
      } else {
        if (address != stuck_at) memory[address] = byte;
        ++address;
      }
    }
    return true;
  }

  bool flush() override {
    if (dead) return false;
    ++flushes;
    for (const auto& [place, byte] : cache_) memory[place] = byte;
    cache_.clear();
    return !flush_fails;
  }

  // The power fails: an arbitrary subset of the cached bytes has been written.
  void lose_cache(std::mt19937& random) {
    for (const auto& [place, byte] : cache_) {
      if ((random() & 1) != 0) memory[place] = byte;
    }
    cache_.clear();
  }

  std::vector<std::byte> memory;
  std::uint64_t power_ends_after = never;  // bytes written
  unsigned torn_byte_xor = 0;              // the byte at which power fails becomes its old value XOR this
  std::uint64_t reads_until_failure = never;
  bool fails_once = false;  // the read after the failed one works again
  bool flush_fails = false;
  std::uint64_t stuck_at = never;  // address of a cell that keeps its value without reporting an error
  bool caching = false;

  std::uint64_t written = 0;
  unsigned flushes = 0;
  bool dead = false;
  bool overran = false;

 private:
  bool out_of_bounds() {
    overran = true;
    return false;
  }

  std::vector<std::pair<std::uint32_t, std::byte>> cache_;
};

}  // namespace servodrome::dictionary
