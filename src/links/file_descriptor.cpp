#include "links/file_descriptor.hpp"

#include <algorithm>
#include <cerrno>
#include <poll.h>

namespace servodrome::links {
namespace {

bool wait_for(int descriptor, short events, Deadline deadline) {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now()).count();
    pollfd entry{descriptor, events, 0};
    const int ready = ::poll(&entry, 1, static_cast<int>(std::clamp<std::int64_t>(left, 0, 3'600'000)));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return true;  // the read or write that follows reports it
    if (left <= 0) return false;
  }
}

}  // namespace

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
