#pragma once

#include <string_view>

#include "dictionary/entry.hpp"
#include "drive/policy.hpp"
#include "line/bench/api_names.hpp"

namespace servodrome::line::bench {

// Adds explanations for people to an entry of the object list, as far as they exist: "text" explains the object, "bits"
// names the bits of a word ([{"bit": 0, "name": ...}]), "enumeration" names its values ([{"value": 1, "name": ...}]).
// Names that depend on the product come from its policy. For an object that configures or shows a terminal, "terminal"
// is the name of its group, such as "Inputs" (terminal_words.hpp).
void add_words(Json& object, std::string_view product, const drive::Policy& policy, const dictionary::Entry& entry);

}  // namespace servodrome::line::bench
