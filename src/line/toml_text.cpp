#include "line/toml_text.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>

#include "line/toml_guard.hpp"

namespace servodrome::line {
namespace {

constexpr std::size_t largest_file = 1 << 20;

}  // namespace

std::optional<toml::table> parse_toml(std::string_view text, const std::string& file,
                                      std::vector<Diagnostic>& diagnostics) {
  if (auto refusal = refuse_toml(text)) {
    diagnostics.push_back(
        {file, static_cast<std::uint32_t>(refusal->line), 1, std::move(refusal->what), std::move(refusal->hint)});
    return std::nullopt;
  }
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    diagnostics.push_back({file, at.line, at.column, std::string(error.description()), "correct the TOML here"});
    return std::nullopt;
  }
}

std::optional<std::string> read_text_file(const std::string& path, std::string_view what,
                                          std::vector<Diagnostic>& diagnostics) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    diagnostics.push_back({path, 0, 0, "is a folder", fmt::format("give the name of {}", what)});
    return std::nullopt;
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    diagnostics.push_back({path, 0, 0, fmt::format("cannot be read: {}", std::strerror(errno)),
                           fmt::format("give the name of {}", what)});
    return std::nullopt;
  }
  std::string text;
  std::array<char, 16384> part{};
  while (file.read(part.data(), part.size()) || file.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(file.gcount()));
    if (text.size() <= largest_file) continue;
    diagnostics.push_back({path, 0, 0, "is longer than 1 MiB", fmt::format("give {}", what)});
    return std::nullopt;
  }
  return text;
}

std::string toml_quoted(std::string_view text) {
  std::string result = "\"";
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if (letter == '"' || letter == '\\') {
      result += fmt::format("\\{}", letter);
    } else if (code < 0x20 || code == 0x7F) {
      result += fmt::format("\\u{:04X}", code);
    } else {
      result += letter;
    }
  }
  return result + "\"";
}

}  // namespace servodrome::line
