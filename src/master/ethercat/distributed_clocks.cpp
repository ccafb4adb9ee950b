#include "master/ethercat/distributed_clocks.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::Command;
using ethercat::load;
using ethercat::load_u32;

namespace {

constexpr std::uint16_t speed_counter_default = 0x1000;
constexpr std::uint8_t sync_enable = 0x01;

}  // namespace

DistributedClocks::DistributedClocks(EthercatMaster& master, std::span<const FoundSlave> slaves) : master_(master) {
  for (const FoundSlave& slave : slaves) {
    if (!slave.has_clock()) continue;
    if (slave.link(2) || slave.link(3)) {
      throw EthercatError(
          EthercatError::Kind::unsupported,
          fmt::format("slave {} has branches at ports 2 or 3, whose delays are not measured", slave.position),
          master.name(), "leave distributed clocks off, or put the slaves into one line");
    }
    clocks_.push_back({.station = slave.station});
  }
}

// Reads the receive times at the ports, which one broadcast frame latches in all slaves (ETG.1000.4 clause 6.7.1.2).
void DistributedClocks::latch() {
  const std::array<std::uint8_t, 4> any{};
  master_.write_all(reg::receive_time_port, any);
  for (Clock& clock : clocks_) {
    std::array<std::uint8_t, 32> times{};
    master_.read(clock.station, reg::receive_time_port, times);
    // The receive time of a port is valid only if a slave follows there.
    const auto dl_status = master_.read<std::uint16_t>(clock.station, reg::dl_status);
    const bool continues = (dl_status & 0x0020) != 0;  // link at port 1
    // The receive times wrap around at 32 bits.
    const std::uint32_t behind = load_u32(&times[4]) - load_u32(times.data());
    clock.behind_sum += continues ? static_cast<std::int32_t>(behind) : 0;
    constexpr std::size_t processing_unit = reg::receive_time_processing_unit - reg::receive_time_port;
    clock.local = load<std::uint64_t>(&times[processing_unit]);
  }
}

void DistributedClocks::start(const ClockOptions& options) {
  if (clocks_.empty()) return;
  for (Clock& clock : clocks_) {
    clock.behind_sum = 0;
    // Writing the start value also resets the drift compensation.
    const auto start = master_.read<std::uint16_t>(clock.station, reg::speed_counter_start);
    master_.write<std::uint16_t>(clock.station, reg::speed_counter_start, start != 0 ? start : speed_counter_default);
  }
  const unsigned measurements = std::max(options.measurements, 1U);
  for (unsigned i = 0; i < measurements; ++i) latch();

  // A frame takes the same time between two slaves in both directions. So the delay of a slave is half the difference
  // between the round-trip times behind the reference and behind this slave (ETG.1000.4 clause 6.7.1.3).
  const auto divisor = 2 * static_cast<std::int64_t>(measurements);
  const Clock& reference = clocks_.front();
  const std::uint64_t epoch = options.epoch.value_or(reference.local);
  for (Clock& clock : clocks_) {
    const std::int64_t difference = reference.behind_sum - clock.behind_sum;
    clock.delay = std::max<std::int64_t>((difference + divisor / 2) / divisor, 0);
    // The reference received the latching frame `delay` earlier than this slave.
    const std::uint64_t offset = epoch - clock.local + static_cast<std::uint64_t>(clock.delay);
    master_.write<std::uint64_t>(clock.station, reg::system_time_offset, offset);
    master_.write<std::uint32_t>(clock.station, reg::system_time_delay, static_cast<std::uint32_t>(clock.delay));
  }
  for (unsigned i = 0; i < options.drift_frames; ++i) distribute();
}

void DistributedClocks::distribute() {
  std::array<std::uint8_t, 8> bytes{};
  EthercatDatagram datagram{
      .command = Command::frmw, .address = ethercat::address_of(reference(), reg::system_time), .data = bytes};
  master_.exchange(datagram);
}

std::uint64_t DistributedClocks::time() { return master_.read<std::uint64_t>(reference(), reg::system_time); }

std::uint32_t DistributedClocks::delay_ns(std::uint16_t station) const {
  for (const Clock& clock : clocks_) {
    if (clock.station == station) return static_cast<std::uint32_t>(clock.delay);
  }
  return 0;
}

std::int64_t DistributedClocks::difference_ns(std::uint16_t station) {
  const auto bits = master_.read<std::uint32_t>(station, reg::system_time_difference);
  const auto amount = static_cast<std::int64_t>(bits & 0x7FFFFFFF);
  return (bits & 0x80000000U) != 0 ? amount : -amount;
}

std::uint64_t DistributedClocks::common_start(std::uint32_t cycle_ns, Time margin) {
  const std::uint64_t cycle = std::max<std::uint64_t>(cycle_ns, 1);
  const std::uint64_t earliest = time() + static_cast<std::uint64_t>(margin.count());
  return (earliest / cycle + 1) * cycle;
}

void DistributedClocks::stop_sync(std::uint16_t station) {
  master_.write<std::uint8_t>(station, reg::sync_activation, 0);
}

void DistributedClocks::start_sync(std::uint16_t station, std::uint64_t common_start, const SyncPulses& pulses) {
  stop_sync(station);
  master_.write<std::uint8_t>(station, reg::cyclic_unit_control, static_cast<std::uint8_t>(pulses.assign_activate));
  master_.write<std::uint32_t>(station, reg::sync0_cycle, pulses.sync0_cycle_ns);
  master_.write<std::uint32_t>(station, reg::sync1_cycle, pulses.sync1_cycle_ns);
  master_.write<std::uint64_t>(station, reg::sync_start_time,
                               common_start + static_cast<std::uint64_t>(std::int64_t{pulses.shift_ns}));
  master_.write<std::uint8_t>(station, reg::sync_activation,
                              static_cast<std::uint8_t>(pulses.assign_activate >> 8 | sync_enable));
  constexpr std::uint8_t start_time_implausible = 0x04;
  if ((master_.read<std::uint8_t>(station, reg::sync_activation_status) & start_time_implausible) != 0) {
    throw EthercatError(EthercatError::Kind::refused, "SYNC0 does not start: its start time has passed",
                        slave_text(master_, station), "this computer is too slow or too busy; try again");
  }
}

}  // namespace servodrome::master
