#include "master/process_image.hpp"

#include <algorithm>

namespace servodrome::master {

std::uint64_t ProcessObject::raw() const {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < std::min(bits_.count, 64U); ++i) {
    const unsigned bit = bits_.first + i;
    value |= static_cast<std::uint64_t>(bytes_[bit / 8] >> bit % 8 & 1) << i;
  }
  return value;
}

void ProcessObject::set_raw(std::uint64_t value) {
  for (unsigned i = 0; i < bits_.count; ++i) {
    const unsigned bit = bits_.first + i;
    const unsigned mask = 1U << bit % 8;
    const bool set = i < 64 && (value >> i & 1) != 0;
    bytes_[bit / 8] = static_cast<std::uint8_t>(set ? bytes_[bit / 8] | mask : bytes_[bit / 8] & ~mask);
  }
}

}  // namespace servodrome::master
