#pragma once

namespace servodrome::app {

// The first signal that an InterruptGuard (bus_options.hpp) caught; 0: none.
int interrupting_signal();

}  // namespace servodrome::app
