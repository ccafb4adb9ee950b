#include "links/file_descriptor.hpp"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace servodrome::links {
namespace {

bool wait_for(Descriptor descriptor, short events, Deadline deadline) {
  using std::chrono::nanoseconds;
  constexpr nanoseconds longest = std::chrono::hours(1);
  for (;;) {
    const nanoseconds left = deadline - std::chrono::steady_clock::now();
    const nanoseconds span = std::clamp(left, nanoseconds{0}, longest);
    const timespec timeout{.tv_sec = span.count() / 1'000'000'000, .tv_nsec = span.count() % 1'000'000'000};
    pollfd entry{descriptor, events, 0};
    const int ready = ::ppoll(&entry, 1, &timeout, nullptr);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return true;  // the read or write that follows reports it
    if (left <= nanoseconds{0}) return false;
  }
}

}  // namespace

void close_descriptor(Descriptor descriptor) { ::close(descriptor); }

bool is_readable(Descriptor descriptor) {
  pollfd entry{descriptor, POLLIN, 0};
  return ::poll(&entry, 1, 0) > 0 && (entry.revents & POLLIN) != 0;
}

bool wait_readable(Descriptor descriptor, Deadline deadline) { return wait_for(descriptor, POLLIN, deadline); }
bool wait_writable(Descriptor descriptor, Deadline deadline) { return wait_for(descriptor, POLLOUT, deadline); }

bool write_all(Descriptor descriptor, std::string_view bytes, Deadline deadline) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (written < 0 && errno != EAGAIN && errno != EINTR) {
      return false;
    } else if (!wait_writable(descriptor, deadline)) {
      errno = ETIMEDOUT;
      return false;
    }
  }
  return true;
}

std::ptrdiff_t read_some(Descriptor descriptor, void* into, std::size_t size) { return ::read(descriptor, into, size); }

std::ptrdiff_t send_some(Descriptor socket, const void* bytes, std::size_t size) {
  return ::send(socket, bytes, size, MSG_NOSIGNAL);
}

}  // namespace servodrome::links
