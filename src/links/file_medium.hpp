#pragma once

#include <string>

#include "dictionary/medium.hpp"

namespace servodrome::links {

// A device's non-volatile memory in a file. The file belongs to one process at a time (advisory lock) and to the user
// alone (mode 0600 when it is created; new bytes are zero). When it is deleted, moved or replaced the memory answers no
// more: what would be written would be lost.
class FileMedium final : public dictionary::Medium {
 public:
  // Opens or creates `path` with exactly `size` bytes. Throws std::runtime_error, naming the file, when it cannot be
  // opened, is no regular file, is in use, or already has another size (which is another device's memory).
  FileMedium(const std::string& path, std::uint32_t size);
  ~FileMedium();
  FileMedium(const FileMedium&) = delete;
  FileMedium& operator=(const FileMedium&) = delete;

  std::uint32_t size() const override { return size_; }
  bool read(std::uint32_t address, std::span<std::byte> bytes) override;
  bool write(std::uint32_t address, std::span<const std::byte> bytes) override;
  bool flush() override;

 private:
  bool in_place() const;

  std::string path_;  // absolute
  int file_;
  std::uint32_t size_;
};

}  // namespace servodrome::links
