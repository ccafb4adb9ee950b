#pragma once

#include "master/ethercat/scan.hpp"

namespace servodrome::master {

struct ClockOptions {
  // Number of measurements of the propagation delays, which are averaged.
  unsigned measurements = 8;
  // Number of frames with the reference's time that are sent back to back before the clocks are used, so that they
  // settle (ETG.1020: 15000 and more).
  unsigned drift_frames = 15000;
  // System time of the reference at the start, ns since 2000-01-01 0:00; nullopt: its own time since power-on.
  std::optional<std::uint64_t> epoch{};
};

// Settings of a slave's SYNC pulses.
struct SyncPulses {
  std::uint32_t sync0_cycle_ns = 0;
  std::uint32_t sync1_cycle_ns = 0;        // from a SYNC0 to its SYNC1
  std::int32_t shift_ns = 0;               // of SYNC0 against the common start
  std::uint16_t assign_activate = 0x0300;  // for 0980h and 0981h, from a DC mode of the SII or ESI
};

// Distributed clocks of the slaves of a line (ETG.1000.4 clause 6.7, ETG.1020 clause 23). The first slave with a clock
// is the reference. Supports a line only: a segment with branches (ports 2 and 3) is refused, because their delays are
// not measured.
class DistributedClocks {
 public:
  // `slaves` in the order of the line; slaves without a clock are ignored.
  DistributedClocks(EthercatMaster& master, std::span<const FoundSlave> slaves);

  bool any() const { return !clocks_.empty(); }
  std::size_t count() const { return clocks_.size(); }
  std::uint16_t reference() const { return clocks_.front().station; }

  // Latches the receive times, sets propagation delays and offsets, resets the drift compensation and lets the clocks
  // settle.
  void start(const ClockOptions& options = {});
  // Sends one frame with the reference's time.
  void distribute();

  // The reference's system time.
  std::uint64_t time();
  // Propagation delay from the reference to the slave in ns, as set by start().
  std::uint32_t delay_ns(std::uint16_t station) const;
  // 092Ch: deviation of the slave's clock from the received time of the reference, in ns; positive: it is ahead.
  std::int64_t difference_ns(std::uint16_t station);

  // A future time, at least `margin` ahead, at which SYNC0 of all slaves can start: a multiple of the cycle.
  std::uint64_t common_start(std::uint32_t cycle_ns, Time margin = std::chrono::milliseconds(100));
  void start_sync(std::uint16_t station, std::uint64_t common_start, const SyncPulses& pulses);
  void stop_sync(std::uint16_t station);

 private:
  struct Clock {
    std::uint16_t station = 0;
    std::int64_t behind_sum = 0;  // sum over the measurements: ns between the frame at ports 0 and 1
    std::int64_t delay = 0;       // propagation delay from the reference, ns
    std::uint64_t local = 0;      // local time at which it processed the last latching frame
  };
  void latch();

  EthercatMaster& master_;
  std::vector<Clock> clocks_;
};

}  // namespace servodrome::master
