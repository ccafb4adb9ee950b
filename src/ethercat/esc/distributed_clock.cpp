#include "ethercat/esc/distributed_clock.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::ethercat {

namespace {

constexpr std::int64_t one = std::int64_t{1} << 32;  // 1.0 in the fixed-point format of rates
constexpr std::uint16_t least_speed_counter_start = 0x0080;
constexpr std::uint16_t greatest_speed_counter_start = 0x3FFF;
constexpr std::uint16_t speed_counter_margin = 0x007F;  // the difference stays at least this far below the start value

constexpr std::uint64_t closest_deadlines = 10'000;       // ns
constexpr std::int32_t greatest_error_ppb = 400'000'000;  // keeps rates below 2^31, see scaled()

// (x * rate + fraction) / 2^32, rounded down; `fraction` returns the remainder. Does not overflow for any x that fits
// and |rate| < 2^31.
std::int64_t scaled(std::int64_t x, std::int64_t rate, std::uint32_t& fraction) {
  const std::int64_t high = x >> 32;
  const std::int64_t low = (x & 0xFFFFFFFF) * rate + fraction;
  fraction = static_cast<std::uint32_t>(low & 0xFFFFFFFF);
  return high * rate + (low >> 32);
}

// Relative speed gain of a clock whose counter of `start` periods of 10 ns is lengthened and shortened by `difference`:
// +1 ns every start - difference + 2 periods, -1 ns every start + difference + 2 periods.
double gain(double start, double difference) {
  return difference / (5.0 * (start + difference + 2.0) * (start - difference + 2.0));
}

std::int64_t limit_of(std::uint16_t start) {
  return static_cast<std::int64_t>(gain(start, start - speed_counter_margin) * static_cast<double>(one));
}

}  // namespace

void DistributedClock::reset(Time now) {
  const std::int64_t oscillator = oscillator_;
  const bool stopped = stopped_;
  *this = {};
  oscillator_ = rate_ = oscillator;
  stopped_ = stopped;
  anchor_ = now;
  slew_ = limit_of(speed_counter_start_);
}

void DistributedClock::anchor(Time now) {
  const std::int64_t delta = elapsed(now).count();
  const std::uint64_t local = local_time(now);
  scaled(delta, rate_, anchor_fraction_);
  std::uint32_t none = 0;
  const std::int64_t done = std::min(scaled(delta, slew_, none), std::abs(phase_));
  phase_ += phase_ > 0 ? -done : done;
  anchor_local_ = local;
  anchor_ = now;
  next_known_ = false;
}

void DistributedClock::set_oscillator(std::int32_t error_ppb, Time now) {
  anchor(now);
  oscillator_ = std::int64_t{std::clamp(error_ppb, -greatest_error_ppb, greatest_error_ppb)} * one / 1'000'000'000;
  rate_ = oscillator_ + compensation_ + oscillator_ * compensation_ / one;
}

void DistributedClock::stop(bool stopped, Time now) {
  anchor(now);
  stopped_ = stopped;
}

void DistributedClock::jump(Time by, Time now) {
  anchor(now);
  anchor_local_ += static_cast<std::uint64_t>(by.count());
}

std::uint64_t DistributedClock::local_time(Time now) const {
  const std::int64_t delta = elapsed(now).count();
  std::uint32_t fraction = anchor_fraction_;
  std::int64_t local = static_cast<std::int64_t>(anchor_local_) + delta + scaled(delta, rate_, fraction);
  if (phase_ != 0) {
    std::uint32_t none = 0;
    const std::int64_t done = std::min(scaled(delta, slew_, none), std::abs(phase_));
    local += phase_ > 0 ? done : -done;
  }
  return static_cast<std::uint64_t>(local);
}

Time DistributedClock::when(std::uint64_t system, Time now) const {
  constexpr std::int64_t beyond = std::int64_t{1} << 61;  // 73 years: treated as never, small enough to be added
  const auto missing = [&](Time at) { return static_cast<std::int64_t>(system - system_time(at)); };
  std::int64_t left = missing(now);
  if (left <= 0) return now;
  if (left >= beyond || stopped_) return never;
  // A phase correction changes the speed by less than 1/1000, so each step reduces the remaining distance to 1/1000.
  const double speed = 1.0 + static_cast<double>(rate_) / static_cast<double>(one);
  Time at = now;
  for (int i = 0; i < 8 && left != 0; ++i, left = missing(at)) {
    at = std::max(now, at + Time{std::llround(static_cast<double>(left) / speed)});
  }
  // Search the first nanosecond that shows the wanted time; it is at most a few away.
  while (missing(at) > 0) at += Time{1};
  while (at > now && missing(at - Time{1}) <= 0) at -= Time{1};
  return at;
}

void DistributedClock::compare(std::uint32_t received, Time now) {
  anchor(now);
  const auto own = static_cast<std::uint32_t>(system_time(now));
  const std::int64_t error = static_cast<std::int32_t>(own - delay_ - received);
  mean_difference_ += (error * 256 - mean_difference_) / (std::int64_t{1} << difference_depth_);
  const std::int64_t elapsed = static_cast<std::int64_t>(anchor_local_ - last_comparison_);
  last_comparison_ = anchor_local_;
  const int phase_shift = std::max<int>(difference_depth_, 1) - 1;
  phase_ = -(error / (std::int64_t{1} << phase_shift));
  if (phase_ == 0 && error != 0) phase_ = error > 0 ? -1 : 1;
  if (!compared_) {
    compared_ = true;
    return;
  }
  if (elapsed <= 0) return;
  // While the phase correction is rate-limited, the error says little about the rate.
  std::uint32_t none = 0;
  if (std::abs(phase_) > scaled(elapsed, slew_, none)) return;
  const int speed_shift = std::max(speed_depth_ - 4, 2 * phase_shift + 2);
  const double slope = static_cast<double>(error) / static_cast<double>(elapsed);
  const auto change = static_cast<std::int64_t>(std::ldexp(slope * static_cast<double>(one), -speed_shift));
  const std::int64_t limit = limit_of(speed_counter_start_);
  compensation_ = std::clamp(compensation_ - change, -limit, limit);
  rate_ = oscillator_ + compensation_ + oscillator_ * compensation_ / one;
}

std::uint32_t DistributedClock::difference() const {
  if (!compared_) return 0;
  const std::int64_t mean = mean_difference_ / 256;
  const auto amount = static_cast<std::uint32_t>(std::min<std::int64_t>(std::abs(mean), 0x7FFFFFFF));
  return mean < 0 ? amount : amount | 0x80000000U;
}

void DistributedClock::set_speed_counter_start(std::uint16_t start, Time now) {
  anchor(now);
  speed_counter_start_ = std::clamp(start, least_speed_counter_start, greatest_speed_counter_start);
  slew_ = limit_of(speed_counter_start_);
  compensation_ = 0;
  rate_ = oscillator_;
  phase_ = 0;
  mean_difference_ = 0;
  compared_ = false;
}

std::int16_t DistributedClock::speed_counter_difference() const {
  if (compensation_ == 0) return 0;
  // gain(start, difference) = rate, solved for difference.
  const double rate = static_cast<double>(compensation_) / static_cast<double>(one);
  const double start = speed_counter_start_ + 2.0;
  const double difference = (std::sqrt(1.0 + 100.0 * rate * rate * start * start) - 1.0) / (10.0 * rate);
  return static_cast<std::int16_t>(std::lround(difference));
}

void DistributedClock::set_filters(std::uint8_t difference_depth, std::uint8_t speed_depth) {
  difference_depth_ = std::min<std::uint8_t>(difference_depth & 0x0F, 12);
  speed_depth_ = std::min<std::uint8_t>(speed_depth & 0x0F, 12);
  mean_difference_ = 0;
}

// ---- SYNC0 and SYNC1 ----

bool DistributedClock::start_sync(const SyncSettings& settings, Time now) {
  stop_sync();
  pulse_length_ = settings.pulse_length * std::uint64_t{10};
  std::uint64_t start = settings.start_time;
  const std::uint64_t system = system_time(now);
  const std::uint64_t ahead = start - system;
  const std::uint64_t near = settings.short_near_future ? std::uint64_t{1} << 31 : std::uint64_t{1} << 63;
  const bool plausible = ahead < near;
  if (!plausible) {
    if (!settings.check_start_time) {
      // The unit is activated, but no pulse comes: software that waits for a pulse has to notice this.
      sync_[0] = {.enabled = settings.sync0, .step = settings.sync0_cycle};
      return false;
    }
    start = system;
  }
  started_ = true;
  const std::uint64_t cycle0 = settings.sync0_cycle;
  const std::uint64_t cycle1 = settings.sync1_cycle;
  sync_[0] = {.enabled = settings.sync0, .pending = true, .next = start, .step = cycle0};
  // SYNC1 follows every SYNC0 if it comes no later than the next SYNC0; else it follows every second, third...
  sync_[1] = {.enabled = settings.sync1,
              .pending = settings.sync1,
              .next = start + cycle1,
              .step = cycle0 == 0 ? 0 : cycle0 * (cycle1 / cycle0 + 1)};
  return plausible;
}

void DistributedClock::enable_sync(unsigned n, bool enabled, Time now) {
  Sync& sync = sync_[n];
  if (sync.enabled == enabled) return;
  sync.enabled = enabled;
  if (n == 0 || !started_) return;  // SYNC0 keeps running without output, because SYNC1 follows it
  sync.pending = enabled;
  next_known_ = false;
  const auto late = static_cast<std::int64_t>(system_time(now) - sync.next);
  if (!enabled || late < 0) return;
  if (sync.step == 0) {
    sync.pending = false;
  } else {
    sync.next += (static_cast<std::uint64_t>(late) / sync.step + 1) * sync.step;
  }
}

void DistributedClock::stop_sync() {
  sync_ = {};
  started_ = false;
  next_known_ = false;
}

bool DistributedClock::sync_level(unsigned n, Time now) const {
  const Sync& sync = sync_[n];
  if (sync.count == 0 || !sync.enabled) return false;
  return pulse_length_ == 0 ? sync.unacknowledged : system_time(now) - sync.last < pulse_length_;
}

unsigned DistributedClock::poll_sync(Time now) {
  if (now < next_sync(now)) return 0;
  next_known_ = false;
  unsigned fired = 0;
  for (unsigned n = 0; n < sync_.size(); ++n) {
    Sync& sync = sync_[n];
    if (!sync.pending) continue;
    const auto late = static_cast<std::int64_t>(system_time(now) - sync.next);
    if (late < 0) continue;
    // If the caller was late by several pulses, they are reported as one; `count` includes all of them.
    const std::uint64_t steps = sync.step == 0 ? 0 : static_cast<std::uint64_t>(late) / sync.step;
    sync.last = sync.next + steps * sync.step;
    sync.next = sync.last + sync.step;
    sync.count += static_cast<std::uint32_t>(steps) + 1;
    sync.pending = sync.step != 0;
    if (!sync.enabled) continue;
    sync.unacknowledged = true;
    fired |= 1U << n;
  }
  return fired;
}

void DistributedClock::find_next_sync(Time now) {
  Time next = never;
  for (const Sync& sync : sync_) {
    if (!sync.pending) continue;
    // A cycle of a few nanoseconds is a master's mistake: deadlines are at least `closest_deadlines` apart.
    const bool close = sync.count != 0 && static_cast<std::int64_t>(sync.next - sync.last - closest_deadlines) < 0;
    const std::uint64_t soonest = close ? sync.last + closest_deadlines : sync.next;
    next = std::min(next, when(soonest, now));
  }
  next_ = next;
  next_known_ = true;
}

}  // namespace servodrome::ethercat
