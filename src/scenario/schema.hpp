#pragma once

#include <nlohmann/json.hpp>

namespace servodrome::scenario {

// A JSON Schema (draft 07) of scenario files, for editors that complete and check TOML. It is made from what the parser
// asks for, so it has the keys, types, words and ranges that the parser knows. Names of axes, objects and faults depend
// on the line, and the parser alone checks how keys go together.
nlohmann::ordered_json json_schema();

}  // namespace servodrome::scenario
