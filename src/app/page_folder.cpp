#include "app/page_folder.hpp"

#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/process.hpp"

namespace servodrome::app {
namespace {

bool has_page(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::is_regular_file(folder / "index.html", error);
}

}  // namespace

std::string page_folder(const std::string& wanted) {
  if (!wanted.empty()) {
    if (has_page(wanted)) return wanted;
    throw Failure::wrong_use(
        fmt::format("folder {}: there is no index.html; give the folder that the studio was built into", wanted));
  }
  if (const char* folder = std::getenv("SERVODROME_STUDIO"); folder != nullptr && *folder != '\0') {
    if (has_page(folder)) return folder;
    throw Failure::wrong_use(fmt::format(
        "SERVODROME_STUDIO={}: there is no index.html; name the folder that the studio was built into", folder));
  }
  const std::filesystem::path program = program_file();
  for (std::filesystem::path at = program.parent_path(); at.has_relative_path(); at = at.parent_path()) {
    if (at.filename() == "build" && has_page(at / "studio")) return (at / "studio").string();
  }
  const std::filesystem::path installed = program.parent_path().parent_path() / "share" / "servodrome" / "studio";
  return has_page(installed) ? installed.string() : std::string();
}

}  // namespace servodrome::app
