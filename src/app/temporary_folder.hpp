#pragma once

#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <string>
#include <thread>

namespace servodrome::app {

// A folder for temporary files, which disappears with this object.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    namespace fs = std::filesystem;
    const std::string name = (fs::temp_directory_path() / "servodrome-trial-").string();
    for (unsigned n = 0;; ++n) {
      path_ = fmt::format("{}{:x}-{}", name, std::hash<std::thread::id>{}(std::this_thread::get_id()), n);
      if (fs::create_directory(path_)) return;
    }
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace servodrome::app
