#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "ethercat/slave/indicators.hpp"

namespace servodrome::products {

// The visible state of a lamp.
enum class Light : std::uint8_t { off, on, blinking, flickering, flashes };

struct Lamp {
  std::string_view name;
  std::string_view colour;
  Light light = Light::off;
  std::uint8_t flashes = 0;  // of Light::flashes: number of flashes before a pause
};

// All lamps of a drive, in the order of its front.
class Lamps {
 public:
  void add(const Lamp& lamp) { lamps_[count_++] = lamp; }
  std::span<const Lamp> all() const { return std::span(lamps_).first(count_); }

 private:
  std::array<Lamp, 6> lamps_{};
  std::size_t count_ = 0;
};

constexpr Light steady(bool on) { return on ? Light::on : Light::off; }

constexpr Lamp blinking_lamp(std::string_view name, std::string_view colour, ethercat::Blink blink) {
  switch (blink) {
    case ethercat::Blink::off: return {name, colour, Light::off};
    case ethercat::Blink::single_flash: return {name, colour, Light::flashes, 1};
    case ethercat::Blink::double_flash: return {name, colour, Light::flashes, 2};
    case ethercat::Blink::blinking: return {name, colour, Light::blinking};
    case ethercat::Blink::flickering: return {name, colour, Light::flickering};
    case ethercat::Blink::on: return {name, colour, Light::on};
  }
  return {name, colour};
}

}  // namespace servodrome::products
