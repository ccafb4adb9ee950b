#include "axis/cyclic/ethercat_cyclic_bus.hpp"

#include <array>
#include <cstdlib>
#include <fmt/format.h>

#include "axis/cyclic/interpolation_time.hpp"
#include "axis/cyclic/lost_master.hpp"
#include "axis/cyclic/quick_stop.hpp"
#include "axis/standstill.hpp"

namespace servodrome::master {

namespace {

constexpr Time longest_stop = std::chrono::seconds(2);
// From writing an output until the inputs show its effect (master/ethercat/coe_objects.cpp).
constexpr int cycles_to_act = 4;

// Detects the standstill of a shaft by its position.
class Standstill {
 public:
  // Call it in each cycle. Returns true if the position has stayed the same for `span`, or is not in the process data.
  bool lasts(Time span, ProcessImage& image, Time now) {
    auto shown = image.input({0x6064, 0});
    if (!shown) shown = image.input({0x6063, 0});
    if (!shown) return true;
    const auto present = shown->get<std::int32_t>();
    if (!place_ || std::abs(std::int64_t{present} - *place_) > still_counts) {
      place_ = present;
      since_ = now;
    }
    return now - since_ >= span;
  }

 private:
  std::optional<std::int32_t> place_{};
  Time since_{};
};

}  // namespace

EthercatCyclicBus::EthercatCyclicBus(EthercatMaster& master, EthercatOperation& operation,
                                     const EthercatCyclicOptions& options)
    : master_(master), exchange_(operation.exchange()), options_(options), is_used_(exchange_.members().size(), false) {
  for (std::size_t i = 0; i < exchange_.members().size(); ++i) images_.push_back(exchange_.image(i));
}

EthercatCyclicBus::~EthercatCyclicBus() {
  if (!options_.stops_drives) return;
  try {
    stop_drives();
  } catch (...) {
    // The link is lost: each drive stops by the watchdog of its process data and 6007h.
  }
}

// Outputs act only in OP. A drive that has left it has stopped by 6007h.
bool EthercatCyclicBus::can_stop(std::size_t drive) const {
  return is_used_[drive] && exchange_.status(drive).state() == AlState::operational;
}

// Waits for the end of the ramp and of the closing of the brake. If a slave leaves OP before, its drive treats this as
// a loss of the master, and 6007h and 605Eh end the ramp. The state alone does not show the end: an iSMK shows the
// whole quick stop as Switch on disabled. A drive that stays in quick stop active (605Ah is 5 to 8) causes the longest
// wait.
void EthercatCyclicBus::stop_drives() {
  EthercatCyclicBus::on_cycle({});
  if (!exchange_.runs()) return;
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (can_stop(i)) request_quick_stop(images_[i]);
  }
  const Time end = master_.now() + longest_stop + options_.brake_delay;
  master_.wait(cycles_to_act * exchange_.period());
  std::vector<Standstill> shafts(images_.size());
  const auto all_have_stopped = [&] {
    bool all = true;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      if (!can_stop(i) || !commands_quick_stop(images_[i])) continue;
      const bool stands = shafts[i].lasts(still_time + options_.brake_delay, images_[i], master_.now());
      const auto state = shown_state(images_[i]);
      const bool operates = state == PowerState::operation_enabled || state == PowerState::quick_stop_active;
      if (operates || !stands) all = false;
    }
    return all;
  };
  while (!all_have_stopped() && master_.now() < end) master_.wait(exchange_.period());
}

CycleCounters EthercatCyclicBus::counters() const {
  const CyclicStatistics& statistics = exchange_.statistics();
  return {.cycles = statistics.cycles,
          .missed = statistics.lost + statistics.late + statistics.wrong_counters,
          .skipped = statistics.skipped,
          .longest_miss = statistics.longest_loss,
          .worst_lateness = statistics.worst_lateness};
}

namespace {

constexpr std::array<std::uint16_t, 5> outputs{0x6040, 0x6060, 0x607A, 0x60FF, 0x6071};
constexpr std::array<std::uint16_t, 8> inputs{0x6041, 0x6061, 0x6064, 0x606C, 0x6077, 0x60F4, 0x603F, 0x60FD};
constexpr std::array<std::uint16_t, 1> probe_outputs{0x60B8};
constexpr std::array<std::uint16_t, 3> probe_inputs{0x60B9, 0x60BA, 0x60BB};

// True if the slave's object dictionary allows the mapping. Also true for a slave without SDO information: it is
// assumed to map every object that it has.
bool can_map(EthercatSlave& slave, std::uint16_t index, std::uint16_t direction) {
  try {
    return (slave.coe().describe(ObjectAddress{index, 0}).access & direction) != 0;
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw;
    return true;
  }
}

// Adds only the objects that the slave has and can map, because a slave refuses the whole mapping for one wrong object.
// The length is that of the uploaded value.
void add_those_there_are(EthercatSlave& slave, std::span<const std::uint16_t> wanted, std::uint16_t direction,
                         Pdo& pdo) {
  for (const std::uint16_t index : wanted) {
    try {
      const std::size_t bytes = slave.coe().upload({index, 0}).size();
      if (!can_map(slave, index, direction)) continue;
      pdo.entries.push_back({.object = {index, 0}, .bits = static_cast<std::uint8_t>(8 * bytes)});
    } catch (const CoeError& error) {
      if (!error.from_slave()) throw;
    }
  }
}

void set_interpolation_time(EthercatSlave& slave, Time period) {
  try {
    slave.coe().read<std::uint8_t>(0x60C2, 1);
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw;
    return;
  }
  const auto time = interpolation_time_of(period);
  if (!time) {
    throw EthercatError(EthercatError::Kind::unsupported,
                        fmt::format("a period of {} us cannot be written to 60C2h", period.count() / 1000),
                        slave.where(), periods_that_can_be_written);
  }
  slave.coe().write<std::uint8_t>(0x60C2, 1, time->value);
  slave.coe().write<std::int8_t>(0x60C2, 2, time->index);
}

}  // namespace

void set_up_cyclic_axis(EthercatSlave& slave, const EthercatAxisSetUp& set_up) {
  Pdo rx{.index = 0x1600};
  Pdo tx{.index = 0x1A00};
  add_those_there_are(slave, outputs, entry_access::rx_pdo, rx);
  add_those_there_are(slave, inputs, entry_access::tx_pdo, tx);
  if (set_up.touch_probe) {
    add_those_there_are(slave, probe_outputs, entry_access::rx_pdo, rx);
    add_those_there_are(slave, probe_inputs, entry_access::tx_pdo, tx);
  }
  map_pdo(slave.coe(), rx);
  map_pdo(slave.coe(), tx);
  assign_pdos(slave.coe(), rx_assignment, std::array{rx.index});
  assign_pdos(slave.coe(), tx_assignment, std::array{tx.index});
  if (set_up.period) set_interpolation_time(slave, *set_up.period);
  react_to_lost_master(slave);
}

}  // namespace servodrome::master
