#pragma once

#include <nlohmann/json.hpp>

namespace servodrome::scenario {

// All actions, for a page that offers them: grouped by bus and profile, each with its text, the clause that it breaks,
// its keys with their types as the parser knows them, and values to begin with. docs/bench-api.md describes the JSON.
nlohmann::ordered_json action_catalogue();

}  // namespace servodrome::scenario
