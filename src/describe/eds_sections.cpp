#include "describe/eds_sections.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "describe/device_file.hpp"

namespace servodrome::describe::eds_file {
namespace {

// A large file may be full of useless lines. The reader refuses more lines than any device file has, before it takes
// memory.
constexpr std::size_t most_lines_kept = 400'000;  // sections and keys

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

}  // namespace

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), [](char c) { return lower(c); });
  return result;
}

std::string_view trim(std::string_view text) {
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t first = text.find_first_not_of(blank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blank) - first + 1);
}

std::string_view before_comment(std::string_view text) { return trim(text.substr(0, text.find(';'))); }

Sections read_sections(std::string_view text, const std::string& file,
                       const std::function<void(unsigned line, const std::string& what)>& note) {
  Sections sections;
  std::size_t lines_kept = 0;
  const auto count_line = [&](unsigned line) {
    if (++lines_kept <= most_lines_kept) return;
    throw DeviceFileError(file, line, "", fmt::format("it has more than {} sections and keys", most_lines_kept),
                          "give the file of one device");
  };
  Section* present = nullptr;
  unsigned number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = trim(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    ++number;
    if (line.empty() || line.front() == ';' || line.front() == '#') continue;
    if (line.front() == '[') {
      const std::size_t close = line.find(']');
      if (close == std::string_view::npos) {
        throw DeviceFileError(file, number, std::string(line.substr(0, 40)), "the section's name has no end",
                              "close it with ]");
      }
      const std::string_view name = trim(line.substr(1, close - 1));
      count_line(number);
      const auto [place, is_new] = sections.try_emplace(lower(name));
      if (!is_new) note(number, fmt::format("[{}]: the section exists twice; their keys are merged", name));
      present = &place->second;
      if (is_new) present->name = name, present->line = number;
      continue;
    }
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) {
      note(number, fmt::format("\"{}\" is neither a section nor a key; ignored", line.substr(0, 40)));
      continue;
    }
    if (present == nullptr) continue;  // text before the first section
    count_line(number);
    present->values[lower(trim(line.substr(0, equals)))] = {std::string(trim(line.substr(equals + 1))), number};
  }
  return sections;
}

}  // namespace servodrome::describe::eds_file
