#pragma once

namespace servodrome::app {

// The first signal that an InterruptGuard (interrupt_guard.hpp) caught; 0: none.
int interrupting_signal();

}  // namespace servodrome::app
