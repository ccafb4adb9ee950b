// Sampling by TPDOs on SYNC, if no other master uses the bus.
#include <fmt/format.h>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "tools/sampling/can_process_data.hpp"
#include "tools/sampling/process_data_sampler.hpp"

namespace servodrome::master::sampling {

namespace {

using namespace std::chrono_literals;

constexpr Time usual_sync_period = 4ms;

// Returns how another master is known to use the node's process data; nullopt: there is no sign of one.
std::optional<std::string> use_by_others(Bus& bus, SdoClient& sdo) {
  std::optional<UseOfPdos> seen;
  const std::uint8_t node = sdo.node_id();
  const auto listening = bus.listen([&](const Frame& frame) {
    const auto use = use_of_pdos(frame);
    if (use && (use->by == UseOfPdos::By::sync || use->node_id == node)) seen = use;
  });
  const auto heartbeat = std::chrono::milliseconds(sdo.read_if_present<std::uint16_t>(0x1017).value_or(0));
  bus.run_until(bus.now() + time_to_listen(heartbeat), [&] { return seen.has_value(); });
  if (!seen) return std::nullopt;
  switch (seen->by) {
    case UseOfPdos::By::sync: return "another master sends SYNC";
    case UseOfPdos::By::pdo: return "the drive's PDOs are in use";
    case UseOfPdos::By::operational: return "the drive is operational";
  }
  return std::nullopt;
}

class CanSession final : public ProcessDataSession {
 public:
  CanSession(Bus& bus, SdoClient& sdo, const std::vector<Channel>& channels, Time period)
      : sdo_(sdo),
        bus_(bus, {{.node_id = sdo.node_id(), .tpdos = pack_into_pdos(channels), .sets_interpolation_time = false}},
             {.period = period, .tolerated_losses = 250, .waits_whole_period = true, .stops_drives = false}) {}

  CyclicBus& bus() override { return bus_; }
  ObjectClient& objects() override { return sdo_; }
  void close() override { bus_.close(); }

 private:
  SdoClient& sdo_;
  CanCyclicBus bus_;
};

}  // namespace

std::unique_ptr<Sampler> open_can_sampler(Bus& bus, SdoClient& sdo, std::vector<Channel> channels,
                                          const SamplerOptions& options) {
  std::string reason;
  if (!options.polls) {
    if (options.period && *options.period < shortest_sync_period) {
      throw MasterError("a CAN bus can be sampled up to 1000 times per second", sdo.where(), "give a lower rate");
    }
    if (const auto used = use_by_others(bus, sdo)) {
      reason = fmt::format("the channels are read by SDO, in order not to disturb another master: {}", *used);
    } else {
      try {
        const auto [cycle, cycles] = cycles_of(options.period.value_or(usual_sync_period), longest_sync_period);
        return make_process_data_sampler(std::make_unique<CanSession>(bus, sdo, channels, cycle), channels, cycles,
                                         "TPDOs on SYNC");
      } catch (const MasterError& error) {
        reason =
            fmt::format("the channels are read by SDO, because their TPDOs could not be set up: {}", error.happened());
      }
    }
  }
  auto sampler = open_polled_sampler(sdo, std::move(channels), options, "SDO");
  sampler->set_remark(std::move(reason));
  return sampler;
}

}  // namespace servodrome::master::sampling
