#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "line/table_reader.hpp"

namespace servodrome::scenario {

// A JSON Schema (draft 07) of scenario files, for editors that complete and check TOML. It is generated
// from the keys that the parser reads, so it has their types, words and ranges. Names of axes, objects and faults
// depend on the line; only the parser checks which keys must occur together.
nlohmann::ordered_json json_schema();

// The `properties` of a JSON Schema for these keys.
nlohmann::ordered_json properties_of(const std::vector<line::KeyNote>& notes);

}  // namespace servodrome::scenario
