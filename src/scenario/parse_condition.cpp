#include <cmath>
#include <fmt/format.h>

#include "ethercat/frame/datagram.hpp"
#include "links/number_text.hpp"
#include "scenario/parse_parts.hpp"
#include "scenario/words.hpp"

namespace servodrome::scenario {
namespace {

constexpr auto message_words = std::to_array<Word<MessageKind>>({
    {"sdo_answer", MessageKind::sdo_answer},
    {"sdo_request", MessageKind::sdo_request},
    {"tpdo", MessageKind::tpdo},
    {"tpdo1", MessageKind::tpdo1},
    {"tpdo2", MessageKind::tpdo2},
    {"tpdo3", MessageKind::tpdo3},
    {"tpdo4", MessageKind::tpdo4},
    {"rpdo", MessageKind::rpdo},
    {"rpdo1", MessageKind::rpdo1},
    {"rpdo2", MessageKind::rpdo2},
    {"rpdo3", MessageKind::rpdo3},
    {"rpdo4", MessageKind::rpdo4},
    {"heartbeat", MessageKind::heartbeat},
    {"boot_up", MessageKind::boot_up},
    {"emergency", MessageKind::emergency},
    {"nmt", MessageKind::nmt},
    {"sync", MessageKind::sync},
    {"time", MessageKind::time},
    {"lss_answer", MessageKind::lss_answer},
    {"lss_request", MessageKind::lss_request},
    {"from_drive", MessageKind::from_drive},
    {"to_drive", MessageKind::to_drive},
    {"mailbox_answer", MessageKind::mailbox_answer},
    {"mailbox_request", MessageKind::mailbox_request},
    {"cycle", MessageKind::cycle},
    {"frame", MessageKind::frame},
    {"answer", MessageKind::answer},
    {"request", MessageKind::request},
});

constexpr auto state_words = std::to_array<Word<drive::PowerState>>({
    {"not_ready_to_switch_on", drive::PowerState::not_ready_to_switch_on},
    {"switch_on_disabled", drive::PowerState::switch_on_disabled},
    {"ready_to_switch_on", drive::PowerState::ready_to_switch_on},
    {"switched_on", drive::PowerState::switched_on},
    {"operation_enabled", drive::PowerState::operation_enabled},
    {"quick_stop_active", drive::PowerState::quick_stop_active},
    {"fault_reaction_active", drive::PowerState::fault_reaction_active},
    {"fault", drive::PowerState::fault},
});

constexpr auto nmt_words = std::to_array<Word<canopen::NmtState>>({
    {"initialising", canopen::NmtState::initialising},
    {"stopped", canopen::NmtState::stopped},
    {"operational", canopen::NmtState::operational},
    {"pre_operational", canopen::NmtState::pre_operational},
});

constexpr auto al_words = std::to_array<Word<ethercat::AlState>>({
    {"init", ethercat::AlState::init},
    {"pre_operational", ethercat::AlState::pre_operational},
    {"bootstrap", ethercat::AlState::bootstrap},
    {"safe_operational", ethercat::AlState::safe_operational},
    {"operational", ethercat::AlState::operational},
});

// The commands of datagrams (ETG.1000.4 clause 5.4).
constexpr auto command_words = std::to_array<Word<std::uint8_t>>({
    {"NOP", 0},
    {"APRD", 1},
    {"APWR", 2},
    {"APRW", 3},
    {"FPRD", 4},
    {"FPWR", 5},
    {"FPRW", 6},
    {"BRD", 7},
    {"BWR", 8},
    {"BRW", 9},
    {"LRD", 10},
    {"LWR", 11},
    {"LRW", 12},
    {"ARMW", 13},
    {"FRMW", 14},
});

constexpr auto exit_words = std::to_array<Word<bool>>({{"success", true}, {"failure", false}});

}  // namespace

std::string_view name_of(MessageKind kind) { return word_of(message_words, kind); }

std::optional<Time> read_time_ms(line::TableReader& reader, std::string_view key) {
  double ms = 0;
  reader.read(key, ms);
  if (reader.node(key) == nullptr) return std::nullopt;
  if (ms < 0 || ms > 1e9) {
    reader.complain(key, fmt::format("{} is out of range", ms), "expected 0 .. 1e9 milliseconds");
    return std::nullopt;
  }
  return Time(std::llround(ms * 1e6));
}

std::optional<ObjectAddress> read_object(line::TableReader& reader, std::string_view key) {
  std::string text;
  reader.read(key, text);
  if (text.empty()) return std::nullopt;
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string_view all = text;
  const auto index = links::number_of_text<std::uint16_t>(all.substr(0, colon), 16);
  std::optional<std::uint8_t> sub;
  if (colon < text.size()) sub = links::number_of_text<std::uint8_t>(all.substr(colon + 1), 16);
  if (!index || (colon < text.size() && !sub)) {
    reader.complain(key, fmt::format("\"{}\" is no object", text), "write \"6040\" or \"6040:01\", hexadecimal");
    return std::nullopt;
  }
  return ObjectAddress{*index, sub};
}

std::optional<std::vector<std::optional<std::uint8_t>>> read_bytes(line::TableReader& reader, std::string_view key,
                                                                   bool gaps) {
  std::string text;
  reader.read(key, text);
  if (reader.node(key) == nullptr) return std::nullopt;
  std::vector<std::optional<std::uint8_t>> bytes;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    const std::string_view word = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (word.empty()) continue;
    const auto byte = links::number_of_text<std::uint8_t>(word, 16);
    if (!byte && !(gaps && word == "??")) {
      reader.complain(key, fmt::format("\"{}\" is no byte", word),
                      gaps ? "write two hexadecimal digits for each byte, ?? for any: \"2B ?? 60\""
                           : "write two hexadecimal digits for each byte: \"2B 40 60\"");
      return std::nullopt;
    }
    bytes.push_back(byte);
  }
  return bytes;
}

MessagePattern read_pattern(const toml::table& table, const std::string& path, line::FileReport& report) {
  line::TableReader reader(table, path, report);
  MessagePattern pattern;
  if (const auto kind = read_word(reader, "message", message_words)) {
    pattern.kind = *kind;
  } else if (table.get("message") == nullptr) {
    reader.complain("message", "is missing", "name a kind of message, such as \"sdo_answer\" or \"cycle\"");
  }
  pattern.object = read_object(reader, "object");
  reader.read("id", pattern.id, 0, 0x1FFFFFFF);
  reader.read("id_mask", pattern.id_mask, 0, 0x1FFFFFFF);
  if (auto data = read_bytes(reader, "data", true)) pattern.data = std::move(*data);
  for (const auto& byte : read_bytes(reader, "data_mask", false).value_or(std::vector<std::optional<std::uint8_t>>{})) {
    pattern.data_mask.push_back(byte.value_or(0xFF));
  }
  reader.read("function", pattern.function, 0, 255);
  pattern.command = read_word(reader, "command", command_words);
  reader.read("address", pattern.address, 0, 0xFFFF);
  reader.finish();
  return pattern;
}

Condition read_condition(const toml::table& table, const std::string& path, line::FileReport& report) {
  line::TableReader reader(table, path, report);
  Condition condition;
  condition.time = read_time_ms(reader, "time_ms");
  reader.read("after", condition.after);
  if (const auto delay = read_time_ms(reader, "after_ms")) {
    condition.after_delay = *delay;
    if (condition.after.empty()) reader.complain("after_ms", "needs `after`", "name the rule: after = \"NAME\"");
  }
  condition.state = read_word(reader, "state", state_words);
  condition.nmt = read_word(reader, "nmt", nmt_words);
  condition.al = read_word(reader, "al", al_words);
  reader.read("mode", condition.mode, -128, 127);
  reader.read("homing_leg", condition.homing_leg, 0, 255);
  reader.read("at_rest", condition.at_rest);
  reader.read("position_above", condition.position_above);
  reader.read("position_below", condition.position_below);
  reader.read("speed_above_rpm", condition.speed_above);
  reader.read("speed_below_rpm", condition.speed_below);
  reader.read("moved_above", condition.moved_above);
  reader.read("travelled_above", condition.travelled_above);
  reader.read("torque_above", condition.torque_above);
  condition.object = read_object(reader, "object");
  std::optional<std::int64_t> mask, value;
  reader.read("mask", mask);
  reader.read("value", value);
  if (condition.object && !value) reader.complain("value", "is missing", "give the value of the object");
  if (!condition.object && (mask || value)) {
    reader.complain(mask ? "mask" : "value", "needs `object`", "name one: object = \"6041\"");
  }
  condition.mask = mask.value_or(-1);
  condition.value = value.value_or(0);
  reader.read("powered", condition.powered);
  reader.read("axis", condition.axis);
  condition.ended = read_time_ms(reader, "ended_ms");
  reader.read("fault_resets_above", condition.fault_resets_above, 0, 1'000'000);
  reader.read("repeats_above", condition.repeats_above, 0, 1'000'000);
  reader.read("set_point_jumped", condition.set_point_jumped);
  condition.success = read_word(reader, "exit", exit_words);
  if (const toml::table* message = reader.table("message", "message")) {
    condition.message = read_pattern(*message, path + ".message", report);
  }
  std::optional<unsigned> count;
  reader.read("count", count, 1, 1'000'000'000);
  if (count && !condition.message) reader.complain("count", "needs `message`", "say which messages it counts");
  condition.count = count.value_or(1);
  reader.finish();
  return condition;
}

}  // namespace servodrome::scenario
