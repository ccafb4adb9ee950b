#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <toml++/toml.h>
#include <vector>

#include "line/diagnostic.hpp"

namespace servodrome::line {

// Parses the text of a TOML file. Returns nothing and adds a diagnostic if it is not valid or cannot be handled safely.
std::optional<toml::table> parse_toml(std::string_view text, const std::string& file,
                                      std::vector<Diagnostic>& diagnostics);

// Reads a text of at most 1 MiB. Returns nothing and adds a diagnostic if that fails. `what` is the kind of file for
// the messages: "a line file".
std::optional<std::string> read_text_file(const std::string& path, std::string_view what,
                                          std::vector<Diagnostic>& diagnostics);

// The text as a basic string of TOML, with its quotes.
std::string toml_quoted(std::string_view text);

}  // namespace servodrome::line
