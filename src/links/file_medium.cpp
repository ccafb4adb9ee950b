#include "links/file_medium.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <stdexcept>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "links/descriptor_advice.hpp"

namespace servodrome::links {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& why) {
  throw std::runtime_error(fmt::format("parameter file {}: {}", path, why));
}

std::string last_reason() { return std::strerror(errno); }

// Closes the opened file, unless the constructor succeeds.
struct OpenFile {
  int number;
  ~OpenFile() {
    if (number >= 0) ::close(number);
  }
  int release() { return std::exchange(number, -1); }
};

// Makes the name of a new file as durable as its content.
void sync_folder(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  const OpenFile file{::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (file.number < 0 || ::fsync(file.number) != 0) fail(path, "cannot sync its folder: " + last_reason());
}

}  // namespace

FileMedium::FileMedium(const std::string& path, std::uint32_t size)
    : path_(std::filesystem::absolute(path).string()), file_(-1), size_(size) {
  OpenFile file{::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK, S_IRUSR | S_IWUSR)};
  if (file.number < 0) {
    const int reason = errno;
    fail(path, "cannot open: " + last_reason() + "; " +
                   advice_for<std::string>(reason, "choose a file in a folder that exists and may be written to"));
  }
  struct stat status {};
  if (::fstat(file.number, &status) != 0) fail(path, "cannot inspect: " + last_reason());
  if (!S_ISREG(status.st_mode)) fail(path, "is not a regular file; choose another path");
  if (::flock(file.number, LOCK_EX | LOCK_NB) != 0) {
    fail(path, errno == EWOULDBLOCK ? "is in use by another drive or process; stop it or choose another file"
                                    : "cannot lock: " + last_reason());
  }
  if (::fstat(file.number, &status) != 0) fail(path, "cannot inspect: " + last_reason());
  if (status.st_size == 0) {
    if (::ftruncate(file.number, static_cast<off_t>(size)) != 0) fail(path, "cannot grow: " + last_reason());
    if (::fsync(file.number) != 0) fail(path, "cannot sync: " + last_reason());
    sync_folder(path);
  } else if (status.st_size != static_cast<off_t>(size)) {
    fail(path, fmt::format("has {} bytes, but this device's memory has {}; move it away to start with factory values",
                           status.st_size, size));
  }
  file_ = file.release();
}

FileMedium::~FileMedium() { ::close(file_); }

// Returns true if the path still refers to the file that was opened.
bool FileMedium::in_place() const {
  struct stat opened {};
  struct stat found {};
  return ::fstat(file_, &opened) == 0 && ::stat(path_.c_str(), &found) == 0 && opened.st_dev == found.st_dev &&
         opened.st_ino == found.st_ino;
}

bool FileMedium::read(std::uint32_t address, std::span<std::byte> bytes) {
  if (!in_place()) return false;
  while (!bytes.empty()) {
    const ssize_t count = ::pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(address));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;  // 0: the file was shortened
    address += static_cast<std::uint32_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

bool FileMedium::write(std::uint32_t address, std::span<const std::byte> bytes) {
  if (!in_place()) return false;
  while (!bytes.empty()) {
    const ssize_t count = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(address));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    address += static_cast<std::uint32_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

bool FileMedium::flush() { return in_place() && ::fdatasync(file_) == 0; }

}  // namespace servodrome::links
