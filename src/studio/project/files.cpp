#include "studio/project/files.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fstream>
#include <sstream>

namespace servodrome::studio {
namespace {

// Printing and copying nested values use stack for each level. A request has one level more, and may have 32.
constexpr int deepest = 31;

std::string text_of(const std::vector<line::Diagnostic>& diagnostics) {
  std::string text;
  for (const line::Diagnostic& one : diagnostics) text += (text.empty() ? "" : "\n") + to_string(one);
  return text;
}

std::string dumped(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void append_json(std::string& text, const nlohmann::json& json, std::size_t indent) {
  const auto is_nested = [](const nlohmann::json& one) { return one.is_structured(); };
  const bool is_list = json.is_array();
  if (!json.is_structured() || json.empty()) {
    text += dumped(json);
  } else if (is_list && std::none_of(json.begin(), json.end(), is_nested)) {
    for (const nlohmann::json& one : json) text += (&one == &json.front() ? "[" : ", ") + dumped(one);
    text += "]";
  } else {
    const std::string margin(indent, ' ');
    const char* before = is_list ? "[\n" : "{\n";
    for (const auto& [key, value] : json.items()) {
      text += before + margin + "  ";
      if (!is_list) text += dumped(key) + ": ";
      append_json(text, value, indent + 2);
      before = ",\n";
    }
    text += "\n" + margin + (is_list ? "]" : "}");
  }
}

}  // namespace

ProjectError::ProjectError(std::vector<line::Diagnostic> diagnostics)
    : std::runtime_error(text_of(diagnostics)), diagnostics_(std::move(diagnostics)) {}

ProjectError::ProjectError(const std::filesystem::path& file, std::string what, std::string hint, std::uint32_t line,
                           std::uint32_t column)
    : ProjectError(std::vector{line::Diagnostic{file.string(), line, column, std::move(what), std::move(hint)}}) {}

ProjectError::ProjectError(const std::filesystem::path& file, const std::error_code& error)
    : ProjectError(file, "cannot be written: " + error.message(), "check path, rights and disk") {}

std::optional<std::string> read_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (in && in.peek() != std::ifstream::traits_type::eof()) text << in.rdbuf();
  if (in.bad() || !in.is_open() || std::filesystem::is_directory(file, error)) {
    throw ProjectError(file, "cannot be read", "check path and rights");
  }
  return text.str();
}

void remove_file(const std::filesystem::path& file) {
  std::error_code error;
  std::filesystem::remove(file, error);
  if (error) throw ProjectError(file, "cannot be deleted: " + error.message(), "check path and rights");
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directory(folder, error);  // without an error if it exists
  if (error) throw ProjectError(folder, "cannot be made: " + error.message(), "check path, rights and disk");
}

std::vector<std::string> names_in(const std::filesystem::path& folder, const std::string& extension) {
  std::vector<std::string> names;
  std::error_code error;
  if (std::filesystem::exists(folder, error) && !std::filesystem::is_directory(folder, error)) {
    throw ProjectError(folder, "is a file and no folder", "move it to another place");
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == extension) names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

nlohmann::json parse_json(std::string_view text, const std::filesystem::path& file, std::uint32_t first_line) {
  const auto limited = [&](int depth, nlohmann::json::parse_event_t, const nlohmann::json&) {
    if (depth <= deepest) return true;
    throw ProjectError(file, fmt::format("is nested more than {} levels deep", deepest), "correct the file", first_line,
                       1);
  };
  try {
    return nlohmann::json::parse(text, limited);
  } catch (const nlohmann::json::parse_error& error) {
    const std::string_view before = text.substr(0, error.byte == 0 ? 0 : std::min(error.byte - 1, text.size()));
    const std::size_t line_end = before.rfind('\n');
    const std::size_t begin = line_end == std::string_view::npos ? 0 : line_end + 1;
    throw ProjectError(file, "is not JSON here", "correct the file, or take an earlier version of it from git",
                       first_line + static_cast<std::uint32_t>(std::count(before.begin(), before.end(), '\n')),
                       static_cast<std::uint32_t>(1 + before.size() - begin));
  } catch (const nlohmann::json::out_of_range&) {
    throw ProjectError(file, "has a number that is too large", "correct the file", first_line, 1);
  }
}

std::string file_text(const nlohmann::json& json) {
  std::string text;
  append_json(text, json, 0);
  return text + "\n";
}

std::string line_text(const nlohmann::json& json) { return dumped(json) + "\n"; }

}  // namespace servodrome::studio
