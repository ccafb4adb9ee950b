#include "links/serial/tty.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <termios.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

struct Speed {
  std::uint32_t bit_rate;
  speed_t code;
};
constexpr std::array<Speed, 14> speeds = {{{1200, B1200},
                                           {2400, B2400},
                                           {4800, B4800},
                                           {9600, B9600},
                                           {19200, B19200},
                                           {38400, B38400},
                                           {57600, B57600},
                                           {115200, B115200},
                                           {230400, B230400},
                                           {460800, B460800},
                                           {500000, B500000},
                                           {921600, B921600},
                                           {1000000, B1000000},
                                           {2000000, B2000000}}};

[[noreturn]] void fail_port(int reason, const std::string& device, std::string_view what, std::string_view advice) {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(
      code, fmt::format("serial port \"{}\" {} ({}); {}", device, what, code.message(), advice_for(reason, advice)));
}

}  // namespace

FileDescriptor open_tty(const std::string& device, const modbus::CharacterFormat& format) {
  const auto* speed =
      std::find_if(speeds.begin(), speeds.end(), [&](const Speed& row) { return row.bit_rate == format.bit_rate; });
  if (speed == speeds.end() || (format.data_bits != 7 && format.data_bits != 8)) {
    fail_port(EINVAL, device, fmt::format("cannot send {} data bits at {} bit/s", format.data_bits, format.bit_rate),
              "choose 8 bits and a usual bit rate such as 9600, 19200, 38400 or 115200");
  }
  FileDescriptor tty(::open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!tty.is_open()) {
    fail_port(errno, device, "cannot be opened",
              errno == EACCES ? "your user must belong to the port's group, usually dialout" : "check the path");
  }
  termios settings{};
  if (::tcgetattr(tty.get(), &settings) != 0) fail_port(errno, device, "is not a serial port", "name a tty");
  ::cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSIZE | PARENB | PARODD | CSTOPB | CRTSCTS);
  settings.c_cflag |= CLOCAL | CREAD | (format.data_bits == 7 ? CS7 : CS8);
  if (format.parity != modbus::Parity::none) settings.c_cflag |= PARENB;
  if (format.parity == modbus::Parity::odd) settings.c_cflag |= PARODD;
  if (format.stop_bits == 2) settings.c_cflag |= CSTOPB;
  ::cfsetspeed(&settings, speed->code);
  if (::tcsetattr(tty.get(), TCSANOW, &settings) != 0) {
    fail_port(errno, device, "does not accept the format", "choose another bit rate or parity");
  }
  ::tcflush(tty.get(), TCIOFLUSH);
  return tty;
}

}  // namespace servodrome::links
