#include "master/ethercat/operation.hpp"

#include <algorithm>
#include <cstdlib>

namespace servodrome::master {

namespace {

constexpr std::uint16_t sync0_bits = 0x0300;  // in assign activate: the cyclic unit and SYNC0

// The slave's DC mode with SYNC0; nullopt if it has none.
std::optional<SiiDcMode> dc_mode_of(const FoundSlave& slave) {
  if (!slave.has_clock()) return std::nullopt;
  for (const SiiDcMode& mode : slave.sii.dc_modes) {
    if ((mode.assign_activate & sync0_bits) == sync0_bits) return mode;
  }
  return std::nullopt;
}

// The cycle of SYNC0 in ns (ETG.2000, CycleTimeSync0): the cycle of the DC mode, or, if that is 0, the master's cycle
// times the factor; a negative factor divides.
std::uint32_t sync0_cycle_of(const SiiDcMode& mode, std::uint32_t cycle) {
  if (mode.sync0_cycle_ns != 0) return mode.sync0_cycle_ns;
  const auto factor = static_cast<std::uint32_t>(std::max(std::abs(int{mode.sync0_factor}), 1));
  return mode.sync0_factor < 0 ? cycle / factor : cycle * factor;
}

void write_if_possible(EthercatSlave& slave, std::uint16_t index, std::uint8_t sub, std::uint16_t value) {
  if (!slave.has_coe()) return;
  try {
    slave.coe().write<std::uint16_t>(index, sub, value);
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw;
  }
}

}  // namespace

// Synchronisation types of 1C32h and 1C33h (ETG.1020 table 72).
void set_synchronisation(EthercatSlave& slave, bool sync0) {
  constexpr std::uint16_t free_run = 0;
  constexpr std::uint16_t sync_manager_event = 1;
  constexpr std::uint16_t sync0_event = 2;
  constexpr std::uint16_t input_follows_outputs = 0x22;  // 1C33h: with the event of sync manager 2
  if (!slave.has_coe()) return;
  std::uint16_t supported = 0;
  try {
    supported = slave.coe().read<std::uint16_t>(0x1C32, 4);
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw;
    return;
  }
  const std::uint16_t type = sync0 ? sync0_event : (supported & 1) != 0 ? free_run : sync_manager_event;
  write_if_possible(slave, 0x1C32, 1, type);
  write_if_possible(slave, 0x1C33, 1, type == sync_manager_event ? input_follows_outputs : type);
}

EthercatOperation::EthercatOperation(EthercatMaster& master, std::span<const FoundSlave> line,
                                     std::span<EthercatSlave* const> slaves, const OperationOptions& options)
    : master_(master), slaves_(slaves.begin(), slaves.end()) {
  std::vector<CyclicExchange::Member> members;
  for (EthercatSlave* slave : slaves_) {
    slave->to_pre_operational();
    // Switches off SYNC pulses that an earlier master has set up, because they are active regardless of 1C32h.
    if (slave->found().has_clock()) master_.write<std::uint8_t>(slave->station(), ethercat::reg::sync_activation, 0);
    const bool sync0 = options.distributed_clocks && dc_mode_of(slave->found()).has_value();
    set_synchronisation(*slave, sync0);
    if (sync0 && options.sync_error_limit) {
      write_if_possible(*slave, 0x10F1, 2, *options.sync_error_limit);
    }
    members.push_back({slave, read_process_data(*slave)});
  }
  exchange_.emplace(master_, std::move(members), options.cyclic);
  take_present_values();
  if (options.distributed_clocks) start_clocks(line, options);
  exchange_->to_safe_operational();
  if (options.inputs_only) {
    exchange_->start();
  } else {
    exchange_->to_operational();
  }
}

EthercatOperation::~EthercatOperation() {
  // All slaves leave OP while the cycle still runs. If they left OP one after the other without the cycle, the
  // watchdogs of the last ones could expire first.
  try {
    exchange_->to_pre_operational();
  } catch (const MasterError&) {
    // The loop below requests the state from each slave separately.
  }
  exchange_->stop();
  for (EthercatSlave* slave : slaves_) {
    try {
      slave->request(AlState::pre_operational);
      if (clocks_ && dc_mode_of(slave->found())) clocks_->stop_sync(slave->station());
    } catch (const MasterError&) {
      // The slave does not answer any more; there is nothing to undo.
    }
  }
}

// Sets the outputs to the present values of the objects; otherwise the first frame would set modes and targets to 0.
// The controlword starts with 0, which does not enable the axis.
void EthercatOperation::take_present_values() {
  constexpr std::uint16_t controlword = 0x6040;
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    if (!slaves_[i]->has_coe()) continue;
    for (const Pdo& pdo : exchange_->members()[i].data.outputs) {
      for (const PdoEntry& entry : pdo.entries) {
        auto object = exchange_->output(i, entry.object);
        if (!object || entry.object.index == controlword) continue;
        try {
          const std::vector<std::byte> bytes = slaves_[i]->coe().upload(entry.object);
          std::uint64_t value = 0;
          std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
          object->set_raw(value);
        } catch (const CoeError& error) {
          if (!error.from_slave()) throw;
          // The object is write-only or a dummy; its output stays 0.
        }
      }
    }
  }
}

void EthercatOperation::start_clocks(std::span<const FoundSlave> line, const OperationOptions& options) {
  clocks_.emplace(master_, line);
  if (!clocks_->any()) {
    clocks_.reset();
    return;
  }
  clocks_->start(options.clock);
  const auto cycle = static_cast<std::uint32_t>(options.cyclic.period.count());
  sync0_start_ = clocks_->common_start(cycle);
  std::uint32_t shortest = cycle;
  for (const EthercatSlave* slave : slaves_) {
    const auto mode = dc_mode_of(slave->found());
    if (!mode) continue;
    const std::uint32_t sync0_cycle = sync0_cycle_of(*mode, cycle);
    shortest = std::min(shortest, sync0_cycle);
    clocks_->start_sync(slave->station(), sync0_start_,
                        {.sync0_cycle_ns = sync0_cycle,
                         .shift_ns = static_cast<std::int32_t>(options.sync0_shift.count()) + mode->sync0_shift_ns,
                         .assign_activate = mode->assign_activate});
  }
  const Time before = options.before_sync0.value_or(Time{shortest} / 2);
  exchange_->follow_clock(clocks_->reference(), sync0_start_ + static_cast<std::uint64_t>(options.sync0_shift.count()),
                          before);
}

std::size_t EthercatOperation::member_of(const EthercatSlave& slave) const {
  return static_cast<std::size_t>(std::find(slaves_.begin(), slaves_.end(), &slave) - slaves_.begin());
}

}  // namespace servodrome::master
