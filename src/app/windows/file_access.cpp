#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <random>

#include "app/commands.hpp"
#include "app/whole_file.hpp"

namespace servodrome::app {

// The file has the access rights of its folder; in the user's own folders only the user can read it.
void write_private_file(const std::string& path, const std::string& text) {
  const std::string part = fmt::format("{}.{:08x}", path, std::random_device()());
  std::error_code error;
  {
    std::ofstream file(part, std::ios::binary);
    file << text;
    file.close();
    if (!file) error = std::make_error_code(std::errc::io_error);
  }
  if (!error) std::filesystem::rename(part, path, error);  // replaces an existing file
  if (!error) return;
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  throw Failure::did_not_work(
      fmt::format("cannot write {}: {}; choose a folder that exists and may be written to", path, error.message()));
}

bool may_write(const std::string& file) { return std::ofstream(file, std::ios::binary | std::ios::app).is_open(); }

// The rights of a folder are only known by trying.
bool may_create_in(const std::string& folder) {
  const auto trial = std::filesystem::path(folder) / fmt::format("{:08x}.part", std::random_device()());
  const bool created = std::ofstream(trial).is_open();
  std::error_code ignored;
  std::filesystem::remove(trial, ignored);
  return created;
}

}  // namespace servodrome::app
