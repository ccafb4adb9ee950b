#pragma once

#include "host/ethercat/scan.hpp"

namespace servodrome::host {

struct ClockOptions {
  // How often the propagation is measured; the mean counts.
  unsigned measurements = 8;
  // Frames with the reference's time that are sent as fast as they come back, so that the clocks run together before
  // they are used (ETG.1020: 15000 and more).
  unsigned drift_frames = 15000;
  // System time of the reference at the start, ns since 2000-01-01 0:00; nothing: its own time since power-on.
  std::optional<std::uint64_t> epoch{};
};

// A slave's SYNC pulses.
struct SyncPulses {
  std::uint32_t sync0_cycle_ns = 0;
  std::uint32_t sync1_cycle_ns = 0;        // from a SYNC0 to its SYNC1
  std::int32_t shift_ns = 0;               // of SYNC0 from the common start
  std::uint16_t assign_activate = 0x0300;  // 0980h and 0981h, as a DC mode of the SII or the ESI has it
};

// The distributed clocks of the slaves of a line (ETG.1000.4 clause 6.7, ETG.1020 clause 23): the first slave with a
// clock is the reference. Slaves in line only: delays of branches (ports 2 and 3) are not known, and refused.
class DistributedClocks {
 public:
  // In the order of the line; slaves without a clock are left out.
  DistributedClocks(EthercatMaster& master, std::span<const FoundSlave> slaves);

  bool any() const { return !clocks_.empty(); }
  std::size_t count() const { return clocks_.size(); }
  std::uint16_t reference() const { return clocks_.front().station; }

  // Latches the receive times, sets propagation delays and offsets, resets the drift compensation and settles it.
  void start(const ClockOptions& options = {});
  // One frame with the reference's time.
  void distribute();

  // The reference's system time.
  std::uint64_t time();
  // ns from the reference to the slave, as set.
  std::uint32_t delay_ns(std::uint16_t station) const;
  // 092Ch: how far the slave's clock is from what the reference's time said, ns, its own clock ahead positive.
  std::int64_t difference_ns(std::uint16_t station);

  // A time in the future at which all SYNC0 of this cycle can begin: a multiple of it.
  std::uint64_t common_start(std::uint32_t cycle_ns, Time margin = std::chrono::milliseconds(100));
  void start_sync(std::uint16_t station, std::uint64_t common_start, const SyncPulses& pulses);
  void stop_sync(std::uint16_t station);

 private:
  struct Clock {
    std::uint16_t station = 0;
    std::int64_t behind_sum = 0;  // of the measurements: ns between the frame at ports 0 and 1
    std::int64_t delay = 0;       // ns from the reference
    std::uint64_t local = 0;      // when it processed the last latching frame
  };
  void latch();

  EthercatMaster& master_;
  std::vector<Clock> clocks_;
};

}  // namespace servodrome::host
