#include "links/log_file.hpp"

#include <fcntl.h>
#include <io.h>

namespace servodrome::links {

std::FILE* open_log_file(const std::string& path) {
  if (path != "/dev/stdout") return std::fopen(path.c_str(), "wb");
  const int copy = ::_dup(::_fileno(stdout));
  if (copy < 0) return nullptr;
  ::_setmode(copy, _O_BINARY);  // a capture has no line ends to convert
  return ::_fdopen(copy, "wb");
}

}  // namespace servodrome::links
