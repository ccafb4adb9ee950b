#pragma once

#include <string_view>

#include "dictionary/entry.hpp"
#include "drive/policy.hpp"
#include "line/bench/error.hpp"

namespace servodrome::line::bench {

// Adds to an entry of the object list what people need beside it, where there is such a thing: "text" explains it,
// "bits" names the bits of a word ([{"bit": 0, "name": ...}]), "enumeration" its values ([{"value": 1, "name": ...}]).
// Names that are the product's come from its policy. "terminal": the object sets up or shows a terminal, and this is
// the set that it belongs to (terminal_words.hpp).
void add_words(Json& object, std::string_view product, const drive::Policy& policy, const dictionary::Entry& entry);

}  // namespace servodrome::line::bench
