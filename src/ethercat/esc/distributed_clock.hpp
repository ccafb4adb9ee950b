#pragma once

#include <array>
#include <cstdint>

#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// The distributed clock of a slave controller (ETG.1000.4 clause 6.7): an oscillator with a frequency error, the time
// that it counts, and the SYNC pulses made from that time. All times are in nanoseconds.
//
//     local time  = oscillator, sped up or slowed down by the drift compensation
//     system time = local time + offset
//
// The drift compensation is a PI filter on the reference time that the master distributes. Each comparison removes
// 2^(1 - filter depth) of the difference from the local time, no faster than the speed counter allows. It also corrects
// the rate by 2^(4 - speed filter depth) of the difference per elapsed time, or by less if the filter would otherwise
// be underdamped. The depths 4 and 12 of the standard make the filter critically damped. The standard leaves the inner
// structure of the filter to the controller.
class DistributedClock {
 public:
  // Power-on: sets the local time to 0 at `now`, without any compensation. The oscillator keeps its frequency.
  void reset(Time now);

  // Frequency error of the oscillator in parts per billion, +-400'000'000 at most; +100000 means 100 ppm too fast. The
  // drift compensation makes up for 763 ppm by default (0930h).
  void set_oscillator(std::int32_t error_ppb, Time now);
  // Stops the clock, or restarts it from the time at which it stopped. A stopped clock makes no pulses; comparisons
  // with the reference clock do not change it.
  void stop(bool stopped, Time now);
  // Moves the local time, also backwards; it wraps at 0. A jump over several pulses makes one of them at the next poll.
  // After a jump backwards the next pulse comes later by the same time.
  void jump(Time by, Time now);

  std::uint64_t local_time(Time now) const;
  std::uint64_t system_time(Time now) const { return local_time(now) + offset_; }

  // The earliest time at which the system time reaches `system`; returns `now` if it has already reached it, `never` if
  // the clock is stopped at an earlier time.
  Time when(std::uint64_t system, Time now) const;

  void set_offset(std::uint64_t offset) {
    offset_ = offset;
    next_known_ = false;
  }
  std::uint64_t offset() const { return offset_; }
  void set_delay(std::uint32_t delay) { delay_ = delay; }

  // Compares the own system time with the reference clock's time (its low 32 bits, which the standard compares).
  void compare(std::uint32_t received, Time now);
  // Mean difference in the format of 092Ch: bit 31 is 1 if the own time is not behind the received time, bits 30..0
  // are the amount in ns. This is the meaning in the controllers' data sheet since its version 2.8; earlier versions
  // describe bit 31 the other way round by mistake. 0 before the first comparison.
  std::uint32_t difference() const;

  // 0930h: limits the compensation, 0080h..3FFFh; restarts the filter.
  void set_speed_counter_start(std::uint16_t start, Time now);
  std::uint16_t speed_counter_start() const { return speed_counter_start_; }
  // 0932h: the present compensation, as the difference of the counter's periods.
  std::int16_t speed_counter_difference() const;
  void set_filters(std::uint8_t difference_depth, std::uint8_t speed_depth);

  // ---- SYNC0 and SYNC1 (ETG.1000.4 clause 6.7.3) ----

  struct SyncSettings {
    bool sync0 = false;
    bool sync1 = false;
    bool check_start_time = false;  // start at once if the start time is not in the near future
    bool short_near_future = false;
    std::uint64_t start_time = 0;    // system time of the first SYNC0
    std::uint32_t sync0_cycle = 0;   // ns; 0: a single pulse
    std::uint32_t sync1_cycle = 0;   // ns from a SYNC0 to its SYNC1
    std::uint16_t pulse_length = 0;  // in 10 ns; 0: until acknowledged
  };
  struct Sync {
    bool enabled = false;
    bool pending = false;     // another pulse will come
    std::uint64_t next = 0;   // system time of the next pulse
    std::uint64_t last = 0;   // system time of the last pulse
    std::uint64_t step = 0;   // ns from pulse to pulse; 0: single pulse
    std::uint32_t count = 0;  // pulses since the start
    bool unacknowledged = false;
  };
  // Returns false if the start time is not in the near future (0984h bit 2); without `check_start_time` no pulse starts
  // then.
  bool start_sync(const SyncSettings& settings, Time now);
  void stop_sync();
  // Switches the pulses of SYNCn on or off while the unit runs.
  void enable_sync(unsigned n, bool enabled, Time now);
  const Sync& sync(unsigned n) const { return sync_[n]; }
  void acknowledge_sync(unsigned n) { sync_[n].unacknowledged = false; }
  bool sync_level(unsigned n, Time now) const;
  // Makes the pulses that are due. Returns bit n for SYNCn.
  unsigned poll_sync(Time now);
  // When to poll next. Pulses closer than 10 us are polled together.
  Time next_sync(Time now) {
    if (!next_known_) find_next_sync(now);
    return next_;
  }

 private:
  void find_next_sync(Time now);
  void anchor(Time now);
  Time elapsed(Time now) const { return stopped_ ? Time{0} : now - anchor_; }

  // anchor() stores a pair of the caller's time and local time. Between two anchors, local time is linear in the
  // caller's time, except that the phase correction ends when no phase is left.
  Time anchor_{0};
  std::uint64_t anchor_local_ = 0;
  std::uint32_t anchor_fraction_ = 0;  // 2^-32 ns
  std::int64_t oscillator_ = 0;        // error, 2^-32
  std::int64_t compensation_ = 0;      // rate, 2^-32
  std::int64_t rate_ = 0;              // sum of oscillator error and compensation, 2^-32
  std::int64_t phase_ = 0;             // ns of phase still to remove, at rate `slew_` at most
  std::int64_t slew_ = 0;              // 2^-32

  bool stopped_ = false;

  std::uint64_t offset_ = 0;
  std::uint32_t delay_ = 0;
  bool compared_ = false;
  std::uint64_t last_comparison_ = 0;  // local time
  std::int64_t mean_difference_ = 0;   // 1/256 ns
  std::uint16_t speed_counter_start_ = 0x1000;
  std::uint8_t difference_depth_ = 4;
  std::uint8_t speed_depth_ = 12;

  std::array<Sync, 2> sync_{};
  bool started_ = false;  // start_sync() was called: pulses run or will run
  std::uint64_t pulse_length_ = 0;
  Time next_{0};  // earlier pulse of both, in the caller's time
  bool next_known_ = false;
};

}  // namespace servodrome::ethercat
