// The power state machine: transitions by command, invalid commands, statuswords.
#include "axis/cia402_words.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::power_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

struct Step {
  PowerState from;
  std::uint16_t word;
  PowerState to;
};

// Commands and transitions of the state machine (CiA 402-2), in the order of the checks below.
constexpr std::array steps{
    Step{PowerState::switch_on_disabled, command_word::shutdown, PowerState::ready_to_switch_on},
    Step{PowerState::ready_to_switch_on, command_word::switch_on, PowerState::switched_on},
    Step{PowerState::switched_on, command_word::enable_operation, PowerState::operation_enabled},
    Step{PowerState::operation_enabled, command_word::switch_on, PowerState::switched_on},
    Step{PowerState::switched_on, command_word::shutdown, PowerState::ready_to_switch_on},
    Step{PowerState::ready_to_switch_on, command_word::disable_voltage, PowerState::switch_on_disabled},
    Step{PowerState::ready_to_switch_on, command_word::quick_stop, PowerState::switch_on_disabled},
    Step{PowerState::operation_enabled, command_word::shutdown, PowerState::ready_to_switch_on},
    Step{PowerState::operation_enabled, command_word::disable_voltage, PowerState::switch_on_disabled},
    Step{PowerState::switched_on, command_word::disable_voltage, PowerState::switch_on_disabled},
    Step{PowerState::switched_on, command_word::quick_stop, PowerState::switch_on_disabled},
};

void transition(Trial& trial, int row) {
  const Step& step = steps[static_cast<std::size_t>(row)];
  trial.bring_to(step.from);
  trial.control(step.word);
  const bool arrived = trial.wait_for(step.to);
  const std::uint16_t seen = trial.statusword();
  trial.expect(arrived && trial.stays(step.to),
               fmt::format("{} in {}", text_of_controlword(step.word), drive::name(step.from)), drive::name(step.to),
               text_of_state(seen));
}

// With 605Ah = 5 to 8 the drive stays in quick stop active; with 0 to 4 it leaves that state by itself (transition 12)
// when its brake has closed.
void require_quick_stop_held(Trial& trial) {
  const bool stays = trial.wait_for(PowerState::quick_stop_active) &&
                     trial.stays(PowerState::quick_stop_active, 500ms + trial.subject().brake_delay());
  trial.require(stays, "605Ah = 6, then 6040h = 0002h (quick stop) in operation enabled",
                "quick stop active, and it stays there", text_of_state(trial.statusword()));
}

void quick_stop(Trial& trial, int) {
  const auto option = trial.objects().read_if_present<std::int16_t>(0x605A);
  const bool stays = option && !Trial::refusal_of([&] { trial.objects().write<std::int16_t>(0x605A, 0, 6); });
  trial.bring_to(PowerState::operation_enabled);
  trial.control(command_word::quick_stop);
  if (stays) return require_quick_stop_held(trial);
  const Time deadline = trial.now() + trial.settings().patience;
  bool left = false;
  while (!left && trial.now() < deadline) {
    const PowerState now = trial.state();
    left = now == PowerState::quick_stop_active || now == PowerState::switch_on_disabled;
  }
  trial.expect(left, "6040h = 0002h (quick stop) in operation enabled", "quick stop active, or switch on disabled",
               text_of_state(trial.statusword()));
}

// With 605Ah = 2 the drive goes to switch on disabled when it stands still.
void quick_stop_leaves(Trial& trial, int) {
  if (!trial.objects().read_if_present<std::int16_t>(0x605A)) Trial::skip("it has no 605Ah");
  if (const auto refusal = Trial::refusal_of([&] { trial.objects().write<std::int16_t>(0x605A, 0, 2); })) {
    Trial::skip("it does not take 605Ah = 2: " + refusal->text);
  }
  trial.bring_to(PowerState::operation_enabled);
  trial.control(command_word::quick_stop);
  const bool arrived = trial.wait_for(PowerState::switch_on_disabled);
  trial.expect(arrived, "605Ah = 2, then 6040h = 0002h (quick stop) in operation enabled",
               "switch on disabled once it stands", text_of_state(trial.statusword()));
}

void from_quick_stop(Trial& trial, std::uint16_t word, PowerState to) {
  if (!trial.objects().read_if_present<std::int16_t>(0x605A)) {
    Trial::skip("it has no 605Ah to hold it in quick stop active");
  }
  if (const auto refusal = Trial::refusal_of([&] { trial.objects().write<std::int16_t>(0x605A, 0, 6); })) {
    Trial::skip("it does not take 605Ah = 6, which would hold it in quick stop active: " + refusal->text);
  }
  trial.bring_to(PowerState::quick_stop_active);
  require_quick_stop_held(trial);
  trial.control(word);
  const bool arrived = trial.wait_for(to);
  trial.expect(arrived, fmt::format("{} in quick stop active, 605Ah = 6", text_of_controlword(word)), drive::name(to),
               text_of_state(trial.statusword()));
}
void disable_in_quick_stop(Trial& trial, int) {
  from_quick_stop(trial, command_word::disable_voltage, PowerState::switch_on_disabled);
}
void enable_in_quick_stop(Trial& trial, int) {
  from_quick_stop(trial, command_word::enable_operation, PowerState::operation_enabled);
}

// Sends commands that are invalid in this state: it must not change.
void no_effect(Trial& trial, PowerState state, std::initializer_list<std::uint16_t> words) {
  for (const std::uint16_t word : words) {
    trial.bring_to(state);
    trial.control(word);
    const bool stayed = trial.stays(state);
    trial.expect(stayed, fmt::format("{} in {}", text_of_controlword(word), drive::name(state)),
                 fmt::format("{}, as before", drive::name(state)), text_of_state(trial.statusword()));
  }
}
void illegal_disabled(Trial& trial, int) {
  no_effect(trial, PowerState::switch_on_disabled, {0x0007, 0x000F, 0x0002, 0x0000, 0x0080});
}
void illegal_ready(Trial& trial, int) { no_effect(trial, PowerState::ready_to_switch_on, {0x0006, 0x0086}); }
void illegal_switched_on(Trial& trial, int) { no_effect(trial, PowerState::switched_on, {0x0007, 0x0087}); }
void illegal_enabled(Trial& trial, int) { no_effect(trial, PowerState::operation_enabled, {0x000F, 0x008F}); }

// Bit patterns of statuswords (CiA 402-2 table of statuswords): x1xx 0000 etc.
struct Pattern {
  PowerState state;
  std::uint16_t mask;
  std::uint16_t value;
};
constexpr std::array patterns{
    Pattern{PowerState::switch_on_disabled, 0x4F, 0x40}, Pattern{PowerState::ready_to_switch_on, 0x6F, 0x21},
    Pattern{PowerState::switched_on, 0x6F, 0x23}, Pattern{PowerState::operation_enabled, 0x6F, 0x27}};

void pattern(Trial& trial, int row) {
  const Pattern& expected = patterns[static_cast<std::size_t>(row)];
  trial.bring_to(expected.state);
  trial.wait(100ms);
  const std::uint16_t seen = trial.statusword();
  trial.expect((seen & expected.mask) == expected.value, fmt::format("read 6041h in {}", drive::name(expected.state)),
               fmt::format("bits {:04X}h of it {:04X}h", expected.mask, expected.value), fmt::format("{:04X}h", seen));
}

void voltage_enabled(Trial& trial, int) {
  trial.bring_to(PowerState::operation_enabled);
  trial.wait(100ms);
  const std::uint16_t seen = trial.statusword();
  trial.expect((seen & 0x10) != 0, "read 6041h in operation enabled", "bit 4, voltage enabled",
               fmt::format("{:04X}h", seen));
}

void remote(Trial& trial, int) {
  trial.bring_to(PowerState::ready_to_switch_on);
  const std::uint16_t seen = trial.statusword();
  trial.expect((seen & 0x200) != 0, "read 6041h after the controlword had its effect", "bit 9, remote",
               fmt::format("{:04X}h", seen));
}

void no_fault_bits(Trial& trial, int) {
  trial.bring_to(PowerState::ready_to_switch_on);
  const auto error = trial.objects().read_if_present<std::uint16_t>(0x603F);
  if (!error) Trial::skip("it has no 603Fh");
  trial.expect(*error == 0, "read 603Fh without a fault", "0", fmt::format("{:04X}h", *error));
}

struct OptionCode {
  std::uint16_t index;
  const char* what;
};
constexpr std::array option_codes{
    OptionCode{0x605A, "quick stop option code"}, OptionCode{0x605B, "shutdown option code"},
    OptionCode{0x605C, "disable operation option code"}, OptionCode{0x605D, "halt option code"},
    OptionCode{0x605E, "fault reaction option code"}};

// Values 9 to 32767 are reserved in each of these objects.
void option_code(Trial& trial, int row) {
  const OptionCode& code = option_codes[static_cast<std::size_t>(row)];
  KeptObjects& objects = trial.objects();
  const auto before = objects.read_if_present<std::int16_t>(code.index);
  if (!before) Trial::skip(fmt::format("it has no {:04X}h, which is optional", code.index));
  trial.expect(*before <= 8, fmt::format("read {:04X}h, {}", code.index, code.what), "8 at most",
               fmt::format("{}", *before));
  objects.keep({code.index, 0});
  trial.expect_refused(fmt::format("write {:04X}h = 100, reserved", code.index),
                       {AbortCode::value_invalid, AbortCode::value_too_high},
                       [&] { trial.subject().services().write<std::int16_t>(code.index, 0, 100); });
  const auto after = objects.read<std::int16_t>(code.index);
  trial.expect(after == *before, fmt::format("read {:04X}h", code.index), fmt::format("{}, as before", *before),
               fmt::format("{}", after));
}

// 605Ch = 0: without a ramp; 1: with a ramp. Both end in switched on.
void disable_operation_option(Trial& trial, int) {
  if (!trial.objects().read_if_present<std::int16_t>(0x605C)) Trial::skip("it has no 605Ch, which is optional");
  for (const std::int16_t option : {std::int16_t{0}, std::int16_t{1}}) {
    trial.bring_to(PowerState::switch_on_disabled);
    if (Trial::refusal_of([&] { trial.objects().write<std::int16_t>(0x605C, 0, option); })) continue;
    trial.bring_to(PowerState::operation_enabled);
    trial.control(command_word::switch_on);
    const bool arrived = trial.wait_for(PowerState::switched_on);
    trial.expect(arrived, fmt::format("605Ch = {}, then 6040h = 0007h (disable operation)", option), "switched on",
                 text_of_state(trial.statusword()));
  }
}

constexpr auto fsa = "CiA 402-2, FSA, table of transitions";
constexpr auto commands = "CiA 402-2, FSA, table of commands";
constexpr auto states = "CiA 402-2, object 6041h, table of states";
constexpr unsigned all = buses::all;

constexpr std::array rows{
    Check{"power.transition-2", fsa, "Shutdown: switch on disabled to ready to switch on", Demand::nothing, all,
          transition, 0},
    Check{"power.transition-3", fsa, "Switch on: ready to switch on to switched on", Demand::enable, all, transition,
          1},
    Check{"power.transition-4", fsa, "Enable operation: switched on to operation enabled", Demand::enable, all,
          transition, 2},
    Check{"power.transition-5", fsa, "Disable operation: operation enabled to switched on", Demand::enable, all,
          transition, 3},
    Check{"power.transition-6", fsa, "Shutdown: switched on to ready to switch on", Demand::enable, all, transition, 4},
    Check{"power.transition-7", fsa, "Disable voltage: ready to switch on to switch on disabled", Demand::nothing, all,
          transition, 5},
    Check{"power.transition-7-quick-stop", fsa, "Quick stop: ready to switch on to switch on disabled", Demand::nothing,
          all, transition, 6},
    Check{"power.transition-8", fsa, "Shutdown: operation enabled to ready to switch on", Demand::enable, all,
          transition, 7},
    Check{"power.transition-9", fsa, "Disable voltage: operation enabled to switch on disabled", Demand::enable, all,
          transition, 8},
    Check{"power.transition-10", fsa, "Disable voltage: switched on to switch on disabled", Demand::enable, all,
          transition, 9},
    Check{"power.transition-10-quick-stop", fsa, "Quick stop: switched on to switch on disabled", Demand::enable, all,
          transition, 10},
    Check{"power.transition-11", fsa, "Quick stop: operation enabled to quick stop active", Demand::enable, all,
          quick_stop},
    Check{"power.transition-12", fsa, "Disable voltage: quick stop active to switch on disabled", Demand::enable, all,
          disable_in_quick_stop},
    Check{"power.transition-12-by-itself", "CiA 402-2, object 605Ah",
          "Quick stop with 605Ah = 2 ends in switch on disabled", Demand::enable, all, quick_stop_leaves},
    Check{"power.transition-16", fsa, "Enable operation: quick stop active to operation enabled", Demand::enable, all,
          enable_in_quick_stop},
    Check{"power.illegal-switch-on-disabled", commands,
          "Commands without a transition have no effect in switch on disabled", Demand::nothing, all, illegal_disabled},
    Check{"power.illegal-ready-to-switch-on", commands,
          "Commands without a transition have no effect in ready to switch on", Demand::nothing, all, illegal_ready},
    Check{"power.illegal-switched-on", commands, "Commands without a transition have no effect in switched on",
          Demand::enable, all, illegal_switched_on},
    Check{"power.illegal-operation-enabled", commands,
          "Commands without a transition have no effect in operation enabled", Demand::enable, all, illegal_enabled},
    Check{"power.statusword-switch-on-disabled", states, "Statusword of switch on disabled", Demand::nothing, all,
          pattern, 0},
    Check{"power.statusword-ready-to-switch-on", states, "Statusword of ready to switch on", Demand::nothing, all,
          pattern, 1},
    Check{"power.statusword-switched-on", states, "Statusword of switched on", Demand::enable, all, pattern, 2},
    Check{"power.statusword-operation-enabled", states, "Statusword of operation enabled", Demand::enable, all, pattern,
          3},
    Check{"power.voltage-enabled", "CiA 402-2, object 6041h, bit 4", "Bit 4 reports the voltage", Demand::enable, all,
          voltage_enabled},
    Check{"power.remote", "CiA 402-2, object 6041h, bit 9", "Bit 9 reports that the controlword is processed",
          Demand::nothing, all, remote},
    Check{"power.no-error-code", "CiA 402-2, object 603Fh", "There is no error code without a fault", Demand::nothing,
          all, no_fault_bits},
    Check{"power.option-605A", "CiA 402-2, object 605Ah", "The quick stop option code is limited to its range",
          Demand::nothing, all, option_code, 0},
    Check{"power.option-605B", "CiA 402-2, object 605Bh", "The shutdown option code is limited to its range",
          Demand::nothing, all, option_code, 1},
    Check{"power.option-605C", "CiA 402-2, object 605Ch", "The disable operation option code is limited to its range",
          Demand::nothing, all, option_code, 2},
    Check{"power.option-605D", "CiA 402-2, object 605Dh", "The halt option code is limited to its range",
          Demand::nothing, all, option_code, 3},
    Check{"power.option-605E", "CiA 402-2, object 605Eh", "The fault reaction option code is limited to its range",
          Demand::nothing, all, option_code, 4},
    Check{"power.disable-operation-option", "CiA 402-2, object 605Ch",
          "Disable operation ends in switched on, with each option code", Demand::enable, all,
          disable_operation_option},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::power_group
