#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "canopen/node.hpp"
#include "ethercat/slave/slave.hpp"
#include "watch_terms.hpp"

// Checks how registers and frames show faults, and the energy balance at the end of a sequence.
namespace servodrome::motion {

void Watch::error_registers() {
  dictionary::Dictionary& objects = axis_.device().bus_dictionary();
  const bool failed = one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
  const bool warned = (objects_.statusword & drive::statusword::warning) != 0;
  canopen::Node* node = axis_.device().can_node();
  const bool apart = node != nullptr && (node->communication_error() || tick_ - nmt_since_ < ms(20));
  const bool alone = !failed && !warned && !apart && objects_.error_code == 0 && !drive_.any_fault() && node != nullptr;
  if (!alone || (tick_ % ms(1) == 0 && communication_register() == 0)) register_since_ = tick_;
  if (tick_ - register_since_ > ms(20) && communication_register() != 0) {
    return fail("register-without-error",
                fmt::format("1001h is {:02X}h in {}", communication_register(), drive::name(state_)));
  }
  if (const ethercat::Slave* slave = axis_.device().ethercat_slave()) {
    if (slave->error() != (slave->status_code() != ethercat::AlStatusCode::none)) {
      return fail("al-status",
                  fmt::format("error {}, code {:04X}h", slave->error(), static_cast<unsigned>(slave->status_code())));
    }
  }
  if (!failed) failed_since_ = tick_;
  if (!failed || tick_ - failed_since_ != ms(3) || nmt_since_ >= failed_since_) return;
  if (objects.find(0x1003, 1) == nullptr || objects_.error_code == 0) return;
  const std::int64_t entries = objects.number(0x1003, 0);
  for (std::uint8_t entry = 1; entry <= entries; ++entry) {
    if ((objects.number(0x1003, entry) & 0xFFFF) == objects_.error_code) return;
  }
  fail("error-history",
       fmt::format("603Fh is {:04X}h, which is in none of the {} entries of 1003h", objects_.error_code, entries));
}

void Watch::errors() {
  const bool failed = one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
  if (failed && tick_ - state_since_ > cycle_ticks && objects_.error_code == 0) {
    return fail("fault-without-code", "603Fh is 0");
  }
  if (failed && fault_since_ == tick_) {
    const drive::FaultRow* row = drive_.shown_fault();
    if (row != nullptr && row->cause == drive::Cause::phase_loss) {
      constexpr std::uint32_t phases = bit(plant::Injection::open_phase_u) | bit(plant::Injection::open_phase_v) |
                                       bit(plant::Injection::open_phase_w) | bit(plant::Injection::short_phase_u) |
                                       bit(plant::Injection::short_phase_v) | bit(plant::Injection::short_phase_w);
      // The drive may report later an error that it detected while a phase was broken.
      if ((around_->injected & phases) == 0 && tick_ - std::max(spoiled_, around_->disturbed) > ms(20)) {
        fail("false-alarm", fmt::format("motor phase lost ({:04X}h) with all phases whole, {:.0f} rpm, link {:.0f} V",
                                        row->code, rpm(velocity_), axis_.plant().dc_link_v()));
      }
    }
  }
  if (failed && state_since_ != tick_ && tick_ - state_since_ == ms(2) && communication_register() == 0) {
    return fail("fault-without-code",
                fmt::format("1001h is {:02X}h, 603Fh {:04X}h", communication_register(), objects_.error_code));
  }
  if (canopen::Node* node = axis_.device().can_node()) {
    if (node->nmt_state() != nmt_) {
      nmt_ = node->nmt_state();
      nmt_since_ = tick_;
    }
    const bool speaks = (nmt_ == canopen::NmtState::operational || nmt_ == canopen::NmtState::pre_operational) &&
                        tick_ - nmt_since_ > ms(20) && !around_->cut && tick_ - around_->joined > ms(20) &&
                        around_->quiet_bus;
    if (!speaks || !failed) fault_since_ = fault_since_ == tick_ ? tick_ : -1;
    if (!speaks) fault_since_ = -1;
    // An overload of the bus is detected every 4 ms only.
    if (fault_since_ >= 0 && tick_ - fault_since_ > ms(10)) {
      if (told_at_ < fault_since_ - ms(1)) {
        return fail("emergency-missing", fmt::format("603Fh is {:04X}h for 10 ms", objects_.error_code));
      }
      fault_since_ = -1;
    }
  }
}

std::uint8_t Watch::communication_register() {
  return static_cast<std::uint8_t>(axis_.device().bus_dictionary().number(0x1001, 0));
}

void Watch::pdos_mapped() {
  statusword_at_.fill(-1);
  mapped_since_ = tick_;
  if (axis_.device().can_node() == nullptr) return;
  dictionary::Dictionary& objects = axis_.device().bus_dictionary();
  for (std::size_t pdo = 0; pdo < 4; ++pdo) {
    const auto mapping = static_cast<std::uint16_t>(0x1A00 + pdo);
    int bits = 0;
    for (std::uint8_t entry = 1; entry <= objects.number(mapping, 0); ++entry) {
      const auto word = static_cast<std::uint32_t>(objects.number(mapping, entry));
      if (word >> 8 == 0x604100 && bits % 8 == 0) statusword_at_[pdo] = bits / 8;
      bits += static_cast<int>(word & 0xFF);
    }
  }
}

void Watch::heard(const canopen::Frame& frame, line::Time at) {
  if (finding_ || around_ == nullptr) return;
  const std::uint32_t function = frame.id & 0x780;
  const std::int64_t now = at / line::tick_length;
  if (function == 0x080 && frame.length == 8) {
    told_code_ = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
    if (told_code_ != 0) told_at_ = now;
    return;
  }
  if (function == 0x700 && frame.length == 1 && frame.data[0] == 0) nmt_since_ = now;  // a boot-up: 1003h is empty
  const bool pdo = function == 0x180 || function == 0x280 || function == 0x380 || function == 0x480;
  if (!pdo || !around_->powered) return;
  const bool operational = nmt_ == canopen::NmtState::operational;
  // One frame may have been on the wire already.
  if (!operational && now - nmt_since_ > ms(0.25)) {
    return fail("pdo-in-wrong-state", fmt::format("TPDO {:03X}h {:.2f} ms after NMT operational was left", frame.id,
                                                  static_cast<double>(now - nmt_since_) / ticks_per_ms));
  }
  if (around_->cut || now - around_->joined < ms(1))
    return;  // one frame may wait in the controller while the cable is cut
  const int place = statusword_at_[(function - 0x180) / 0x100];
  if (place < 0 || place + 2 > frame.length) return;
  const auto word = static_cast<std::uint16_t>(frame.data[static_cast<std::size_t>(place)] |
                                               frame.data[static_cast<std::size_t>(place) + 1] << 8);
  // The statusword must have had this value within the last 3 ms.
  for (std::size_t back = 0; back < std::min(shown_count_, shown_.size()); ++back) {
    const Shown& shown = shown_[(shown_count_ - 1 - back) % shown_.size()];
    if (shown.statusword == word) return;
    // A command acts at once; bit 4, a warning and the bits of the mode follow in the next cycle. In between a TPDO
    // may show a combination that no tick ends with.
    const bool lately = std::max(shown.tick, asked_) >= now - ms(1);
    if (lately && ((shown.statusword ^ word) & 0x006F) == 0) return;
    // A quick stop of a standing axis may begin and end within one tick.
    if (lately && (word & 0x006F) == 0x0007 && drive::command_of(objects_.controlword) == drive::Command::quick_stop)
      return;
    // A fault may end Operation enabled in the same tick in which it began.
    const bool failed = (shown.statusword & 0x0048) == 0x0008;
    if (lately && failed && (word & 0x006F) == 0x0027 &&
        drive::command_of(objects_.controlword) == drive::Command::enable_operation)
      return;
    if (shown.tick < now - ms(3)) {
      return fail(
          "stale-statusword",
          fmt::format("TPDO shows {:04X}h, it is {:04X}h for {:.1f} ms", word, objects_.statusword,
                      static_cast<double>(now - shown_[(shown_count_ - 1) % shown_.size()].tick) / ticks_per_ms));
    }
  }
}

bool Watch::end() {
  if (finding_) return false;
  const plant::Energy energy = axis_.plant().energy();
  const double taken = energy.copper_j + energy.shaft_j + energy.magnetic_j;
  const double scale = std::abs(energy.to_motor_j) + energy.copper_j + std::abs(energy.shaft_j) + energy.magnetic_j;
  if (!spoilt_ && std::abs(energy.to_motor_j - taken) > 0.02 * scale + 0.2) {
    fail("energy", fmt::format("{:.3f} J went into the phases, {:.3f} J are accounted for", energy.to_motor_j, taken));
  }
  return !finding_;
}

}  // namespace servodrome::motion
