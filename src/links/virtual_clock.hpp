#pragma once

#include "links/time.hpp"

namespace servodrome::links {

// Moves virtual time for a client in the same process.
class VirtualClock {
 public:
  virtual ~VirtualClock() = default;
  virtual Time now() const = 0;
  // Advances the line, and with it its buses, by its smallest step, and not beyond `latest`.
  virtual void step(Time latest) = 0;
  // Advances it up to `target`; one in the past does nothing.
  virtual void run_until(Time target) {
    while (now() < target) step(target);
  }
};

}  // namespace servodrome::links
