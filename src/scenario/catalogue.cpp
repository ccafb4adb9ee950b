#include "scenario/catalogue.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "scenario/parse.hpp"
#include "scenario/schema.hpp"

namespace servodrome::scenario {
namespace {

using Json = nlohmann::ordered_json;

struct Group {
  std::string_view name, title;
  std::string_view bus;  // type of the buses that have the profile; empty: all
};

constexpr auto groups = std::to_array<Group>({
    {"canopen", "CANopen", "can"},
    {"cia402", "CiA 402 and the machine", ""},
    {"ethercat", "EtherCAT", "ethercat"},
    {"modbus", "Modbus", "rs485"},
    {"serial10", "10-byte protocol", "rs485"},
});

struct MessageNote {
  std::string_view group, name, text, clause;
};

constexpr auto message_notes = std::to_array<MessageNote>({
    {"canopen", "sdo_answer", "SDO answer", "CiA 301 7.2.4.2"},
    {"canopen", "sdo_request", "SDO request", "CiA 301 7.2.4.3.3"},
    {"canopen", "tpdo", "any TPDO", "CiA 301 7.2.2.2"},
    {"canopen", "tpdo1", "TPDO 1", "CiA 301 7.2.2.2"},
    {"canopen", "tpdo2", "TPDO 2", "CiA 301 7.2.2.2"},
    {"canopen", "tpdo3", "TPDO 3", "CiA 301 7.2.2.2"},
    {"canopen", "tpdo4", "TPDO 4", "CiA 301 7.2.2.2"},
    {"canopen", "rpdo", "any RPDO", "CiA 301 7.2.2.2"},
    {"canopen", "rpdo1", "RPDO 1", "CiA 301 7.2.2.2"},
    {"canopen", "rpdo2", "RPDO 2", "CiA 301 7.2.2.2"},
    {"canopen", "rpdo3", "RPDO 3", "CiA 301 7.2.2.2"},
    {"canopen", "rpdo4", "RPDO 4", "CiA 301 7.2.2.2"},
    {"canopen", "heartbeat", "heartbeat", "CiA 301 7.2.8.3.2.2"},
    {"canopen", "boot_up", "boot-up message", "CiA 301 7.2.8.3.3"},
    {"canopen", "emergency", "emergency", "CiA 301 7.2.7"},
    {"canopen", "nmt", "NMT command", "CiA 301 7.2.8.3.1"},
    {"canopen", "sync", "SYNC", "CiA 301 7.2.5"},
    {"canopen", "time", "TIME", "CiA 301 7.2.6"},
    {"canopen", "lss_answer", "LSS answer", "CiA 305"},
    {"canopen", "lss_request", "LSS request", "CiA 305"},
    {"canopen", "from_drive", "any frame of the drive", "CiA 301 7.2"},
    {"canopen", "to_drive", "any frame to the drive", "CiA 301 7.2"},
    {"ethercat", "sdo_answer", "SDO answer", "ETG.1000.6 5.6.2"},
    {"ethercat", "sdo_request", "SDO request", "ETG.1000.6 5.6.2"},
    {"ethercat", "emergency", "emergency", "ETG.1000.6 5.6.4"},
    {"ethercat", "mailbox_answer", "any mailbox answer", "ETG.1000.4 5.6"},
    {"ethercat", "mailbox_request", "any mailbox request", "ETG.1000.4 5.6"},
    {"ethercat", "cycle", "frame with process data", "ETG.1000.4 5.3, 5.4"},
    {"ethercat", "frame", "any frame", "ETG.1000.4 5.3"},
    {"modbus", "answer", "answer", "MODBUS over Serial Line V1.02, 2.4.1"},
    {"modbus", "request", "request", "MODBUS over Serial Line V1.02, 2.4.1"},
    {"serial10", "answer", "answer", "iSMK manual, ch. 8.4.1"},
    {"serial10", "request", "request", "iSMK manual, ch. 8.4.1"},
});

struct ActionText {
  std::string_view name, text;
};

constexpr auto texts = std::to_array<ActionText>({
    {"withhold", "The message is missing."},
    {"delay", "The message comes later."},
    {"repeat", "The message comes again; the copies may be changed."},
    {"alter", "Bytes or the identifier of the message are wrong."},
    {"replace", "Other bytes come in place of the message."},
    {"truncate", "Only the first bytes of the message come."},
    {"extend", "Further bytes come behind the message, or before it."},
    {"abort", "A refusal comes in place of the message. A refused request is not executed."},
    {"withhold_answer", "The frame passes the slaves and is lost on its way back."},
    {"twice", "The frame passes the slaves twice."},
    {"working_counter", "The working counter of the frame is wrong."},
    {"stale", "The frame brings the data of the cycle before."},
    {"slow", "The characters of the answer come with pauses."},
    {"close", "The connection closes in the middle of the answer (TCP)."},
    {"send", "Bytes come that no drive has sent."},
    {"babble", "A node fills the bus with its frames."},
    {"accept", "Connections are refused (TCP)."},
    {"cable", "The cable is cut."},
    {"error_state", "The CAN controller of the drive is error passive, or bus-off."},
    {"show", "The bus sees another value of the object. The drive keeps the true value."},
    {"ignore", "The drive accepts writes to the object, and they have no effect."},
    {"hold", "Writes to the object have their effect later."},
    {"set", "The drive writes its own object, also a read-only one."},
    {"power", "The drive loses its power."},
    {"inject", "A fault of the drive or of the machine."},
    {"input", "A digital input has a level that its switch does not have."},
    {"plant", "A quantity of the machine changes: load_torque_nm, supply_v, locked_rotor ..."},
    {"emergency", "An emergency message comes without a fault."},
    {"al_refuse", "The slave refuses a state change with an AL status code."},
    {"al_drop", "The slave falls back into a lower state without a request."},
    {"sii", "A word of the slave information is wrong."},
    {"clock", "The slave's clock jumps, drifts or stops."},
    {"sync0", "SYNC0 is missing, doubled or late."},
    {"stale_inputs", "The slave does not update its inputs."},
    {"watchdog", "The slave's process data watchdog never trips."},
});

// `use` tells how a rule with the action ends: `message`, it acts on messages and can end after one; `once`, it ends by
// itself after one act; `lasts`, its effect lasts until the rule is removed.
struct ActionNote {
  std::string_view group, name, use;
  std::string_view clause;    // empty: the clause of the message
  std::string_view example;   // values to begin with: "key=value; key=value"
  std::string_view messages;  // the messages that it can act on; empty: all messages of the group
};

constexpr auto actions = std::to_array<ActionNote>({
    {"canopen", "abort", "message", "CiA 301 7.2.4.3.17, table 22", "code=0x08000022", "sdo_answer sdo_request"},
    {"canopen", "withhold", "message", "", "", ""},
    {"canopen", "delay", "message", "", "ms=50", ""},
    {"canopen", "repeat", "message", "", "copies=1", ""},
    {"canopen", "alter", "message", "", "byte=-1; xor=0xFF", ""},
    {"canopen", "replace", "message", "", "data=80 00 00 00 00 00 00 08", ""},
    {"canopen", "truncate", "message", "", "length=4", ""},
    {"canopen", "extend", "message", "", "data=00", ""},
    {"canopen", "send", "once", "CiA 301 7.2, pre-defined connection set", "id=0x701; data=05", ""},
    {"canopen", "emergency", "once", "CiA 301 7.2.7", "code=0x1000", ""},
    {"canopen", "babble", "lasts", "ISO 11898-1, arbitration", "id=0", ""},
    {"canopen", "error_state", "lasts", "ISO 11898-1, fault confinement", "state=passive", ""},
    {"canopen", "cable", "lasts", "ISO 11898-1, fault confinement", "", ""},
    {"cia402", "show", "lasts", "CiA 402-2, object 6041h", "object=6041; set_bits=0x8", ""},
    {"cia402", "ignore", "lasts", "CiA 402-2, FSA, table of transitions", "object=6040; mask=0x8", ""},
    {"cia402", "hold", "lasts", "CiA 402-2, FSA, table of transitions", "object=6040; ms=500", ""},
    {"cia402", "set", "once", "CiA 402-2, FSA, table of transitions", "object=6081; value=0", ""},
    {"cia402", "inject", "lasts", "CiA 402-2, object 603Fh", "fault=encoder_loss", ""},
    {"cia402", "input", "lasts", "CiA 402-2, homing mode, statusword bit 13", "wire=DI0; level=true", ""},
    {"cia402", "plant", "once", "CiA 402-2, objects 6065h, 6066h", "key=load_torque_nm; value=0.5", ""},
    {"cia402", "power", "lasts", "CiA 402-2, FSA, transition 13", "on=false", ""},
    {"ethercat", "abort", "message", "ETG.1000.6 5.6.2, table 41", "code=0x08000022", "sdo_answer sdo_request"},
    {"ethercat", "withhold", "message", "", "", ""},
    {"ethercat", "withhold_answer", "message", "ETG.1000.4 5.3", "", "cycle frame"},
    {"ethercat", "twice", "message", "ETG.1000.4 5.3, 5.4", "", "cycle frame"},
    {"ethercat", "working_counter", "message", "ETG.1000.4 5.4, 6.5, 6.6", "add=-1", "cycle frame"},
    {"ethercat", "stale", "message", "ETG.1000.4 6.6; ETG.1020 17", "", "cycle frame"},
    {"ethercat", "delay", "message", "", "ms=5", ""},
    {"ethercat", "repeat", "message", "", "copies=1", ""},
    {"ethercat", "alter", "message", "", "byte=-1; xor=0xFF", ""},
    {"ethercat", "replace", "message", "", "data=00 00", ""},
    {"ethercat", "truncate", "message", "", "length=16", ""},
    {"ethercat", "extend", "message", "", "data=00", ""},
    {"ethercat", "emergency", "once", "ETG.1000.6 5.6.4", "code=0x1000", ""},
    {"ethercat", "al_refuse", "lasts", "ETG.1000.6 6.4.1; ETG.1020 table 11", "to=operational; code=0x001D", ""},
    {"ethercat", "al_drop", "once", "ETG.1000.6 6.4.1; ETG.1020 table 11", "to=safe_operational; code=0x001A", ""},
    {"ethercat", "stale_inputs", "lasts", "ETG.1000.4 6.6, three-buffer mode", "", ""},
    {"ethercat", "sync0", "lasts", "ETG.1000.4 6.7; ETG.1020 17", "how=missing", ""},
    {"ethercat", "clock", "lasts", "ETG.1000.4 6.7; ETG.1020 23", "stop=true", ""},
    {"ethercat", "watchdog", "lasts", "ETG.1000.4 6.3", "on=false", ""},
    {"ethercat", "sii", "once", "ETG.1000.4 6.4; ETG.1000.6 5.4, table 16", "word=10; value=0", ""},
    {"ethercat", "cable", "lasts", "ETG.1000.3 4; ETG.1000.4 6.1, DL status", "", ""},
    {"modbus", "abort", "message", "MODBUS Application Protocol V1.1b3, 7", "code=6", ""},
    {"modbus", "withhold", "message", "", "", ""},
    {"modbus", "delay", "message", "MODBUS over Serial Line V1.02, 2.4.1", "ms=50", "answer"},
    {"modbus", "repeat", "message", "MODBUS over Serial Line V1.02, 2.4.1", "copies=1", "answer"},
    {"modbus", "alter", "message", "MODBUS over Serial Line V1.02, 2.5.1.2", "byte=-1; xor=0xFF", ""},
    {"modbus", "replace", "message", "MODBUS Application Protocol V1.1b3, 6.3", "data=00 00", ""},
    {"modbus", "truncate", "message", "MODBUS over Serial Line V1.02, 2.5.1.1", "length=3", ""},
    {"modbus", "extend", "message", "MODBUS over Serial Line V1.02, 2.5.1.1", "data=00", ""},
    {"modbus", "slow", "message", "MODBUS over Serial Line V1.02, 2.5.1.1, t1.5 and t3.5", "gap_ms=10", "answer"},
    {"modbus", "close", "message", "MODBUS Messaging on TCP/IP V1.0b, 4.2", "length=5", "answer"},
    {"modbus", "send", "once", "MODBUS over Serial Line V1.02, 2.5.1.1", "data=55", ""},
    {"modbus", "accept", "lasts", "MODBUS Messaging on TCP/IP V1.0b, 4.2", "on=false", ""},
    {"modbus", "cable", "lasts", "MODBUS over Serial Line V1.02, 3", "", ""},
    {"serial10", "abort", "message", "iSMK manual, ch. 8.4.2", "code=0x06020000", ""},
    {"serial10", "withhold", "message", "", "", ""},
    {"serial10", "delay", "message", "", "ms=50", "answer"},
    {"serial10", "repeat", "message", "", "copies=1", "answer"},
    {"serial10", "alter", "message", "", "byte=-1; xor=0xFF", ""},
    {"serial10", "replace", "message", "", "data=00 00", ""},
    {"serial10", "truncate", "message", "", "length=5", ""},
    {"serial10", "extend", "message", "", "data=00", ""},
    {"serial10", "slow", "message", "", "gap_ms=10", "answer"},
    {"serial10", "send", "once", "iSMK manual, ch. 8.4.1", "data=55", ""},
    {"serial10", "cable", "lasts", "iSMK manual, ch. 8.2", "", ""},
});

// The values of an example by their keys, as texts.
Json values_of(std::string_view example) {
  Json values = Json::object();
  while (!example.empty()) {
    const std::size_t end = std::min(example.find("; "), example.size());
    const std::string_view one = example.substr(0, end);
    const std::size_t equals = one.find('=');
    values[std::string(one.substr(0, equals))] = one.substr(equals + 1);
    example.remove_prefix(std::min(end + 2, example.size()));
  }
  return values;
}

// The keys that only this action has. The key `on` is common to all rules and selects messages, but in some actions it
// is a switch.
std::vector<line::KeyNote> own_keys(const FormatKeys& keys, std::string_view action) {
  const auto& common = keys.tables.at("rule");
  std::vector<line::KeyNote> own = keys.actions.find(std::string(action))->second;
  std::erase_if(own, [&common](const line::KeyNote& note) {
    return std::any_of(common.begin(), common.end(), [&note](const line::KeyNote& other) {
      return note.key == other.key && note.kind == other.kind;
    });
  });
  return own;
}

std::string_view action_text(std::string_view action) {
  const auto* const found =
      std::find_if(texts.begin(), texts.end(), [action](const ActionText& text) { return text.name == action; });
  return found != texts.end() ? found->text : std::string_view{};
}

// Returns true if a rule with this action or message names a bus instead of an axis.
bool is_of_bus(std::string_view word) {
  constexpr auto words = std::to_array<std::string_view>({"send", "babble", "accept", "cycle", "frame"});
  return std::find(words.begin(), words.end(), word) != words.end();
}

Json actions_of(const Group& group, const FormatKeys& keys) {
  Json found = Json::array();
  for (const ActionNote& note : actions) {
    if (note.group != group.name) continue;
    found.push_back({{"do", note.name},
                     {"text", action_text(note.name)},
                     {"use", note.use},
                     {"of_bus", is_of_bus(note.name)},
                     {"clause", note.clause},
                     {"messages", note.messages},
                     {"keys", properties_of(own_keys(keys, note.name))},
                     {"example", values_of(note.example)}});
  }
  return found;
}

Json messages_of(const Group& group) {
  Json found = Json::array();
  for (const MessageNote& note : message_notes) {
    if (note.group != group.name) continue;
    found.push_back(
        {{"message", note.name}, {"text", note.text}, {"of_bus", is_of_bus(note.name)}, {"clause", note.clause}});
  }
  return found;
}

// The keys of `table` with these names.
Json chosen(const FormatKeys& keys, const std::string& table, const std::vector<std::string_view>& names) {
  const Json all = properties_of(keys.tables.at(table));
  Json found = Json::object();
  for (const std::string_view name : names) found[std::string(name)] = all.at(std::string(name));
  return found;
}

}  // namespace

nlohmann::ordered_json action_catalogue() {
  const FormatKeys keys = format_keys();
  Json found = Json::array();
  for (const Group& group : groups) {
    found.push_back({{"name", group.name},
                     {"title", group.title},
                     {"bus", group.bus},
                     {"messages", messages_of(group)},
                     {"actions", actions_of(group, keys)}});
  }
  return {{"groups", found},
          {"message", chosen(keys, "message", {"object", "data", "function", "command", "address"})},
          {"rule", chosen(keys, "rule", {"skip", "every", "chance", "checksum"})},
          {"when", chosen(keys, "condition", {"state", "speed_above_rpm", "position_above", "position_below"})}};
}

}  // namespace servodrome::scenario
