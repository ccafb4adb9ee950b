#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// Files whose content survives a crash of the program or of the computer.

// Writes `file` anew: into FILE.part, which is synced and then renamed. At any moment `file` has the old or the new
// content. After an error it has the old one; exception: if only the sync of its folder fails, it has the new one.
std::error_code replace_file(const std::filesystem::path& file, std::string_view text);

// Writes `text` at the end of `file`, which is made if it does not exist, and syncs it. After an error the file has its
// old length, unless it cannot be shortened again.
std::error_code append_to_file(const std::filesystem::path& file, std::string_view text);

// Locks a folder against other programs that lock it in this way, until the end of this object or of the process. The
// lock follows a folder that is moved.
class FolderLock {
 public:
  // Returns nothing and sets `error` if that fails; std::errc::device_or_resource_busy: another program has the lock.
  static std::optional<FolderLock> take(const std::filesystem::path& folder, std::error_code& error);

 private:
  explicit FolderLock(FileDescriptor file) : file_(std::move(file)) {}

  FileDescriptor file_;
};

}  // namespace servodrome::links
