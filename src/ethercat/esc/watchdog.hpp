#pragma once

#include <cstdint>

#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// A watchdog of a slave controller (ETG.1000.4 clause 6.3): runs from its first trigger on.
struct Watchdog {
  // 0400h: the base is divider + 2 periods of 40 ns; the watchdog's time counts bases, 0 switches it off.
  static constexpr Time period_of(std::uint16_t divider, std::uint16_t time) { return Time{40} * (divider + 2) * time; }

  // To be checked before: a trigger that comes too late does not make an expiry undone.
  void trigger(Time now) {
    last = now;
    running = true;
    expired = false;
  }
  // True when it has expired since the last call.
  bool check(Time now) {
    if (!running || period == Time{0} || now - last < period) return false;
    running = false;
    expired = true;
    if (count < 255) ++count;
    return true;
  }
  void stop() { running = expired = false; }
  Time deadline() const { return running && period != Time{0} ? last + period : never; }

  Time period{0};
  Time last{0};
  bool running = false;
  bool expired = false;
  std::uint8_t count = 0;
};

}  // namespace servodrome::ethercat
