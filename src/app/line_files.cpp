#include "app/line_files.hpp"

#include <fmt/format.h>

#include "app/commands.hpp"
#include "line/line_file.hpp"

namespace servodrome::app {

line::LineSettings load_line(const std::string& file) {
  line::LineFile loaded = file.empty()
                              ? line::parse_line_file(line::default_line_text(), "default.toml", line::all_products())
                              : line::load_line_file(file, line::all_products());
  if (loaded.diagnostics.empty()) return std::move(loaded.settings);
  std::string message = fmt::format("{} cannot be run:", file.empty() ? "the built-in line" : file);
  for (const line::Diagnostic& diagnostic : loaded.diagnostics) message += "\n" + to_string(diagnostic);
  throw Failure::wrong_use(message);
}

}  // namespace servodrome::app
