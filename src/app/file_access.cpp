#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "app/commands.hpp"
#include "app/whole_file.hpp"

namespace servodrome::app {

void write_private_file(const std::string& path, const std::string& text) {
  // A new unique name, so that no other user can have created it, or linked it to another file, before.
  std::string part = path + ".XXXXXX";
  const int file = ::mkostemp(part.data(), O_CLOEXEC);
  const bool written = file >= 0 && ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  int reason = written ? 0 : errno;
  if (file >= 0 && ::close(file) != 0 && reason == 0) reason = errno;
  if (reason == 0 && std::rename(part.c_str(), path.c_str()) != 0) reason = errno;
  if (reason == 0) return;
  if (file >= 0) ::unlink(part.c_str());
  throw Failure::did_not_work(fmt::format("cannot write {}: {}; choose a folder that exists and may be written to",
                                          path, std::strerror(reason)));
}

bool may_write(const std::string& file) { return ::access(file.c_str(), W_OK) == 0; }

bool may_create_in(const std::string& folder) { return ::access(folder.c_str(), W_OK | X_OK) == 0; }

}  // namespace servodrome::app
