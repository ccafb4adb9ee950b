#include "app/terminal.hpp"

#include <array>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <termios.h>
#include <unistd.h>

namespace servodrome::app {
namespace {

bool is_ready(int file) {
  pollfd polled{.fd = file, .events = POLLOUT, .revents = 0};
  return ::poll(&polled, 1, 0) == 1 && (polled.revents & POLLOUT) != 0;
}

}  // namespace

bool on_terminal() { return ::isatty(STDOUT_FILENO) == 1; }

unsigned terminal_width() {
  winsize size{};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

bool output_is_ready() { return is_ready(STDOUT_FILENO); }
bool error_output_is_ready() { return is_ready(STDERR_FILENO); }

bool has_keyboard() { return ::isatty(STDIN_FILENO) == 1; }

struct Keyboard::Before {
  termios settings{};
};

Keyboard::Keyboard() : before_(std::make_unique<Before>()) {
  ::tcgetattr(STDIN_FILENO, &before_->settings);
  termios raw = before_->settings;
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_iflag &= ~static_cast<tcflag_t>(IXON);  // otherwise Ctrl-S blocks the next output, and the motion runs on
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  ::tcsetattr(STDIN_FILENO, TCSANOW, &raw);
}

Keyboard::~Keyboard() { ::tcsetattr(STDIN_FILENO, TCSANOW, &before_->settings); }

std::string Keyboard::typed() {
  fd_set ready;
  FD_ZERO(&ready);
  FD_SET(STDIN_FILENO, &ready);
  timeval now{};
  if (::select(STDIN_FILENO + 1, &ready, nullptr, nullptr, &now) <= 0) return {};
  std::array<char, 64> characters{};
  const ssize_t count = ::read(STDIN_FILENO, characters.data(), characters.size());
  return count > 0 ? std::string(characters.data(), static_cast<std::size_t>(count)) : "q";
}

}  // namespace servodrome::app
