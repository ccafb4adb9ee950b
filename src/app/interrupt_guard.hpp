#pragma once

#include <cstdint>
#include <memory>

namespace servodrome::app {

// While an object of this class lives, Ctrl-C, SIGTERM and the loss of the terminal (SIGHUP, unless nohup has disabled
// it) do not kill the program: they only set interrupted(), and the command ends itself. Ctrl-Z (SIGTSTP) and
// SIGQUIT do the same, because a suspended or killed program does not stop its axis, and so do SIGUSR1, SIGUSR2 and the
// signals of timers and of the limit of processor time. If the reader of the output ends (SIGPIPE), or a file reaches
// its limit (SIGXFSZ), the write fails and the command continues, because an axis may be moving. A command that only
// looks keeps the default actions of all signals but SIGINT, SIGTERM and SIGHUP. Create the guard before a DriveLink,
// so that no signal kills the program while the destructor of the DriveLink restores the drive. Windows has only SIGINT
// and SIGTERM of these; Ctrl-Break and the end of the console count as an interrupt there.
class InterruptGuard {
 public:
  enum class Command : std::uint8_t { acts, only_looks };

  explicit InterruptGuard(Command command = Command::acts);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  static bool interrupted();

 private:
  struct Before;  // the signals' handlers before
  std::unique_ptr<Before> before_;
};

}  // namespace servodrome::app
