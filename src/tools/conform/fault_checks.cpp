// Faults: reaction, reset, error objects, emergencies. The master causes the fault: a following error or, on CAN, the
// loss of a heartbeat.
#include "axis/cia402_words.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::fault_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

void need_fault(Trial& trial) {
  if (!trial.cause_fault())
    Trial::skip(
        "no fault could be caused: neither by a following error (6065h) nor by the loss of a heartbeat (1016h)");
}

void reaction(Trial& trial, int) {
  need_fault(trial);
  const std::uint16_t word = trial.statusword();
  trial.expect(state_of(word) == PowerState::fault, "a fault is caused", "fault: bits 004Fh of 6041h are 0008h",
               fmt::format("{:04X}h", word));
}

void error_code(Trial& trial, int) {
  need_fault(trial);
  const auto code = trial.objects().read_if_present<std::uint16_t>(0x603F);
  if (!code) Trial::skip("it has no 603Fh, which is optional");
  trial.expect(*code != 0, "read 603Fh in fault", "an error code", fmt::format("{:04X}h", *code));
  if (const auto reg = trial.objects().read_if_present<std::uint8_t>(0x1001)) {
    trial.expect((*reg & 1) != 0, "read 1001h in fault", "bit 0, generic error", fmt::format("{:02X}h", *reg));
  }
}

void commands_in_fault(Trial& trial, int) {
  need_fault(trial);
  for (const std::uint16_t word : std::to_array<std::uint16_t>({0x0006, 0x0007, 0x000F, 0x0000, 0x0002})) {
    trial.control(word);
    const bool stayed = trial.stays(PowerState::fault, 30ms);
    trial.expect(stayed, text_of_controlword(word) + " in fault", "fault, as before",
                 text_of_state(trial.statusword()));
  }
}

void reset_by_edge(Trial& trial, int) {
  const auto before = trial.objects().read_if_present<std::uint8_t>(0x1001);
  need_fault(trial);
  trial.end_cause_of_fault();
  trial.control(0x0000);
  trial.wait(20ms);
  trial.control(command_word::fault_reset);
  const bool reset = trial.wait_for(PowerState::switch_on_disabled);
  trial.require(reset, "6040h = 0000h, then 0080h (fault reset) in fault", "switch on disabled",
                text_of_state(trial.statusword()));
  if (!before) return;
  const auto after = trial.objects().read<std::uint8_t>(0x1001);
  trial.expect((after & ~*before) == 0, "read 1001h after the reset",
               fmt::format("{:02X}h, as before the fault", *before), fmt::format("{:02X}h", after));
}

// If bit 7 was set before the fault, it must not reset the fault.
void standing_reset_bit(Trial& trial, int) {
  if (!trial.objects().read_if_present<std::uint32_t>(0x6065)) Trial::skip("it has no 6065h to cause a fault with");
  trial.enable(OperationMode::profile_position);
  trial.gentle_profile(2.0);
  const std::int32_t start = trial.position();
  trial.require_no_wrap(start);
  const std::int32_t target = start + trial.distance();
  trial.objects().write<std::uint32_t>(0x6065, 0, 1);
  trial.write_if_present<std::uint16_t>(0x6066, 0, 0);
  trial.objects().write<std::int32_t>(0x607A, 0, target);
  trial.control(0x00AF);  // sets bit 7 before the fault occurs
  trial.control(0x00BF);
  if (!trial.wait_for(PowerState::fault)) Trial::skip("no fault could be caused with bit 7 standing");
  const bool stayed = trial.stays(PowerState::fault, 100ms);
  trial.expect(stayed, "bit 7 of 6040h = 1 since before the fault", "fault: only a rising edge resets",
               text_of_state(trial.statusword()));
}

void emergency(Trial& trial, int) {
  if (trial.subject().bus_kind() == buses::can) {
    Bus& bus = trial.subject().can().bus;
    bus.drain();
    std::vector<Emergency> came;
    const auto listening = bus.listen([&](const Frame& frame) {
      const auto one = parse_emergency(frame);
      if (one && one->node_id == trial.subject().can().sdo.node_id()) came.push_back(*one);
    });
    need_fault(trial);
    trial.wait(100ms);
    const auto code = trial.objects().read_if_present<std::uint16_t>(0x603F).value_or(0);
    const auto reg = trial.objects().read_if_present<std::uint8_t>(0x1001).value_or(0);
    trial.require(!came.empty(), "a fault is caused", "an emergency", "none");
    const Emergency first = came.back();
    trial.expect(first.code != 0 && (code == 0 || first.code == code), "a fault is caused",
                 fmt::format("an emergency with the code of 603Fh, {:04X}h", code), text_of(first));
    trial.expect(first.error_register == reg, "a fault is caused", fmt::format("an emergency with 1001h, {:02X}h", reg),
                 text_of(first));
    const auto newest = trial.objects().read_if_present<std::uint32_t>(0x1003, 1);
    if (newest) {
      trial.expect((*newest & 0xFFFF) == first.code, "read 1003h sub 1",
                   fmt::format("{:04X}h, the newest error", first.code), fmt::format("{:08X}h", *newest));
    }
    trial.end_cause_of_fault();
    came.clear();
    trial.control(0x0000);
    trial.wait(20ms);
    trial.control(command_word::fault_reset);
    trial.wait_for(PowerState::switch_on_disabled);
    trial.wait(100ms);
    const bool reset = !came.empty() && came.back().code == 0;
    trial.expect(reset, "6040h = 0080h (fault reset)", "an emergency 0000h, error reset",
                 came.empty() ? "none" : text_of(came.back()));
    return;
  }
  trial.objects();
  MailboxClient& mailbox = trial.subject().ethercat().slave.mailbox();
  mailbox.drain();
  mailbox.forget_emergencies();
  need_fault(trial);
  trial.wait(100ms);
  mailbox.drain();
  const auto code = trial.objects().read_if_present<std::uint16_t>(0x603F).value_or(0);
  trial.require(!mailbox.emergencies().empty(), "a fault is caused", "an emergency in the mailbox", "none");
  const Emergency first = mailbox.emergencies().back();
  trial.expect(first.code != 0 && (code == 0 || first.code == code), "a fault is caused",
               fmt::format("an emergency with the code of 603Fh, {:04X}h", code), text_of(first));
}

void error_field(Trial& trial, int) {
  ObjectClient& objects = trial.subject().services();
  const auto count = objects.read_if_present<std::uint8_t>(0x1003, 0);
  if (!count) Trial::skip("it has no 1003h, which is optional");
  trial.expect_refused("write 1003h sub 0 = 1", {AbortCode::value_invalid, AbortCode::value_too_high},
                       [&] { objects.write<std::uint8_t>(0x1003, 0, 1); });
  trial.expect_taken("write 1003h sub 0 = 0, which deletes the list",
                     [&] { objects.write<std::uint8_t>(0x1003, 0, 0); });
  const auto after = objects.read<std::uint8_t>(0x1003, 0);
  trial.expect(after == 0, "read 1003h sub 0", "0, no errors", fmt::format("{}", after));
}

constexpr auto fsa = "CiA 402-2, FSA, transitions 13 to 15";

constexpr std::array rows{
    Check{"fault.reaction", fsa, "A fault ends in the state fault", Demand::motion, buses::all, reaction},
    Check{"fault.error-code", "CiA 402-2, object 603Fh; CiA 301, object 1001h", "A fault has an error code",
          Demand::motion, buses::all, error_code},
    Check{"fault.commands", fsa, "Commands have no effect in fault", Demand::motion, buses::all, commands_in_fault},
    Check{"fault.reset", fsa, "The edge of bit 7 resets a fault", Demand::motion, buses::all, reset_by_edge},
    Check{"fault.reset-needs-edge", "CiA 402-2, object 6040h, bit 7", "A static bit 7 does not reset a fault",
          Demand::motion, buses::all, standing_reset_bit},
    Check{"fault.emergency", "CiA 301 7.2.7; ETG.1000.6 5.6.4", "A fault and its reset are reported by emergencies",
          Demand::motion, buses::sdo, emergency},
    Check{"fault.error-field", "CiA 301 7.5.2, object 1003h",
          "Only 0 may be written to the error field, which empties it", Demand::nothing, buses::can, error_field},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::fault_group
