#include "links/pty.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

[[noreturn]] void fail(int reason, const std::string& what, std::string_view advice) {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code, fmt::format("{}: {}; {}", what, code.message(), advice_for(reason, advice)));
}

// Returns the target of a symbolic link; empty if `path` is no symbolic link.
std::string link_target(const std::string& path) {
  std::array<char, 256> target{};
  const ssize_t size = ::readlink(path.c_str(), target.data(), target.size());
  return size > 0 ? std::string(target.data(), static_cast<std::size_t>(size)) : std::string();
}

// Reserves the path by an abstract socket, whose name can be bound only once. The name is free again when the process
// ends, even after a crash, and no file is left behind. Throws LinkError.
FileDescriptor claim(const std::string& link_path, const std::string& what) {
  std::error_code ignored;
  const std::filesystem::path path(link_path);
  const auto folder =
      std::filesystem::weakly_canonical(std::filesystem::absolute(path, ignored).parent_path(), ignored);
  const std::string whole = (folder / path.filename()).string();
  std::uint64_t hash = 0xCBF29CE484222325U;  // FNV-1a, because a socket's name is shorter than a path
  for (const char letter : whole) hash = (hash ^ static_cast<unsigned char>(letter)) * 0x100000001B3U;
  const std::string name = fmt::format("servodrome-pty-{:016x}", hash);
  FileDescriptor socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::copy(name.begin(), name.end(), &address.sun_path[1]);  // after a zero byte: abstract
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (socket.is_open() && ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    fail(errno, what, "another line has this path; stop it or choose another path");
  }
  return socket;
}

// Bytes that a client has not read can be flushed only at the device's end. Those that a new client has already written
// are on the master's side and stay. The flush does not reach bytes that a worker of the kernel has yet to deliver;
// is_readable() waits for that worker.
void discard_unread_at(const FileDescriptor& device) {
  while (is_readable(device.get()) && ::tcflush(device.get(), TCIFLUSH) == 0) continue;
}

}  // namespace

Pty::Pty(const std::string& link_path) : link_path_(link_path) {
  const std::string what = fmt::format("cannot create the serial port \"{}\"", link_path);
  claim_ = claim(link_path, what);
  master_.reset(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  std::array<char, 64> device{};
  if (!master_.is_open() || ::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0 ||
      ::ptsname_r(master_.get(), device.data(), device.size()) != 0) {
    fail(errno, what, "no pseudo terminal is available; is /dev/pts mounted?");
  }
  device_ = device.data();
  reset();  // opens the device once; before that, a pty does not report that no process has it open

  struct stat status {};
  if (::lstat(link_path.c_str(), &status) == 0) {
    if (!S_ISLNK(status.st_mode)) fail(EEXIST, what, "remove what is there or choose another path");
    ::unlink(link_path.c_str());
  }
  if (::symlink(device_.c_str(), link_path.c_str()) != 0) {
    fail(errno, what, "choose a path in a folder that exists and may be written to");
  }
}

Pty::~Pty() {
  if (link_target(link_path_) == device_) ::unlink(link_path_.c_str());
}

bool Pty::has_client() const {
  pollfd entry{master_.get(), POLLIN, 0};
  ::poll(&entry, 1, 0);
  return (entry.revents & POLLIN) != 0 || (entry.revents & POLLHUP) == 0;
}

void Pty::reset() {
  const FileDescriptor device = open_device();
  termios settings{};
  if (::tcgetattr(device.get(), &settings) == 0) {
    ::cfmakeraw(&settings);
    ::tcsetattr(device.get(), TCSANOW, &settings);
  }
  ::tcflow(device.get(), TCOON);
  ::ioctl(device.get(), TIOCNXCL);
  discard_unread_at(device);
}

void Pty::discard_unread() { discard_unread_at(open_device()); }

FileDescriptor Pty::open_device() const {
  return FileDescriptor(::open(device_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
}

}  // namespace servodrome::links
