#pragma once

#include <string>

#include "dictionary/medium.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A device's non-volatile memory in a file. Only one process at a time can use the file (advisory lock), and only its
// user can access it (mode 0600 at creation). New bytes are zero. If the file is deleted, moved or replaced, all
// operations fail, because written data would be lost.
class FileMedium final : public dictionary::Medium {
 public:
  // Opens or creates `path` with exactly `size` bytes. Throws std::runtime_error with the file's name if it cannot be
  // opened, is no regular file, is in use, or already has another size (it is then another device's memory).
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
  Descriptor file_;
  std::uint32_t size_;
};

}  // namespace servodrome::links
