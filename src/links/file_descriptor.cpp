#include "links/file_descriptor.hpp"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <poll.h>

namespace servodrome::links {
namespace {

bool wait_for(int descriptor, short events, Deadline deadline) {
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

bool is_readable(int descriptor) {
  pollfd entry{descriptor, POLLIN, 0};
  return ::poll(&entry, 1, 0) > 0 && (entry.revents & POLLIN) != 0;
}

bool wait_readable(int descriptor, Deadline deadline) { return wait_for(descriptor, POLLIN, deadline); }
bool wait_writable(int descriptor, Deadline deadline) { return wait_for(descriptor, POLLOUT, deadline); }

bool write_all(int descriptor, std::string_view bytes, Deadline deadline) {
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

}  // namespace servodrome::links
