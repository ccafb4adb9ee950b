#pragma once

#include "ethercat/slave/al_status.hpp"
#include "ethercat/time.hpp"

// The RUN and ERR indicators of a slave (ETG.1300 clause 4).
namespace servodrome::ethercat {

enum class Blink : std::uint8_t { off, single_flash, double_flash, blinking, flickering, on };

constexpr Blink run_indicator(AlState state) {
  switch (state) {
    case AlState::init: return Blink::off;
    case AlState::pre_operational: return Blink::blinking;
    case AlState::bootstrap: return Blink::flickering;
    case AlState::safe_operational: return Blink::single_flash;
    case AlState::operational: return Blink::on;
  }
  return Blink::off;
}

// `code` is the AL status code, `error` the error bit. Blinking: a state change was refused. Single flash: the slave
// changed its state by itself. Double flash: the process data watchdog expired.
constexpr Blink error_indicator(bool error, AlStatusCode code) {
  if (!error) return Blink::off;
  switch (code) {
    case AlStatusCode::sync_manager_watchdog: return Blink::double_flash;
    case AlStatusCode::synchronization_error:
    case AlStatusCode::fatal_sync_error:
    case AlStatusCode::no_sync:
    case AlStatusCode::restarted_locally: return Blink::single_flash;
    default: return Blink::blinking;
  }
}

// Returns true if the lamp is lit at `time`, whose origin does not matter. Flickering is 50 ms on and off, blinking
// 200 ms; a flash lasts 200 ms, flashes are 200 ms apart, and a pause of 1 s follows the last.
constexpr bool is_lit(Blink blink, Time time) {
  constexpr Time flash = std::chrono::milliseconds(200);
  constexpr Time flicker = std::chrono::milliseconds(50);
  constexpr Time pause = std::chrono::milliseconds(1000);
  switch (blink) {
    case Blink::off: return false;
    case Blink::on: return true;
    case Blink::flickering: return time % (2 * flicker) < flicker;
    case Blink::blinking: return time % (2 * flash) < flash;
    case Blink::single_flash: return time % (flash + pause) < flash;
    case Blink::double_flash: {
      const Time at = time % (3 * flash + pause);
      return at < flash || (at >= 2 * flash && at < 3 * flash);
    }
  }
  return false;
}

}  // namespace servodrome::ethercat
