#pragma once

#include <nlohmann/json.hpp>

namespace servodrome::scenario {

// All actions, for a page from which the user chooses them: grouped by bus and profile, each with its text, the
// violated clause, its keys with their types as the parser knows them, and example values. docs/bench-api.md describes
// the JSON.
nlohmann::ordered_json action_catalogue();

}  // namespace servodrome::scenario
