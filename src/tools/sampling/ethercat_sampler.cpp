// Sampling by the inputs of the EtherCAT cycle, if no other master uses the slave.
#include <algorithm>
#include <fmt/format.h>

#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/lost_master.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "tools/sampling/process_data_sampler.hpp"

namespace servodrome::master::sampling {

namespace {

using namespace std::chrono_literals;
using ethercat::AlState;

constexpr Time usual_cycle = 2ms;
constexpr Time shortest_cycle = 250us;
constexpr Time longest_cycle = 10ms;  // outputs have a watchdog, usually of 100 ms

constexpr std::uint16_t first_tx_pdo = 0x1A00;
constexpr std::size_t entries_of_every_slave = 8;  // entries that every slave's PDO has, with a margin

// Saves and restores mapping and assignment.
class InputMapping {
 public:
  explicit InputMapping(CoeClient& coe) : coe_(coe) {}

  // Throws CoeError if the slave refuses; put_back() must then restore the changes made so far.
  void replace(std::span<const Channel> channels) {
    assigned_ = slots(tx_assignment, 0);
    std::vector<std::uint16_t> pdos;
    for (std::size_t first = 0; first < channels.size(); first += entries_of_every_slave) {
      Pdo pdo{.index = static_cast<std::uint16_t>(first_tx_pdo + pdos.size())};
      const std::size_t end = std::min(channels.size(), first + entries_of_every_slave);
      for (std::size_t i = first; i < end; ++i) {
        pdo.entries.push_back({.object = channels[i].object, .bits = static_cast<std::uint8_t>(channels[i].bits)});
      }
      mapped_.push_back({pdo.index, slots(pdo.index, pdo.entries.size())});
      map_pdo(coe_, pdo);
      pdos.push_back(pdo.index);
    }
    assign_pdos(coe_, tx_assignment, pdos);
  }

  void put_back() {
    for (; !mapped_.empty(); mapped_.pop_back()) write(mapped_.back().first, mapped_.back().second);
    if (assigned_) write(tx_assignment, *assigned_);
    assigned_.reset();
  }

 private:
  struct Slots {
    std::uint8_t count = 0;            // sub 0
    std::vector<std::uint32_t> words;  // from sub 1; includes sub-indices beyond `count`, if they can be read
  };

  // Unused slots may have values of their own (FFFFFFFFh with JMC), which are saved too.
  Slots slots(std::uint16_t index, std::size_t at_least) {
    Slots found{.count = coe_.read<std::uint8_t>(index, 0), .words = {}};
    for (std::size_t sub = 1; sub <= std::max<std::size_t>(found.count, at_least); ++sub) {
      try {
        found.words.push_back(coe_.read<std::uint32_t>(index, static_cast<std::uint8_t>(sub)));
      } catch (const CoeError& error) {
        if (!error.from_slave() || sub <= found.count) throw;
        break;
      }
    }
    return found;
  }

  void write(std::uint16_t index, const Slots& slots) {
    coe_.write<std::uint8_t>(index, 0, 0);
    for (std::size_t i = 0; i < slots.words.size(); ++i) {
      const auto sub = static_cast<std::uint8_t>(i + 1);
      try {
        if (index == tx_assignment) {
          coe_.write<std::uint16_t>(index, sub, static_cast<std::uint16_t>(slots.words[i]));
        } else {
          coe_.write<std::uint32_t>(index, sub, slots.words[i]);
        }
      } catch (const CoeError& error) {
        // Values beyond the count have no effect, so a refusal is ignored.
        if (!error.from_slave() || i < slots.count) throw;
      }
    }
    coe_.write<std::uint8_t>(index, 0, slots.count);
  }

  CoeClient& coe_;
  std::optional<Slots> assigned_;
  std::vector<std::pair<std::uint16_t, Slots>> mapped_;
};

// Brings a slave to OP or SAFEOP. Maps `channels` as inputs, unless all of them are mapped already. The destructor
// restores the mapping and leaves the slave in PREOP.
class EthercatSession final : public ProcessDataSession {
 public:
  EthercatSession(EthercatMaster& master, std::span<const FoundSlave> line, EthercatSlave& slave,
                  std::span<const Channel> channels, Time cycle, const SamplerOptions& options)
      : slave_(slave), mapping_(slave.coe()) {
    try {
      slave_.to_pre_operational();
      const ProcessData present = read_process_data(slave_);
      const auto is_mapped = [&](const Channel& channel) {
        return find_mapped(present.inputs, channel.object).has_value();
      };
      if (!std::all_of(channels.begin(), channels.end(), is_mapped)) mapping_.replace(channels);
      if (options.moves) reaction_.emplace(slave_);
      EthercatSlave* const slaves[] = {&slave_};
      // Under load a frame may take longer than a cycle. A late frame does not end the recording; lost cycles are
      // counted.
      operation_.emplace(master, line, slaves,
                         OperationOptions{.cyclic = {.period = cycle, .tolerated_losses = 250},
                                          .distributed_clocks = options.distributed_clocks,
                                          .sync_error_limit = std::uint16_t{0},
                                          .inputs_only = !options.moves});
      bus_.emplace(master, *operation_, EthercatCyclicOptions{.stops_drives = false});
      objects_.emplace(slave_, operation_->exchange(), 0);
    } catch (const MasterError&) {
      close_quietly();
      throw;
    }
  }
  ~EthercatSession() override { close_quietly(); }

  CyclicBus& bus() override { return *bus_; }
  ObjectClient& objects() override { return *objects_; }
  // Leaves the slave in PREOP.
  void close() override {
    operation_.reset();
    reaction_.reset();
    mapping_.put_back();
  }

 private:
  void close_quietly() {
    try {
      close();
    } catch (const MasterError&) {
      // The slave does not answer any more, or an earlier error is reported.
    }
  }

  EthercatSlave& slave_;
  InputMapping mapping_;
  std::optional<LostMasterReaction> reaction_;
  std::optional<EthercatOperation> operation_;
  std::optional<EthercatCyclicBus> bus_;
  std::optional<CoeObjects> objects_;
};

// Access by mailbox only, in any state of the slave.
class MailboxSession final : public Session {
 public:
  explicit MailboxSession(EthercatSlave& slave) : objects_(slave) {}
  ObjectClient& objects() override { return objects_; }

 private:
  CoeObjects objects_;
};

}  // namespace

std::unique_ptr<Sampler> open_ethercat_sampler(EthercatMaster& master, std::span<const FoundSlave> line,
                                               EthercatSlave& slave, std::vector<Channel> channels,
                                               const SamplerOptions& options) {
  const AlState state = slave.status().state();
  const bool is_used = state == AlState::operational || state == AlState::safe_operational;
  if (is_used && options.moves) {
    throw MasterError("it is in SAFEOP or OP already: another master has it", slave.where(),
                      "leave the motion to that master, and record without it");
  }
  std::string reason;
  if (is_used) {
    reason = "the channels are read by SDO, in order not to disturb another master: the slave is in SAFEOP or OP";
  }
  if (!is_used && !options.polls) {
    if (options.period && *options.period < shortest_cycle) {
      throw MasterError("EtherCAT can be sampled up to 4000 times per second", slave.where(), "give a lower rate");
    }
    const auto [cycle, cycles] = cycles_of(options.period.value_or(usual_cycle), longest_cycle);
    try {
      auto session = std::make_unique<EthercatSession>(master, line, slave, channels, cycle, options);
      return make_process_data_sampler(std::move(session), channels, cycles,
                                       options.moves ? "process data in OP" : "process data in SAFEOP");
    } catch (const CoeError& error) {
      if (!error.from_slave()) throw;
      reason =
          fmt::format("the channels are read by SDO, because they cannot be mapped as process data: {}", error.what());
    }
  }
  std::unique_ptr<Session> session;
  if (options.moves) {
    session = std::make_unique<EthercatSession>(master, line, slave, std::span<const Channel>{}, usual_cycle, options);
  } else {
    session = std::make_unique<MailboxSession>(slave);
  }
  auto sampler = make_polled_sampler(std::move(session), std::move(channels), options.period.value_or(Time{0}), "SDO");
  sampler->set_remark(std::move(reason));
  return sampler;
}

}  // namespace servodrome::master::sampling
