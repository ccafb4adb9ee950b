#pragma once

#include <string>
#include <string_view>
#include <toml++/toml.h>
#include <vector>

// Scenario files as tables of TOML, for programs that write new ones from them.
namespace servodrome::scenario {

// Throws std::runtime_error, with the place, if the text is not valid TOML.
toml::table table_of(std::string_view text, const std::string& file = "scenario");

// The rules, or the expectations; empty if there are none. `key` is "rule" or "expect".
std::vector<toml::table*> tables_at(toml::table& document, std::string_view key);

// The keys of a table in the order of the file that it was read from, behind those that have been added since.
std::vector<std::string_view> keys_in_order(const toml::table& table);

// The text of a document: one line for each key, a heading for each rule and expectation, and the tables in them in one
// line, with keys in order. Comments are lost.
std::string text_of(const toml::table& document);

}  // namespace servodrome::scenario
