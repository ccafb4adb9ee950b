#include <array>

#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/line_bench.hpp"

// The state of a drive's power state machine, and the transitions that a master can command from there.
namespace servodrome::line::bench {
namespace {

using drive::Command;
using drive::PowerState;

struct CommandWord {
  Command command;
  const char* name;
  std::uint16_t controlword;  // CiA 402-2 table 24; bits without meaning for the command are 0
};
constexpr std::array command_words{
    CommandWord{Command::shutdown, "shutdown", 0x06},
    CommandWord{Command::switch_on, "switch on", 0x07},
    CommandWord{Command::enable_operation, "enable operation", 0x0F},
    CommandWord{Command::disable_voltage, "disable voltage", 0x00},
    CommandWord{Command::quick_stop, "quick stop", 0x02},
};
constexpr std::uint8_t disable_operation = 5;
constexpr std::uint8_t fault_reset = 15;

// Selects one command for each transition. While the motor is off, quick stop has the same effect as disable voltage.
// Enable operation in ready to switch on passes through switched on. Both are left out.
bool is_the_usual(const drive::Transition& transition) {
  if (transition.command == Command::quick_stop) return transition.from == PowerState::operation_enabled;
  return transition.command != Command::enable_operation || transition.from != PowerState::ready_to_switch_on;
}

}  // namespace

Json LineBench::show_states(Call& call) {
  Axis& axis = axis_of(call);
  if (!axis.powered()) {
    throw ApiError{409, "the axis has no power", axis.settings().name,
                   "switch it on: POST .../power {\"action\": \"on\"}"};
  }
  const drive::Drive& drive = axis.device().drive();
  return states_view(drive.state(), drive.policy(), [&drive](const auto& its) { return drive.accepts(its); });
}

Json states_view(PowerState state, const drive::Policy& policy,
                 const std::function<bool(const drive::Transition&)>& accepts) {
  Json transitions = Json::array();
  for (const drive::Transition& transition : policy.power.transitions) {
    if (!accepts(transition) || !is_the_usual(transition)) continue;
    for (const CommandWord& row : command_words) {
      if (row.command != transition.command) continue;
      transitions.push_back({{"number", transition.number},
                             {"name", transition.number == disable_operation ? "disable operation" : row.name},
                             {"to", drive::name(transition.to)},
                             {"controlword", row.controlword}});
    }
  }
  if (state == PowerState::fault) {  // by a rising edge of bit 7, after the cause is gone
    transitions.push_back({{"number", fault_reset},
                           {"name", "fault reset"},
                           {"to", drive::name(PowerState::switch_on_disabled)},
                           {"controlword", drive::controlword::fault_reset}});
  }
  return Json{{"state", drive::name(state)}, {"transitions", std::move(transitions)}};
}

}  // namespace servodrome::line::bench
