#include "app/whole_file.hpp"

#include <array>
#include <cerrno>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iostream>

#include "app/commands.hpp"

namespace servodrome::app {

void write_whole_file(const std::string& path, const std::string& text) {
  std::error_code error;
  std::filesystem::path target = std::filesystem::canonical(path, error);
  if (error) target = path;  // the file does not exist yet
  const bool replaces = !std::filesystem::exists(target, error) || std::filesystem::is_regular_file(target, error);
  const std::filesystem::path part = replaces ? std::filesystem::path(target.string() + ".part") : target;
  error.clear();
  {
    errno = 0;
    std::ofstream file(part, std::ios::binary);
    file << text;
    file.close();
    if (!file) error.assign(errno != 0 ? errno : EIO, std::generic_category());
    if (!error && replaces) std::filesystem::rename(part, target, error);
  }
  if (!error) return;
  std::error_code ignored;
  if (replaces) std::filesystem::remove(part, ignored);
  throw Failure::did_not_work(
      fmt::format("{}: cannot be written: {}; check path, rights and disk", path, error.message()));
}

std::string read_text_file(const std::string& path, const std::string& what, bool may_be_standard_input) {
  constexpr std::size_t most_bytes = std::size_t{8} << 20;
  std::ifstream opened;
  std::error_code ignored;
  const bool is_input = may_be_standard_input && path == "-";
  if (!is_input) opened.open(path, std::ios::binary);
  if (!is_input && (!opened || std::filesystem::is_directory(path, ignored))) {
    throw Failure::wrong_use(fmt::format("{}: cannot be read; check the path", what));
  }
  std::istream& in = is_input ? std::cin : opened;
  std::string text;
  std::array<char, 65536> part{};
  while (in.read(part.data(), part.size()) || in.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
    if (const std::size_t zero = text.find('\0'); zero != std::string::npos) {
      throw Failure::wrong_use(fmt::format("{}: byte {} is zero: this is not a text file; check the path", what, zero));
    }
    if (text.size() > most_bytes) {
      throw Failure::wrong_use(fmt::format("{}: it is longer than {} MiB; check the path", what, most_bytes >> 20));
    }
  }
  return text;
}

void require_writable(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw Failure::wrong_use(fmt::format("{}: it is a folder", path));
  const bool is_there = std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error);
  const std::filesystem::path folder = std::filesystem::absolute(path, error).parent_path();
  if (is_there ? may_write(path) : may_create_in(folder.string())) return;
  throw Failure::wrong_use(fmt::format("{}: cannot be written; check path and rights", path));
}

}  // namespace servodrome::app
