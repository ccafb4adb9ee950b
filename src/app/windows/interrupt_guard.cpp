#include "app/interrupt_guard.hpp"

#include <array>
#include <atomic>
#include <csignal>

#include "app/interrupt_status.hpp"

namespace servodrome::app {
namespace {

// Windows calls the handler in a thread of its own.
std::atomic<int> interrupt_seen = 0;

// Windows restores the default action before it calls the handler.
void note_interrupt(int signal) {
  std::signal(signal, note_interrupt);
  int none = 0;
  interrupt_seen.compare_exchange_strong(none, signal);
}

constexpr std::array guarded{SIGINT, SIGTERM, SIGBREAK};

}  // namespace

struct InterruptGuard::Before {
  std::array<void (*)(int), guarded.size()> handlers{};
};

InterruptGuard::InterruptGuard(Command /*command*/) : before_(std::make_unique<Before>()) {
  interrupt_seen = 0;
  for (std::size_t i = 0; i < guarded.size(); ++i) before_->handlers[i] = std::signal(guarded[i], note_interrupt);
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < guarded.size(); ++i) std::signal(guarded[i], before_->handlers[i]);
}

bool InterruptGuard::interrupted() { return interrupting_signal() != 0; }

int interrupting_signal() { return interrupt_seen; }

}  // namespace servodrome::app
