#pragma once

#include <cstdint>

namespace servodrome::drive {

// Debounce for windows: true once the condition has held for `needed` cycles without interruption.
class Dwell {
 public:
  bool update(bool condition, std::uint32_t needed) {
    count_ = condition ? (count_ < needed ? count_ + 1 : count_) : 0;
    return condition && count_ >= needed;
  }
  void reset() { count_ = 0; }

 private:
  std::uint32_t count_ = 0;
};

}  // namespace servodrome::drive
