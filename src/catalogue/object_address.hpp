#pragma once

#include <cstdint>
#include <string>

namespace servodrome::catalogue {

struct ObjectAddress {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  friend bool operator==(const ObjectAddress&, const ObjectAddress&) = default;
  friend bool operator<(const ObjectAddress& a, const ObjectAddress& b) {
    return a.index != b.index ? a.index < b.index : a.sub < b.sub;
  }
};

// For example "6041:00".
std::string text_of(ObjectAddress object);

}  // namespace servodrome::catalogue
