#include "line/bench/object_words.hpp"

#include <array>
#include <bit>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "catalogue/object_texts.hpp"
#include "catalogue/terminal_words.hpp"
#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"

namespace servodrome::line::bench {
namespace {

using drive::Mode;
using drive::Policy;
using drive::StatusSource;

struct Named {
  int value;
  const char* name;
};

Json list_of(std::span<const Named> rows, const char* key) {
  Json list = Json::array();
  for (const Named& row : rows) list.push_back({{key, row.value}, {"name", row.name}});
  return list;
}

constexpr std::array all_modes{Mode::pulse,
                               Mode::immediate_velocity,
                               Mode::none,
                               Mode::profile_position,
                               Mode::velocity,
                               Mode::profile_velocity,
                               Mode::profile_torque,
                               Mode::homing,
                               Mode::interpolated_position,
                               Mode::cyclic_sync_position,
                               Mode::cyclic_sync_velocity,
                               Mode::cyclic_sync_torque};

bool has(const Policy& policy, Mode mode) {
  if (mode == Mode::none) return policy.modes.none || policy.modes.zero_keeps;
  return (policy.modes.supported & drive::mode_bit(mode)) != 0;
}

Json modes_of(const Policy& policy) {
  Json list = Json::array();
  for (const Mode mode : all_modes) {
    if (has(policy, mode)) list.push_back({{"value", static_cast<int>(mode)}, {"name", mode_name(mode)}});
  }
  return list;
}

Json mode_bits(const Policy& policy) {
  Json list = Json::array();
  for (const Mode mode : all_modes) {
    if (mode == Mode::none || !has(policy, mode)) continue;
    list.push_back({{"bit", std::countr_zero(drive::mode_bit(mode))}, {"name", mode_name(mode)}});
  }
  return list;
}

// Controlword (CiA 402-2 table 23). The meaning of bits 4 to 6 and 9 depends on the mode.
constexpr auto controlword_bits =
    std::to_array<Named>({{0, "switch on"},
                          {1, "enable voltage"},
                          {2, "quick stop (0: stop)"},
                          {3, "enable operation"},
                          {4, "new set-point (mode 1), homing start (6), enable interpolation (7)"},
                          {5, "change set immediately (mode 1)"},
                          {6, "relative (mode 1)"},
                          {7, "fault reset"},
                          {8, "halt"},
                          {9, "change on set-point (mode 1)"}});

constexpr auto common_status_bits = std::to_array<Named>({{0, "ready to switch on"},
                                                          {1, "switched on"},
                                                          {2, "operation enabled"},
                                                          {3, "fault"},
                                                          {4, "voltage enabled"},
                                                          {5, "quick stop (0: active)"},
                                                          {6, "switch on disabled"},
                                                          {7, "warning"}});

// The meaning of bits 12 and 13 in each mode, according to CiA 402-2.
struct ModeBit {
  StatusSource source;
  Mode mode;
  const char* name;
};
constexpr auto mode_status_bits = std::to_array<ModeBit>({
    {StatusSource::mode_bit_12, Mode::profile_position, "set-point acknowledge"},
    {StatusSource::mode_bit_12, Mode::profile_velocity, "speed zero"},
    {StatusSource::mode_bit_12, Mode::homing, "homing attained"},
    {StatusSource::mode_bit_12, Mode::interpolated_position, "interpolation active"},
    {StatusSource::mode_bit_12, Mode::cyclic_sync_position, "drive follows the command value"},
    {StatusSource::mode_bit_12, Mode::cyclic_sync_velocity, "drive follows the command value"},
    {StatusSource::mode_bit_12, Mode::cyclic_sync_torque, "drive follows the command value"},
    {StatusSource::mode_bit_13, Mode::profile_position, "following error"},
    {StatusSource::mode_bit_13, Mode::profile_velocity, "max slippage error"},
    {StatusSource::mode_bit_13, Mode::homing, "homing error"},
    {StatusSource::mode_bit_13, Mode::cyclic_sync_position, "following error"},
});

const char* word(StatusSource source) {
  switch (source) {
    case StatusSource::remote: return "remote";
    case StatusSource::target_reached: return "target reached";
    case StatusSource::internal_limit: return "internal limit active";
    case StatusSource::position_limit: return "position limit";
    case StatusSource::following_error: return "following error";
    case StatusSource::commutation_found: return "commutation found";
    case StatusSource::home_found: return "home found";
    case StatusSource::halt: return "halt";
    case StatusSource::in_motion: return "in motion";
    case StatusSource::software_limit: return "beyond a software limit";
    case StatusSource::mode_bit_12:
    case StatusSource::mode_bit_13: break;  // mode_status_bits
  }
  return "";
}

// The name of a bit whose meaning depends on the mode lists the modes: "set-point acknowledge (mode 1), homing attained
// (6)".
Json status_bits(const Policy& policy) {
  Json list = list_of(common_status_bits, "bit");
  std::map<unsigned, std::string> names;
  const auto add = [&names](unsigned bit, const char* what, std::optional<Mode> mode) {
    std::string& text = names[bit];
    if (mode) {
      const char* form = text.empty() ? "{} (mode {})" : ", {} ({})";
      text += fmt::format(fmt::runtime(form), what, static_cast<int>(*mode));
    } else {
      text += (text.empty() ? "" : ", ") + std::string(what);
    }
  };
  for (const drive::StatusBit& row : policy.status.bits) {
    const bool of_a_mode = row.source == StatusSource::mode_bit_12 || row.source == StatusSource::mode_bit_13;
    if (!of_a_mode && row.modes == 0xFFFFFFFF) {
      add(row.bit, word(row.source), std::nullopt);
      continue;
    }
    for (const Mode mode : all_modes) {
      const std::uint32_t shown_in = drive::mode_bit(mode);
      if (!has(policy, mode) || (shown_in != 0 && (row.modes & shown_in) == 0)) continue;
      if (!of_a_mode) {
        if (shown_in != 0) add(row.bit, word(row.source), mode);
        continue;
      }
      for (const ModeBit& bit : mode_status_bits) {
        if (bit.source == row.source && bit.mode == mode) add(row.bit, bit.name, mode);
      }
    }
  }
  for (auto& [bit, name] : names) {
    if (!name.empty()) list.push_back({{"bit", bit}, {"name", name}});
  }
  return list;
}

const char* word(drive::Signal signal) {
  switch (signal) {
    case drive::Signal::negative_limit: return "negative limit switch";
    case drive::Signal::positive_limit: return "positive limit switch";
    case drive::Signal::home: return "home switch";
    case drive::Signal::index: return "index of the encoder";
    case drive::Signal::probe_1: return "touch probe 1";
    case drive::Signal::probe_2: return "touch probe 2";
    case drive::Signal::external_fault: return "external fault";
    case drive::Signal::motor_temperature: return "motor temperature contact";
    case drive::Signal::quick_stop: return "quick stop";
    case drive::Signal::interlock: return "interlock";
    case drive::Signal::enable_refused: return "enabling refused";
    case drive::Signal::invert_direction: return "direction inverted";
    case drive::Signal::integral_off: return "integral of the velocity loop off";
    case drive::Signal::none:
    case drive::Signal::count_of_signals: break;
  }
  return "";
}

Json input_bits(const Policy& policy) {
  Json list = Json::array();
  for (const drive::DigitalInputBit& row : policy.terminals.inputs) {
    const bool wire = row.source == drive::DigitalInputBit::Source::wire;
    list.push_back({{"bit", row.bit},
                    {"name", wire ? fmt::format("DI{}", row.number) : word(static_cast<drive::Signal>(row.number))}});
  }
  return list;
}

Json output_bits(const Policy& policy) {
  Json list = Json::array();
  if (policy.terminals.brake_output_bit >= 0)
    list.push_back({{"bit", policy.terminals.brake_output_bit}, {"name", "brake (1: closed)"}});
  for (unsigned output = 0; output < policy.terminals.output_count; ++output) {
    list.push_back({{"bit", policy.terminals.first_output_bit + output}, {"name", fmt::format("DO{}", output)}});
  }
  return list;
}

constexpr auto error_register_bits = std::to_array<Named>({{0, "generic"},
                                                           {1, "current"},
                                                           {2, "voltage"},
                                                           {3, "temperature"},
                                                           {4, "communication"},
                                                           {5, "device profile"},
                                                           {7, "manufacturer"}});
constexpr auto polarity_bits = std::to_array<Named>({{6, "velocity inverted"}, {7, "position inverted"}});

// The ways to end a motion (CiA 402-2, 605Ah to 605Eh).
std::string stop_of(int code) {
  switch (code) {
    case 0: return "disable the drive function";
    case 1: return "slow-down ramp";
    case 2: return "quick stop ramp";
    case 3: return "stop at the current limit";
    case 4: return "stop at the voltage limit";
    case 18: return "brake through the windings";
    default: return fmt::format("code {}", code);
  }
}

constexpr int last_option_code = 31;
bool has(std::uint32_t codes, int code) { return (codes >> code & 1U) != 0; }

// The option codes of the product. All codes from `at_once_from` on (if not 0) mean a stop at the current limit.
Json option_codes(std::uint32_t codes, int at_once_from) {
  Json list = Json::array();
  for (int code = 0; code <= last_option_code; ++code) {
    if (has(codes, code)) list.push_back({{"value", code}, {"name", stop_of(code)}});
  }
  if (at_once_from != 0) list.push_back({{"value", at_once_from}, {"name", stop_of(3) + " (higher codes as well)"}});
  return list;
}

// Codes 5 to 8 brake like codes 1 to 4, but the drive stays in quick stop active.
Json quick_stop_codes(const Policy& policy) {
  constexpr int held = 4;
  const drive::OptionCodes& codes = policy.power.option_codes;
  Json list = option_codes(codes.quick_stop, codes.at_once_from);
  for (Json& row : list) {
    const int code = row["value"];
    const bool stays = has(codes.quick_stop_stays, code);
    if (code > held && code <= 2 * held) row["name"] = stop_of(code - held);
    if (code != 0) {
      row["name"] =
          row["name"].get<std::string>() + (stays ? ", stays in quick stop active" : ", then switch on disabled");
    }
  }
  return list;
}

constexpr auto lost_master_reactions =
    std::to_array<Named>({{0, "no action"}, {1, "fault"}, {2, "disable voltage"}, {3, "quick stop"}});
constexpr auto ramp_shapes =
    std::to_array<Named>({{0, "linear ramp"}, {1, "sin2 ramp"}, {2, "jerk-free ramp"}, {3, "jerk-limited ramp"}});

Json shapes_of(const Policy& policy) {
  Json list = Json::array();
  for (const Named& row : ramp_shapes) {
    if (has(policy.ramps.types, row.value)) list.push_back({{"value", row.value}, {"name", row.name}});
  }
  return list;
}

bool in_range(const dictionary::Entry& entry, std::int64_t value) {
  return !entry.has_range || (value >= entry.minimum && value <= entry.maximum);
}

struct WordsOf {
  std::uint16_t index;
  bool (*is_there)(std::uint8_t sub);
  const char* key;
  Json (*words)(const Policy& policy);
};
constexpr bool only_0(std::uint8_t sub) { return sub == 0; }
constexpr bool not_0(std::uint8_t sub) { return sub != 0; }
constexpr std::array words_of{
    WordsOf{0x1001, only_0, "bits", [](const Policy&) { return list_of(error_register_bits, "bit"); }},
    WordsOf{0x6007, only_0, "enumeration", [](const Policy&) { return list_of(lost_master_reactions, "value"); }},
    WordsOf{0x6040, only_0, "bits", [](const Policy&) { return list_of(controlword_bits, "bit"); }},
    WordsOf{0x6041, only_0, "bits", status_bits},
    WordsOf{0x605A, only_0, "enumeration", quick_stop_codes},
    WordsOf{0x605B, only_0, "enumeration",
            [](const Policy& p) { return option_codes(p.power.option_codes.shutdown, 0); }},
    WordsOf{0x605C, only_0, "enumeration",
            [](const Policy& p) { return option_codes(p.power.option_codes.disable_operation, 0); }},
    WordsOf{0x605D, only_0, "enumeration",
            [](const Policy& p) { return option_codes(p.power.option_codes.halt, p.power.option_codes.at_once_from); }},
    WordsOf{0x605E, only_0, "enumeration",
            [](const Policy& p) { return option_codes(p.power.option_codes.fault_reaction, 0); }},
    WordsOf{0x6060, only_0, "enumeration", modes_of},
    WordsOf{0x6061, only_0, "enumeration", modes_of},
    WordsOf{0x607E, only_0, "bits", [](const Policy&) { return list_of(polarity_bits, "bit"); }},
    WordsOf{0x6086, only_0, "enumeration", shapes_of},
    WordsOf{0x60FD, only_0, "bits", input_bits},
    WordsOf{0x60FE, not_0, "bits", output_bits},
    WordsOf{0x6502, only_0, "bits", mode_bits},
};

}  // namespace

void add_words(Json& object, std::string_view product, const Policy& policy, const dictionary::Entry& entry) {
  const std::string_view text = catalogue::find_object_text(product, entry.index, entry.sub);
  if (!text.empty()) object["text"] = text;
  for (const WordsOf& row : words_of) {
    if (row.index != entry.index || !row.is_there(entry.sub)) continue;
    Json words = row.words(policy);
    object[row.key] = Json::array();
    for (Json& word : words) {
      if (!word.contains("value") || in_range(entry, word["value"])) object[row.key].push_back(std::move(word));
    }
  }
  if (const catalogue::TerminalWords* terminal = catalogue::find_terminal(product, entry.index, entry.sub)) {
    object["terminal"] = terminal->set;
    if (terminal->words.empty()) return;
    const char* number = terminal->key == "bits" ? "bit" : "value";
    Json& words = object[std::string(terminal->key)] = Json::array();
    for (const catalogue::NamedNumber& word : terminal->words)
      words.push_back({{number, word.number}, {"name", word.name}});
  }
}

}  // namespace servodrome::line::bench
