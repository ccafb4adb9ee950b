#pragma once

#include "line/table_reader.hpp"
#include "scenario/scenario.hpp"

// The parts of a scenario file. Each function reports errors through its reader.
namespace servodrome::scenario {

Condition read_condition(const toml::table& table, const std::string& path, line::FileReport& report);
MessagePattern read_pattern(const toml::table& table, const std::string& path, line::FileReport& report);

// The name of a kind of message in the file.
std::string_view name_of(MessageKind kind);

// The words of all actions.
std::vector<std::string_view> action_names();

// Reads `do` and the keys of that action. Returns nothing after an error.
std::optional<Action> read_action(line::TableReader& rule);
// A time in milliseconds under `key`, not negative.
std::optional<Time> read_time_ms(line::TableReader& reader, std::string_view key);
// An object: "6040" or "6040:01", hexadecimal.
std::optional<ObjectAddress> read_object(line::TableReader& reader, std::string_view key);
// Bytes: "2B 40 60"; with `gaps` also ?? for any byte.
std::optional<std::vector<std::optional<std::uint8_t>>> read_bytes(line::TableReader& reader, std::string_view key,
                                                                   bool gaps);

}  // namespace servodrome::scenario
