#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "line/diagnostic.hpp"

namespace servodrome::studio {

// Errors in the files of a project: each with file, line and column, as far as they are known.
class ProjectError : public std::runtime_error {
 public:
  explicit ProjectError(std::vector<line::Diagnostic> diagnostics);
  ProjectError(const std::filesystem::path& file, std::string what, std::string hint, std::uint32_t line = 0,
               std::uint32_t column = 0);
  // "cannot be written: No space left on device".
  ProjectError(const std::filesystem::path& file, const std::error_code& error);

  const line::Diagnostic& first() const { return diagnostics_.front(); }

 private:
  std::vector<line::Diagnostic> diagnostics_;
};

// The content of a file; nothing if it does not exist. Throws ProjectError if it cannot be read.
std::optional<std::string> read_file(const std::filesystem::path& file);

// Deletes a file if it exists. Throws ProjectError.
void remove_file(const std::filesystem::path& file);

// Makes a folder in a folder that exists. Throws ProjectError.
void make_folder(const std::filesystem::path& folder);

// The files of a folder whose names end in `extension`, without it, sorted. Empty if there is no such folder.
std::vector<std::string> names_in(const std::filesystem::path& folder, const std::string& extension);

// Parses JSON, which begins at `first_line` of the file. Throws ProjectError with the place of an error.
nlohmann::json parse_json(std::string_view text, const std::filesystem::path& file, std::uint32_t first_line = 1);

// JSON for a file that git compares: sorted keys, and a line for each value; a list of numbers, texts and truth values
// is one line.
std::string file_text(const nlohmann::json& json);

// JSON as one line of a file, with sorted keys.
std::string line_text(const nlohmann::json& json);

}  // namespace servodrome::studio
