#include "app/interrupt_guard.hpp"

#include <array>
#include <csignal>

#include "app/interrupt_status.hpp"

namespace servodrome::app {
namespace {

volatile std::sig_atomic_t interrupt_seen = 0;

void note_interrupt(int signal) {
  if (interrupt_seen == 0) interrupt_seen = signal;
}

constexpr std::array guarded{SIGINT,  SIGTERM, SIGHUP,  SIGPIPE,   SIGQUIT, SIGTSTP, SIGXFSZ,
                             SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU};

// Signals that keep their default action in a command that only looks.
bool is_default_when_looking(int signal) { return signal != SIGINT && signal != SIGTERM && signal != SIGHUP; }

// The write fails instead.
bool is_ignored_while_guarded(int signal) { return signal == SIGPIPE || signal == SIGXFSZ; }

}  // namespace

struct InterruptGuard::Before {
  std::array<struct sigaction, guarded.size()> actions{};
};

InterruptGuard::InterruptGuard(Command command) : before_(std::make_unique<Before>()) {
  interrupt_seen = 0;
  for (std::size_t i = 0; i < guarded.size(); ++i) {
    ::sigaction(guarded[i], nullptr, &before_->actions[i]);
    struct sigaction action {};
    action.sa_handler = is_ignored_while_guarded(guarded[i]) ? SIG_IGN : note_interrupt;
    const bool is_left = (guarded[i] == SIGHUP && before_->actions[i].sa_handler == SIG_IGN) ||
                         (is_default_when_looking(guarded[i]) && command == Command::only_looks);
    if (!is_left) ::sigaction(guarded[i], &action, nullptr);
  }
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < guarded.size(); ++i) ::sigaction(guarded[i], &before_->actions[i], nullptr);
}

bool InterruptGuard::interrupted() { return interrupting_signal() != 0; }

int interrupting_signal() { return interrupt_seen; }

}  // namespace servodrome::app
