#pragma once

#include <cstdint>

#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// A watchdog of a slave controller (ETG.1000.4 clause 6.3): it starts with its first trigger.
class Watchdog {
 public:
  // 0400h: the time base is (divider + 2) periods of 40 ns; `time` counts time bases, 0 switches the watchdog off.
  static constexpr Time period_of(std::uint16_t divider, std::uint16_t time) { return Time{40} * (divider + 2) * time; }

  // Also changes the deadline of a running watchdog.
  void set_period(Time period) {
    period_ = period;
    if (running_) run();
  }
  // Returns true if it has expired since the last call.
  bool check(Time now) {
    if (now < deadline_) return false;
    expire();
    return true;
  }
  // Call check() before, because a trigger that comes too late would otherwise hide the expiry.
  void trigger(Time now) {
    last_ = now;
    running_ = true;
    expired_ = false;
    run();
  }
  void stop() {
    running_ = expired_ = false;
    deadline_ = never;
  }
  void clear_count() { count_ = 0; }

  bool expired() const { return expired_; }
  std::uint8_t count() const { return count_; }  // expiries, stops at 255
  Time deadline() const { return deadline_; }    // `never` if it does not run

 private:
  void run() { deadline_ = period_ != Time{0} ? last_ + period_ : never; }
  void expire() {
    running_ = false;
    expired_ = true;
    deadline_ = never;
    if (count_ < 255) ++count_;
  }

  Time deadline_ = never;
  Time period_{0};
  Time last_{0};
  bool running_ = false;
  bool expired_ = false;
  std::uint8_t count_ = 0;
};

}  // namespace servodrome::ethercat
