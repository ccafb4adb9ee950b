#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "scenario/parse_parts.hpp"
#include "scenario/words.hpp"

namespace servodrome::scenario {
namespace {

using line::TableReader;
using nlohmann::json;

constexpr auto target_state_words = std::to_array<Word<ethercat::AlState>>({
    {"init", ethercat::AlState::init},
    {"pre_operational", ethercat::AlState::pre_operational},
    {"safe_operational", ethercat::AlState::safe_operational},
    {"operational", ethercat::AlState::operational},
});
// The states into which a slave falls back: those below Operational.
constexpr std::array lower_state_words{target_state_words[0], target_state_words[1], target_state_words[2]};
constexpr auto error_state_words = std::to_array<Word<links::ErrorState>>({
    {"active", links::ErrorState::active},
    {"passive", links::ErrorState::passive},
    {"bus_off", links::ErrorState::bus_off},
});

// The least and the greatest value of a key.
using KeyRange = std::pair<std::int64_t, std::int64_t>;
template <typename How>
KeyRange any_number(How) {
  return {INT64_MIN, INT64_MAX};
}

// Reads one of the keys of `words`, all integers. Returns which one it is, and its value.
template <typename How, std::size_t Count>
std::optional<std::pair<How, std::int64_t>> read_one(TableReader& reader, const std::array<Word<How>, Count>& words,
                                                     bool required, KeyRange (*range)(How) = any_number<How>) {
  std::optional<std::pair<How, std::int64_t>> found;
  std::string names;
  for (const auto& word : words) {
    names += (names.empty() ? "" : ", ") + std::string(word.name);
    std::optional<std::int64_t> number;
    const auto [least, most] = range(word.value);
    reader.read(word.name, number, least, most);
    if (!number) continue;
    if (found) {
      reader.complain(word.name, "comes with another key of its kind", "give one of them");
      return std::nullopt;
    }
    found = {word.value, *number};
  }
  if (!found && required) reader.complain("do", "does not say what it does", fmt::format("give one of {}", names));
  return found;
}

bool flag(TableReader& reader, std::string_view key, bool otherwise) {
  bool value = otherwise;
  reader.read(key, value);
  return value;
}

ObjectAddress required_object(TableReader& reader) {
  const auto object = read_object(reader, "object");
  if (reader.node("object") == nullptr) {
    reader.complain("object", "is missing", "name it: object = \"6041\" or \"1018:01\"");
  }
  return object.value_or(ObjectAddress{});
}

Time required_time(TableReader& reader, std::string_view key) {
  if (reader.node(key) == nullptr) reader.complain(key, "is missing", "give the time in milliseconds");
  return read_time_ms(reader, key).value_or(Time{});
}

std::vector<std::uint8_t> plain_bytes(TableReader& reader, std::string_view key, bool required) {
  std::vector<std::uint8_t> bytes;
  const auto read = read_bytes(reader, key, false);
  if (required && reader.node(key) == nullptr) reader.complain(key, "is missing", "give the bytes: \"80 40 60\"");
  for (const auto& byte : read.value_or(std::vector<std::optional<std::uint8_t>>{})) {
    bytes.push_back(byte.value_or(0));
  }
  return bytes;
}

// Of a byte, except for the place of the byte to swap with. The longest message is a frame of 1500 bytes.
KeyRange range_of(Alter::How how) {
  switch (how) {
    case Alter::How::add: return {-UINT8_MAX, UINT8_MAX};
    case Alter::How::swap: return {0, 1499};
    default: return {0, UINT8_MAX};
  }
}

Alter read_alter(TableReader& reader, bool required) {
  constexpr auto hows = std::to_array<Word<Alter::How>>(
      {{"set", Alter::How::set}, {"xor", Alter::How::flip}, {"add", Alter::How::add}, {"swap", Alter::How::swap}});
  Alter alter;
  reader.read("byte", alter.byte, -1500, 1500);
  if (const auto one = read_one(reader, hows, alter.byte.has_value(), range_of)) {
    alter.how = one->first;
    alter.value = static_cast<std::uint16_t>(one->second);
    if (!alter.byte) reader.complain("byte", "is missing", "say which byte is changed, from 0");
  }
  if (auto bytes = read_bytes(reader, "bytes", true)) alter.bytes = std::move(*bytes);
  reader.read("id", alter.id, 0, 0x1FFFFFFF);
  if (required && !alter.byte && alter.bytes.empty() && !alter.id) {
    reader.complain("do", "does not say what it changes", "give byte with set, xor, add or swap, or bytes, or id");
  }
  return alter;
}

Action read_send(TableReader& reader) {
  Send send;
  reader.read("id", send.id, 0, 0x1FFFFFFF);
  send.data = plain_bytes(reader, "data", false);
  send.period = read_time_ms(reader, "period_ms").value_or(std::chrono::milliseconds(1));
  if (send.period < std::chrono::microseconds(50)) {
    reader.complain("period_ms", "is too short", "expected 0.05 or more");
  }
  return send;
}

Action read_babble(TableReader& reader) {
  Send send;
  reader.read("id", send.id, 0, 0x1FFFFFFF);
  send.period = std::chrono::microseconds(50);
  send.continuous = true;
  return send;
}

Action read_set(TableReader& reader) {
  SetObject set{required_object(reader), 0};
  reader.read("value", set.value);
  return set;
}

Action read_show(TableReader& reader) {
  using How = Show::How;
  constexpr auto numbers = std::to_array<Word<How>>({{"value", How::value},
                                                     {"set_bits", How::set_bits},
                                                     {"clear_bits", How::clear_bits},
                                                     {"flip_bits", How::flip_bits},
                                                     {"add", How::add},
                                                     {"drift_per_s", How::drift}});
  Show show;
  show.object = required_object(reader);
  const bool freeze = flag(reader, "freeze", false);
  const bool negate = flag(reader, "negate", false);
  const auto late = read_time_ms(reader, "late_ms");
  const auto period = read_time_ms(reader, "period_ms");
  const int others = (freeze ? 1 : 0) + (negate ? 1 : 0) + (late ? 1 : 0);
  const auto one = read_one(reader, numbers, others == 0);
  if (others + (one ? 1 : 0) > 1) reader.complain("do", "shows several things", "give one of them");
  if (freeze) show.how = How::freeze;
  if (negate) show.how = How::negate;
  if (late) {
    show.how = How::late;
    show.time = *late;
  }
  if (one) {
    show.how = one->first;
    show.number = one->second;
  }
  if (show.how == How::flip_bits) {
    show.time = period.value_or(Time{});
    if (show.time <= Time{}) reader.complain("period_ms", "is missing, or 0", "give the time in milliseconds");
  } else if (period) {
    reader.complain("period_ms", "belongs to flip_bits", "leave it out");
  }
  reader.read("mask", show.mask);
  return show;
}

Action read_hold(TableReader& reader) {
  const ObjectAddress object = required_object(reader);
  return Hold{object, required_time(reader, "ms")};
}

Action read_ignore(TableReader& reader) {
  Ignore ignore{required_object(reader)};
  reader.read("mask", ignore.mask);
  return ignore;
}

Action read_power(TableReader& reader) { return Switch{Switch::What::power, "", flag(reader, "on", false)}; }

Action read_inject(TableReader& reader) {
  std::string fault;
  reader.read("fault", fault);
  if (fault.empty()) {
    reader.complain("fault", "is missing", "name one: fault = \"encoder_loss\"; docs/scenario.md describes `inject`");
  }
  return Switch{Switch::What::fault, fault, true};
}

Action read_input(TableReader& reader) {
  std::string wire;
  reader.read("wire", wire);
  if (wire.empty()) reader.complain("wire", "is missing", "name an input: wire = \"DI0\"");
  const bool level = flag(reader, "level", true);
  return Switch{Switch::What::input, wire, level};
}

Action read_plant(TableReader& reader) {
  std::string key;
  reader.read("key", key);
  if (key.empty()) reader.complain("key", "is missing", "for example key = \"load_torque_nm\"");
  if (key.empty() || key == "locked_rotor") {
    const bool value = flag(reader, "value", true);
    if (!key.empty()) return Switch{Switch::What::locked_rotor, "", value};
  }
  double value = 0;
  reader.read("value", value);
  return Request{"PUT", "/plant", json{{key, value}}.dump()};
}

std::uint16_t al_code(TableReader& reader) {
  std::uint16_t code = 0;
  reader.read("code", code, 0, 0xFFFF);
  if (reader.node("code") == nullptr) reader.complain("code", "is missing", "give an AL status code: 0x001E");
  return code;
}

Action read_refuse(TableReader& reader) {
  RefuseState refuse;
  if (const auto to = read_word(reader, "to", target_state_words)) refuse.to = *to;
  refuse.code = al_code(reader);
  return refuse;
}

Action read_drop(TableReader& reader) {
  DropState drop;
  if (const auto to = read_word(reader, "to", lower_state_words)) drop.to = *to;
  drop.code = al_code(reader);
  return drop;
}

Action read_clock(TableReader& reader) {
  DisturbClock clock;
  reader.read("jump_ns", clock.jump_ns);
  reader.read("ppm", clock.ppm);
  if (std::abs(clock.ppm.value_or(0)) > 100'000) {
    reader.complain("ppm", "is out of range", "expected -100000 .. 100000");
  }
  reader.read("stop", clock.stop);
  return clock;
}

Action read_sync0(TableReader& reader) {
  DisturbSync0 sync0;
  constexpr auto hows = std::to_array<Word<DisturbSync0::How>>({{"missing", DisturbSync0::How::missing},
                                                                {"twice", DisturbSync0::How::twice},
                                                                {"late", DisturbSync0::How::late}});
  if (const auto how = read_word(reader, "how", hows)) sync0.how = *how;
  std::optional<std::int64_t> late_us;
  reader.read("late_us", late_us, 1, 1'000'000);
  if (!late_us) {
    if (sync0.how == DisturbSync0::How::late) reader.complain("late_us", "is missing", "give the time in microseconds");
    return sync0;
  }
  if (reader.node("how") != nullptr && sync0.how != DisturbSync0::How::late) {
    reader.complain("late_us", "belongs to late", "leave it out, or write how = \"late\"");
  }
  sync0.how = DisturbSync0::How::late;
  sync0.late = std::chrono::microseconds(*late_us);
  return sync0;
}

// Where an action acts.
enum class Scope : std::uint8_t { messages, bus, axis };

struct ActionRow {
  std::string_view name;
  Scope scope;
  Action (*read)(TableReader& reader);
};

constexpr auto action_table = std::to_array<ActionRow>({
    {"withhold", Scope::messages, [](TableReader&) -> Action { return Withhold{}; }},
    {"delay", Scope::messages,
     [](TableReader& reader) -> Action {
       Delay delay;
       reader.read("frames", delay.frames, 1, 1000);
       const bool by_frames = reader.node("frames") != nullptr;
       if (!by_frames) delay.time = required_time(reader, "ms");
       delay.jitter = read_time_ms(reader, "jitter_ms").value_or(Time{});
       if (by_frames && delay.jitter > Time{}) {
         reader.complain("jitter_ms", "belongs to `ms`", "leave it out, or give the time in place of `frames`");
       }
       return delay;
     }},
    {"repeat", Scope::messages,
     [](TableReader& reader) -> Action {
       Repeat repeat;
       reader.read("copies", repeat.copies, 1, 1000);
       repeat.gap = read_time_ms(reader, "gap_ms").value_or(Time{});
       repeat.alter = read_alter(reader, false);
       return repeat;
     }},
    {"alter", Scope::messages, [](TableReader& reader) -> Action { return read_alter(reader, true); }},
    {"replace", Scope::messages,
     [](TableReader& reader) -> Action { return Replace{plain_bytes(reader, "data", true)}; }},
    {"truncate", Scope::messages,
     [](TableReader& reader) -> Action {
       Truncate truncate;
       reader.read("length", truncate.length, 0, 1500);
       return truncate;
     }},
    {"extend", Scope::messages,
     [](TableReader& reader) -> Action {
       Extend extend;
       extend.data = plain_bytes(reader, "data", true);
       extend.before = flag(reader, "before", false);
       extend.gap = read_time_ms(reader, "gap_ms").value_or(Time{});
       if (extend.gap > Time{} && !extend.before) {
         reader.complain("gap_ms", "is for data in front of the message", "add before = true");
       }
       return extend;
     }},
    {"abort", Scope::messages,
     [](TableReader& reader) -> Action {
       Abort abort;
       reader.read("code", abort.code, 0, UINT32_MAX);
       if (reader.node("code") == nullptr) reader.complain("code", "is missing", "give an abort code: 0x08000022");
       return abort;
     }},
    {"withhold_answer", Scope::messages, [](TableReader&) -> Action { return WithholdAnswer{}; }},
    {"twice", Scope::messages, [](TableReader&) -> Action { return Twice{}; }},
    {"working_counter", Scope::messages,
     [](TableReader& reader) -> Action {
       WorkingCounter counter;
       reader.read("add", counter.add, -65535, 65535);
       return counter;
     }},
    {"stale", Scope::messages, [](TableReader&) -> Action { return Stale{}; }},
    {"slow", Scope::messages, [](TableReader& reader) -> Action { return Slow{required_time(reader, "gap_ms")}; }},
    {"close", Scope::messages,
     [](TableReader& reader) -> Action {
       Close close;
       reader.read("length", close.length, 0, 1500);
       return close;
     }},
    {"send", Scope::bus, read_send},
    {"babble", Scope::bus, read_babble},
    {"accept", Scope::bus, [](TableReader& reader) -> Action { return Accept{flag(reader, "on", false)}; }},
    {"cable", Scope::axis,
     [](TableReader& reader) -> Action {
       Cable cable;
       reader.read("connected", cable.connected);
       return cable;
     }},
    {"error_state", Scope::axis,
     [](TableReader& reader) -> Action {
       return ForceErrorState{read_word(reader, "state", error_state_words).value_or(links::ErrorState::passive)};
     }},
    {"show", Scope::axis, read_show},
    {"ignore", Scope::axis, read_ignore},
    {"hold", Scope::axis, read_hold},
    {"set", Scope::axis, read_set},
    {"power", Scope::axis, read_power},
    {"inject", Scope::axis, read_inject},
    {"input", Scope::axis, read_input},
    {"plant", Scope::axis, read_plant},
    {"emergency", Scope::axis,
     [](TableReader& reader) -> Action {
       Emergency emergency;
       reader.read("code", emergency.code, 0, 0xFFFF);
       reader.read("register", emergency.error_register, 0, 255);
       emergency.period = read_time_ms(reader, "period_ms").value_or(std::chrono::milliseconds(1));
       return emergency;
     }},
    {"al_refuse", Scope::axis, read_refuse},
    {"al_drop", Scope::axis, read_drop},
    {"sii", Scope::axis,
     [](TableReader& reader) -> Action {
       PatchSii patch;
       reader.read("word", patch.word, 0, 0xFFFF);
       reader.read("value", patch.value, 0, 0xFFFF);
       return patch;
     }},
    {"clock", Scope::axis, read_clock},
    {"sync0", Scope::axis, read_sync0},
    {"stale_inputs", Scope::axis, [](TableReader&) -> Action { return StaleInputs{}; }},
    {"watchdog", Scope::axis,
     [](TableReader& reader) -> Action {
       if (flag(reader, "on", false)) reader.complain("on", "is true", "only false has an effect");
       return WatchdogOff{};
     }},
});

}  // namespace

std::vector<std::string_view> action_names() {
  std::vector<std::string_view> names;
  for (const ActionRow& row : action_table) names.push_back(row.name);
  return names;
}

std::optional<Action> read_action(TableReader& rule) {
  const std::vector<std::string_view> names = action_names();
  rule.note_words("do", names);
  std::string name;
  rule.read("do", name);
  for (const ActionRow& row : action_table) {
    if (row.name == name) return row.read(rule);
  }
  rule.complain("do", name.empty() ? "is missing" : fmt::format("there is no action \"{}\"", name),
                links::suggestion(name, names));
  return std::nullopt;
}

}  // namespace servodrome::scenario
