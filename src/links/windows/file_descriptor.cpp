// A descriptor is a nonblocking socket, or the handle of a serial port that was opened for overlapped I/O
// (serial/tty.cpp).
#include "links/file_descriptor.hpp"

#include <algorithm>
#include <cerrno>
#include <thread>
#include <winsock2.h>

#include "links/windows/socket_error.hpp"

namespace servodrome::links {
namespace {

using std::chrono::milliseconds;

// Interval at which a serial port is polled: it has no event for "bytes have come" beside a pending read.
constexpr milliseconds serial_poll_time(1);

HANDLE handle_of(Descriptor descriptor) { return reinterpret_cast<HANDLE>(descriptor); }

bool is_socket(Descriptor descriptor) {
  int type = 0;
  int size = sizeof type;
  return ::getsockopt(descriptor, SOL_SOCKET, SO_TYPE, reinterpret_cast<char*>(&type), &size) == 0;
}

// Returns the time until the deadline, rounded up, as the functions of Windows take it.
DWORD milliseconds_until(Deadline deadline) {
  const auto left = std::chrono::ceil<milliseconds>(deadline - std::chrono::steady_clock::now());
  return static_cast<DWORD>(std::clamp<std::int64_t>(left.count(), 0, 3'600'000));
}

std::ptrdiff_t fail(unsigned long windows_error) {
  errno = error_number(windows_error);
  return -1;
}

bool poll_socket(Descriptor socket, short events, DWORD timeout, short& found) {
  WSAPOLLFD entry{socket, events, 0};
  const int ready = ::WSAPoll(&entry, 1, static_cast<int>(timeout));
  found = entry.revents;
  return ready != 0;  // after an error the read or write that follows reports it
}

bool wait_for_socket(Descriptor socket, short events, Deadline deadline) {
  for (;;) {
    short found = 0;
    if (poll_socket(socket, events, milliseconds_until(deadline), found)) return true;
    if (std::chrono::steady_clock::now() >= deadline) return false;
  }
}

// Returns the number of bytes that a serial port has received; -1 if the port is lost.
std::ptrdiff_t serial_input(Descriptor port) {
  DWORD errors = 0;
  COMSTAT status{};
  if (!::ClearCommError(handle_of(port), &errors, &status)) return fail(::GetLastError());
  return static_cast<std::ptrdiff_t>(status.cbInQue);
}

// An event for one overlapped operation, which is cancelled at the deadline.
class Overlapped {
 public:
  explicit Overlapped(HANDLE file) : file_(file) { state_.hEvent = ::CreateEventW(nullptr, TRUE, FALSE, nullptr); }
  ~Overlapped() { ::CloseHandle(state_.hEvent); }
  Overlapped(const Overlapped&) = delete;
  Overlapped& operator=(const Overlapped&) = delete;

  OVERLAPPED* state() { return &state_; }
  // `started`: the result of ReadFile or WriteFile. Returns the number of bytes, or -1 with errno set.
  std::ptrdiff_t finish(bool started, DWORD timeout) {
    if (!started && ::GetLastError() != ERROR_IO_PENDING) return fail(::GetLastError());
    if (::WaitForSingleObject(state_.hEvent, timeout) != WAIT_OBJECT_0) ::CancelIoEx(file_, &state_);
    DWORD count = 0;
    if (::GetOverlappedResult(file_, &state_, &count, TRUE)) return static_cast<std::ptrdiff_t>(count);
    if (::GetLastError() != ERROR_OPERATION_ABORTED) return fail(::GetLastError());
    if (count > 0) return static_cast<std::ptrdiff_t>(count);
    errno = ETIMEDOUT;
    return -1;
  }

 private:
  HANDLE file_;
  OVERLAPPED state_{};
};

std::ptrdiff_t read_serial(Descriptor port, void* into, std::size_t size) {
  const std::ptrdiff_t waiting = serial_input(port);
  if (waiting < 0) return -1;
  if (waiting == 0) {
    errno = EAGAIN;
    return -1;
  }
  const auto count = static_cast<DWORD>(std::min(size, static_cast<std::size_t>(waiting)));
  Overlapped operation(handle_of(port));
  return operation.finish(::ReadFile(handle_of(port), into, count, nullptr, operation.state()), INFINITE);
}

std::ptrdiff_t write_serial(Descriptor port, std::string_view bytes, Deadline deadline) {
  Overlapped operation(handle_of(port));
  const bool started =
      ::WriteFile(handle_of(port), bytes.data(), static_cast<DWORD>(bytes.size()), nullptr, operation.state());
  return operation.finish(started, milliseconds_until(deadline));
}

}  // namespace

void close_descriptor(Descriptor descriptor) {
  if (is_socket(descriptor)) {
    ::closesocket(descriptor);
  } else {
    ::CloseHandle(handle_of(descriptor));
  }
}

bool is_readable(Descriptor descriptor) {
  if (!is_socket(descriptor)) return serial_input(descriptor) > 0;
  short found = 0;
  return poll_socket(descriptor, POLLRDNORM, 0, found) && (found & POLLRDNORM) != 0;
}

bool wait_readable(Descriptor descriptor, Deadline deadline) {
  if (is_socket(descriptor)) return wait_for_socket(descriptor, POLLRDNORM, deadline);
  while (serial_input(descriptor) == 0) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(serial_poll_time);
  }
  return true;
}

bool wait_writable(Descriptor descriptor, Deadline deadline) {
  return !is_socket(descriptor) || wait_for_socket(descriptor, POLLWRNORM, deadline);
}

bool write_all(Descriptor descriptor, std::string_view bytes, Deadline deadline) {
  const bool to_socket = is_socket(descriptor);
  while (!bytes.empty()) {
    const std::ptrdiff_t written =
        to_socket ? send_some(descriptor, bytes.data(), bytes.size()) : write_serial(descriptor, bytes, deadline);
    if (written > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (written < 0 && errno != EAGAIN) {
      return false;
    } else if (!wait_writable(descriptor, deadline) || std::chrono::steady_clock::now() >= deadline) {
      errno = ETIMEDOUT;
      return false;
    }
  }
  return true;
}

std::ptrdiff_t read_some(Descriptor descriptor, void* into, std::size_t size) {
  if (!is_socket(descriptor)) return read_serial(descriptor, into, size);
  const int count = ::recv(descriptor, static_cast<char*>(into), static_cast<int>(size), 0);
  return count >= 0 ? count : fail(static_cast<unsigned long>(::WSAGetLastError()));
}

std::ptrdiff_t send_some(Descriptor socket, const void* bytes, std::size_t size) {
  const int count = ::send(socket, static_cast<const char*>(bytes), static_cast<int>(size), 0);
  return count >= 0 ? count : fail(static_cast<unsigned long>(::WSAGetLastError()));
}

}  // namespace servodrome::links
