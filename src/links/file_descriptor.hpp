#pragma once

#include <chrono>
#include <string_view>
#include <unistd.h>
#include <utility>

namespace servodrome::links {

// Owns a file descriptor.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int descriptor) : descriptor_(descriptor) {}
  ~FileDescriptor() { reset(); }
  FileDescriptor(FileDescriptor&& other) noexcept : descriptor_(other.release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    if (this != &other) reset(other.release());
    return *this;
  }

  int get() const { return descriptor_; }
  bool is_open() const { return descriptor_ >= 0; }
  int release() { return std::exchange(descriptor_, -1); }
  void reset(int descriptor = -1) {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = descriptor;
  }

 private:
  int descriptor_ = -1;
};

using Deadline = std::chrono::steady_clock::time_point;

// Returns true if there is something to read now; does not wait.
bool is_readable(int descriptor);
// Wait until the descriptor can be read (written), its peer is gone or the deadline has passed. Return false after the
// deadline.
bool wait_readable(int descriptor, Deadline deadline);
bool wait_writable(int descriptor, Deadline deadline);
// Writes all bytes to a nonblocking descriptor. Returns false, with errno set, on failure (ETIMEDOUT: the deadline has
// passed).
bool write_all(int descriptor, std::string_view bytes, Deadline deadline);

}  // namespace servodrome::links
