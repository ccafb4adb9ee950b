// Sampling by TPDOs on SYNC, if no other master uses the bus.
#include <algorithm>
#include <fmt/format.h>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "tools/scope/process_data_sampler.hpp"

namespace servodrome::master::scope {

namespace {

using namespace std::chrono_literals;

constexpr Time usual_sync_period = 4ms;
constexpr Time shortest_sync_period = 1ms;
constexpr Time longest_sync_period = 20ms;
// Time to listen for another master. If there is one, it sends SYNC or PDOs, or has started the node.
constexpr Time shortest_listening = 150ms;
constexpr Time longest_listening = 3s;

constexpr std::size_t pdo_bytes = 8;
constexpr std::size_t entries_of_every_drive = 4;  // entries that every drive's PDO has; ProNet has the fewest

// First-fit packing into few PDOs.
std::vector<std::vector<PdoObject>> pack_into_pdos(const std::vector<Channel>& channels) {
  std::vector<std::vector<PdoObject>> pdos;
  const auto bits = [](const std::vector<PdoObject>& pdo) {
    unsigned sum = 0;
    for (const PdoObject& object : pdo) sum += object.bits;
    return sum;
  };
  for (const Channel& channel : channels) {
    const auto fits = [&](const std::vector<PdoObject>& pdo) {
      return pdo.size() < entries_of_every_drive && bits(pdo) + channel.bits <= 8 * pdo_bytes;
    };
    auto room = std::find_if(pdos.begin(), pdos.end(), fits);
    if (room == pdos.end()) room = pdos.emplace(pdos.end());
    room->push_back({channel.object, static_cast<std::uint8_t>(channel.bits)});
  }
  return pdos;
}

// Returns how another master is known to use the node's process data; nullopt: there is no sign of one.
std::optional<std::string> use_by_others(Bus& bus, SdoClient& sdo) {
  constexpr std::uint32_t sync_id = 0x080;
  constexpr std::uint32_t first_pdo = 0x180;
  constexpr std::uint32_t after_pdos = 0x580;
  std::optional<std::string> seen;
  const std::uint8_t node = sdo.node_id();
  const auto listening = bus.listen([&](const Frame& frame) {
    if (frame.extended || frame.remote) return;
    if (frame.id == sync_id) seen = "another master sends SYNC";
    if (frame.id >= first_pdo && frame.id < after_pdos && (frame.id & 0x7F) == node) seen = "its PDOs are in use";
    if (frame.id == 0x700U + node && frame.length == 1 && (frame.data[0] & 0x7F) == 5) seen = "it is operational";
  });
  const auto heartbeat = std::chrono::milliseconds(sdo.read_if_present<std::uint16_t>(0x1017).value_or(0));
  const Time span = std::clamp<Time>(2 * heartbeat, shortest_listening, longest_listening);
  bus.run_until(bus.now() + span, [&] { return seen.has_value(); });
  return seen;
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
      reason = fmt::format("read by SDO, in order not to disturb another master: {}", *used);
    } else {
      try {
        const auto [cycle, cycles] = cycles_of(options.period.value_or(usual_sync_period), longest_sync_period);
        return make_process_data_sampler(std::make_unique<CanSession>(bus, sdo, channels, cycle), channels, cycles,
                                         "TPDOs on SYNC");
      } catch (const MasterError& error) {
        reason = fmt::format("read by SDO, because they cannot be mapped into TPDOs: {}", error.happened());
      }
    }
  }
  auto sampler = open_polled_sampler(sdo, std::move(channels), options, "SDO");
  sampler->set_remark(std::move(reason));
  return sampler;
}

}  // namespace servodrome::master::scope
