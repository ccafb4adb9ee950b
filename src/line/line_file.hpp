#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "line/config.hpp"
#include "line/diagnostic.hpp"
#include "line/registry.hpp"

// The line file (TOML); docs/line-file.md is its reference.
namespace servodrome::line {

struct LineFile {
  LineSettings settings;                // valid if there are no diagnostics
  std::vector<Diagnostic> diagnostics;  // in the order of the file
  std::vector<Diagnostic> warnings;     // doubtful values that the line accepts, in the order of the file
};

// Reads and checks the text of a line file. `file` is its name in messages; relative paths in it start at its folder.
LineFile parse_line_file(std::string_view text, const std::string& file, std::span<const Product> products);

// Reads a line file from disk. If that fails, the result has a diagnostic.
LineFile load_line_file(const std::string& path, std::span<const Product> products);

// The built-in text of lines/default.toml.
std::string_view default_line_text();

}  // namespace servodrome::line
