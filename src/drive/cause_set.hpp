#pragma once

#include <array>
#include <cstdint>

#include "drive/faults.hpp"

namespace servodrome::drive {

class CauseSet {
 public:
  void set(Cause cause, bool present = true) {
    const auto n = static_cast<unsigned>(cause);
    const std::uint64_t mask = std::uint64_t{1} << (n & 63u);
    words_[n >> 6u] = present ? words_[n >> 6u] | mask : words_[n >> 6u] & ~mask;
  }
  bool test(Cause cause) const {
    const auto n = static_cast<unsigned>(cause);
    return (words_[n >> 6u] >> (n & 63u) & 1u) != 0;
  }
  bool any() const { return (words_[0] | words_[1] | words_[2] | words_[3]) != 0; }
  void clear() { words_ = {}; }
  CauseSet& operator|=(const CauseSet& other) {
    for (std::size_t i = 0; i < words_.size(); ++i) words_[i] |= other.words_[i];
    return *this;
  }
  friend bool operator==(const CauseSet&, const CauseSet&) = default;

 private:
  std::array<std::uint64_t, 4> words_{};
};

}  // namespace servodrome::drive
