#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <termios.h>

#include "links/can/client_slcan.hpp"

namespace servodrome::links {

void SlcanClient::open_tty() {
  tty_.reset(::open(name_.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!tty_.is_open()) {
    const auto code = std::error_code(errno, std::generic_category());
    fail(code, fmt::format("cannot be opened ({})", code.message()),
         code.value() == EACCES ? "your user must belong to the port's group, usually dialout" : "check the path");
  }
  termios settings{};
  if (::tcgetattr(tty_.get(), &settings) != 0) {
    fail(std::error_code(errno, std::generic_category()), "is not a serial port",
         "name a tty or the line's slcan: path");
  }
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  ::cfsetspeed(&settings, B115200);
  ::tcsetattr(tty_.get(), TCSANOW, &settings);
  ::tcflush(tty_.get(), TCIOFLUSH);
}

}  // namespace servodrome::links
