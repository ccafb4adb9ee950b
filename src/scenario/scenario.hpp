#pragma once

#include <bitset>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "canopen/node.hpp"
#include "drive/power/power_state.hpp"
#include "ethercat/slave/al_status.hpp"
#include "links/can/bus.hpp"
#include "links/time.hpp"

// A scenario: rules that make the drives and buses of a line behave wrongly, and the expected reaction of the master.
// docs/scenario.md describes the file. These types contain values only; `Director` executes them.
namespace servodrome::scenario {

using links::Time;

enum class MessageKind : std::uint8_t {
  sdo_answer,
  sdo_request,
  tpdo,
  tpdo1,
  tpdo2,
  tpdo3,
  tpdo4,
  rpdo,
  rpdo1,
  rpdo2,
  rpdo3,
  rpdo4,
  heartbeat,
  boot_up,
  emergency,
  nmt,
  sync,
  time,
  lss_answer,
  lss_request,
  from_drive,
  to_drive,
  mailbox_answer,
  mailbox_request,
  cycle,
  frame,
  answer,
  request,
  count
};
using MessageKinds = std::bitset<static_cast<std::size_t>(MessageKind::count)>;

// Frames of an EtherCAT segment.
inline bool is_of_segment(MessageKind kind) { return kind == MessageKind::cycle || kind == MessageKind::frame; }

struct ObjectAddress {
  std::uint16_t index = 0;
  std::optional<std::uint8_t> sub;  // none: all sub-indices

  bool contains(std::uint16_t its_index, std::uint8_t its_sub) const {
    return index == its_index && (!sub || *sub == its_sub);
  }
};

// Selects messages: every member that has a value must match.
struct MessagePattern {
  MessageKind kind = MessageKind::from_drive;
  std::optional<ObjectAddress> object;            // of an SDO transfer
  std::optional<std::uint32_t> id;                // CAN identifier
  std::uint32_t id_mask = 0x1FFFFFFF;             // the bits of the identifier that are compared
  std::vector<std::optional<std::uint8_t>> data;  // first bytes; no value: any byte
  std::vector<std::uint8_t> data_mask;            // the bits of `data` that are compared; a missing byte: all
  std::optional<std::uint8_t> function;           // Modbus function code
  std::optional<std::uint8_t> command;            // of an EtherCAT datagram
  std::optional<std::uint16_t> address;           // register address of an EtherCAT datagram
};

// A condition is true while every member that has a value is true for the axis.
struct Condition {
  std::string axis;          // the axis of the condition; empty: the axis of the rule or expectation
  std::optional<Time> time;  // the line time has reached this value
  std::string after;         // the rule of this name has acted
  Time after_delay{};        // its first act was at least this time ago
  std::optional<drive::PowerState> state;
  std::optional<canopen::NmtState> nmt;
  std::optional<ethercat::AlState> al;
  std::optional<int> mode;                               // as 6061h shows it
  std::optional<unsigned> homing_leg;                    // the drive runs this leg of its homing, from 0
  std::optional<bool> at_rest;                           // the shaft turns slower than `rest_rpm`
  std::optional<double> position_above, position_below;  // motor revolutions, the true shaft
  std::optional<double> speed_above, speed_below;        // rpm, absolute value
  std::optional<double> moved_above;      // motor revolutions since the watch began, absolute value of the distance
  std::optional<double> travelled_above;  // motor revolutions since the scenario began, both directions added
  std::optional<double> torque_above;     // fraction of the rated torque, absolute value
  std::optional<ObjectAddress> object;    // its value has the bits of `value` that `mask` selects
  std::int64_t mask = -1;
  std::int64_t value = 0;
  std::optional<bool> powered;
  std::optional<MessagePattern> message;  // `count` such messages have passed since the watch began
  unsigned count = 1;
  std::optional<Time> ended;    // the master ended at least this time ago
  std::optional<bool> success;  // the master has ended with this result
  // Actions of the master on the axis: see MasterDeeds.
  std::optional<unsigned> fault_resets_above;  // number in the last second
  std::optional<unsigned> repeats_above;       // number of repeated SDO requests without an answer in the last second
  std::optional<bool> set_point_jumped;        // the first set-point of a cyclic mode was out of reach

  static constexpr double rest_rpm = 1;
};

// ---- Actions on messages

struct Withhold {};
struct Delay {
  Time time{};
  Time jitter{};        // a random time from 0 to this is added
  unsigned frames = 0;  // on EtherCAT in place of a time: the number of later frames that come back first
};
struct Alter {
  enum class How : std::uint8_t { set, flip, add, swap };
  std::optional<int> byte;  // from 0; negative: from the end, -1 is the last
  How how = How::set;
  std::uint16_t value = 0;                         // of swap: the place of the other byte
  std::vector<std::optional<std::uint8_t>> bytes;  // from byte 0 on; no value: unchanged
  std::optional<std::uint32_t> id;                 // the CAN identifier
};
struct Repeat {
  unsigned copies = 1;  // in addition to the message itself
  Time gap{};           // between two of them
  Alter alter;          // of the copies
};
struct Replace {
  std::vector<std::uint8_t> data;
};
struct Truncate {
  unsigned length = 0;  // bytes that remain
};
struct Extend {
  std::vector<std::uint8_t> data;
  bool before = false;  // true: the data come before the message, false: after it
  Time gap{};           // pause between the data and the message
};
struct Abort {
  std::uint32_t code = 0;  // of the SDO abort, or serial refusal, in place of the message
};
// On frames of an EtherCAT segment.
struct WithholdAnswer {};
struct Twice {};
struct WorkingCounter {
  int add = -1;
};
struct Stale {};
// On answers of serial servers.
struct Slow {
  Time gap{};  // between two characters
};
struct Close {
  unsigned length = 0;  // number of bytes that are sent before the TCP connection closes
};

// ---- Actions on a bus

struct Send {
  std::uint32_t id = 0;
  std::vector<std::uint8_t> data;
  Time period{};
  bool continuous = false;  // until the rule ends, as close together as the bus allows
};
// The cable in front of an EtherCAT slave, a drive's stub on CAN or RS485; for a bus: the master's cable.
struct Cable {
  bool connected = false;
};
struct Accept {
  bool on = false;  // false: TCP connections to the bus are refused, and existing ones end
};
struct ForceErrorState {
  links::ErrorState state = links::ErrorState::passive;
};

// ---- Actions on objects, as the bus sees them

struct Show {
  enum class How : std::uint8_t { value, freeze, set_bits, clear_bits, flip_bits, add, negate, late, drift };
  ObjectAddress object;
  How how = How::freeze;
  std::int64_t number = 0;  // value, bits, amount, or drift per second
  std::int64_t mask = -1;   // of value, freeze and late: only these bits
  Time time{};              // period of flip_bits, lateness
};
struct Ignore {
  ObjectAddress object;
  std::int64_t mask = -1;  // only these bits keep their old value
};
struct Hold {
  ObjectAddress object;
  Time time{};
};

// ---- Actions on a drive

// A request to the bench API for the axis. The end of the rule does not undo it.
struct Request {
  std::string method;  // "PUT", "POST", "DELETE"
  std::string path;    // behind /api/v1/axes/NAME
  std::string body;
};
// Switches a state of the drive or its machine while the rule is active.
struct Switch {
  enum class What { power, fault, input, locked_rotor };
  What what{};
  std::string name;  // of the fault or of the input
  bool on = false;
};
// The drive writes its own object once, also a read-only one.
struct SetObject {
  ObjectAddress object;  // without a sub-index: sub-index 0 of an object that has no other
  std::int64_t value = 0;
};
struct Emergency {
  std::uint16_t code = 0;
  std::uint8_t error_register = 1;
  Time period{};
};

// ---- Actions on an EtherCAT slave

// Also refuses the acknowledgement of an error in this state.
struct RefuseState {
  ethercat::AlState to = ethercat::AlState::operational;
  std::uint16_t code = 0;
};
struct DropState {
  ethercat::AlState to = ethercat::AlState::safe_operational;
  std::uint16_t code = 0;
};
struct PatchSii {
  unsigned word = 0;
  std::uint16_t value = 0;
};
struct DisturbClock {
  std::int64_t jump_ns = 0;
  std::optional<double> ppm;
  bool stop = false;
};
struct DisturbSync0 {
  enum class How : std::uint8_t { missing, twice, late };
  How how = How::missing;
  Time late{};
};
struct StaleInputs {};
struct WatchdogOff {};

using Action = std::variant<Withhold, Delay, Repeat, Alter, Replace, Truncate, Extend, Abort, WithholdAnswer, Twice,
                            WorkingCounter, Stale, Slow, Close, Send, Cable, Accept, ForceErrorState, Show, Ignore,
                            Hold, Request, Switch, SetObject, Emergency, RefuseState, DropState, PatchSii, DisturbClock,
                            DisturbSync0, StaleInputs, WatchdogOff>;

// The action changes messages that `Rule::on` selects.
inline bool acts_on_messages(const Action& action) { return action.index() <= Action(Close{}).index(); }
// The action makes a message: when its rule begins, or before each message that `Rule::on` selects.
inline bool makes_messages(const Action& action) {
  return std::holds_alternative<Send>(action) || std::holds_alternative<Emergency>(action);
}
// The action has an effect each time that the drive, the slave or a link asks for it.
inline bool acts_when_asked(const Action& action) {
  return std::holds_alternative<Ignore>(action) || std::holds_alternative<Hold>(action) ||
         std::holds_alternative<RefuseState>(action) || std::holds_alternative<DisturbSync0>(action) ||
         std::holds_alternative<StaleInputs>(action);
}
// The action changes the bytes of messages, their length or their number.
inline bool changes_bytes(const Action& action) {
  return std::holds_alternative<Alter>(action) || std::holds_alternative<Repeat>(action) ||
         std::holds_alternative<Replace>(action) || std::holds_alternative<Truncate>(action) ||
         std::holds_alternative<Extend>(action);
}
// The action changes what the bus sees of an object.
inline bool acts_on_view(const Action& action) {
  return std::holds_alternative<Show>(action) || std::holds_alternative<Ignore>(action) ||
         std::holds_alternative<Hold>(action);
}

// The object of an action; nullptr: it has none.
inline const ObjectAddress* object_of(const Action& action) {
  if (const auto* show = std::get_if<Show>(&action)) return &show->object;
  if (const auto* ignore = std::get_if<Ignore>(&action)) return &ignore->object;
  if (const auto* hold = std::get_if<Hold>(&action)) return &hold->object;
  if (const auto* set = std::get_if<SetObject>(&action)) return &set->object;
  return nullptr;
}

struct Rule {
  std::string name;
  std::string axis;  // empty: the only axis
  std::string bus;   // in place of an axis, for actions on a bus
  Condition when;
  std::optional<Condition> until;
  bool again = false;                // the rule begins again each time `when` becomes true
  std::optional<Time> period;        // the rule begins again this time after its last beginning, if `when` holds
  std::optional<MessagePattern> on;  // for actions on messages
  Action action;
  std::string word;               // the action's name in the file
  bool checksum = false;          // the change is made before the checksum of a serial message is computed
  std::optional<unsigned> times;  // the rule ends after this number of acts, or of sent messages
  unsigned skip = 0;              // number of matching messages that pass first
  unsigned every = 1;             // the rule then acts on every n-th message
  double chance = 1;              // probability of an act on such a message
  std::optional<Time> lasts;      // duration of the rule

  // The number of acts after which the rule ends; nullopt: no limit. A rule that makes a message makes one.
  std::optional<unsigned> most_acts() const {
    const auto* send = std::get_if<Send>(&action);
    const bool once = makes_messages(action) && !on && (send == nullptr || !send->continuous);
    return !times && once ? 1 : times;
  }
};

struct Expectation {
  enum class Kind : std::uint8_t { eventually, always, never };
  std::string name;
  std::string axis;
  Kind kind = Kind::eventually;
  Condition when;                  // the watch begins when it is true
  std::optional<Condition> until;  // the watch ends when it is true
  Condition what;
  std::optional<Time> within;  // of `eventually`, from the beginning of the watch
  std::optional<Time> lasts;   // duration of the watch of `always` and `never`
};

enum class MasterStatus : std::uint8_t { any, success, failure };

struct Scenario {
  std::string title;
  std::string breaks;
  std::string clause;
  std::string good_master;
  std::string why;
  std::string source;
  std::string line;  // path of the line file, from the current folder
  std::uint64_t seed = 1;
  std::map<std::string, std::string, std::less<>> waived;  // word of a standard expectation, reason
  MasterStatus master = MasterStatus::any;
  Time duration = std::chrono::seconds(10);
  std::vector<Rule> rules;
  std::vector<Expectation> expectations;
};

}  // namespace servodrome::scenario
