#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

namespace servodrome::links {

#ifdef _WIN32
using Descriptor = std::uintptr_t;  // a SOCKET, or the HANDLE of a serial port
#else
using Descriptor = int;
#endif
inline constexpr auto no_descriptor = static_cast<Descriptor>(-1);

void close_descriptor(Descriptor descriptor);

// Owns a file descriptor.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(Descriptor descriptor) : descriptor_(descriptor) {}
  ~FileDescriptor() { reset(); }
  FileDescriptor(FileDescriptor&& other) noexcept : descriptor_(other.release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    if (this != &other) reset(other.release());
    return *this;
  }

  Descriptor get() const { return descriptor_; }
  bool is_open() const { return descriptor_ != no_descriptor; }
  Descriptor release() { return std::exchange(descriptor_, no_descriptor); }
  void reset(Descriptor descriptor = no_descriptor) {
    if (is_open()) close_descriptor(descriptor_);
    descriptor_ = descriptor;
  }

 private:
  Descriptor descriptor_ = no_descriptor;
};

using Deadline = std::chrono::steady_clock::time_point;

// Returns true if there is something to read now. Does not wait for the peer. Exception: on a tty it waits until a
// worker thread of the kernel has delivered its bytes, which takes milliseconds on a busy machine.
bool is_readable(Descriptor descriptor);
// Both functions wait until the descriptor can be read (or written), its peer is gone or the deadline has passed. They
// return false after the deadline, and true after an error, which the next read or write reports.
bool wait_readable(Descriptor descriptor, Deadline deadline);
bool wait_writable(Descriptor descriptor, Deadline deadline);
// Writes all bytes to a nonblocking descriptor. Returns false, with errno set, on failure (ETIMEDOUT: the deadline has
// passed).
bool write_all(Descriptor descriptor, std::string_view bytes, Deadline deadline);
// read_some() reads from a nonblocking descriptor; send_some() sends to a nonblocking socket whose peer may be gone (no
// SIGPIPE). Both return the number of bytes, or -1 with errno set (EAGAIN: not now). 0 from read_some(): the peer has
// closed its end.
std::ptrdiff_t read_some(Descriptor descriptor, void* into, std::size_t size);
std::ptrdiff_t send_some(Descriptor socket, const void* bytes, std::size_t size);

}  // namespace servodrome::links
