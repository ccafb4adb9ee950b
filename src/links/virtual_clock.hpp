#pragma once

#include "links/time.hpp"

namespace servodrome::links {

// Lets a client in the same process advance virtual time.
class VirtualClock {
 public:
  virtual ~VirtualClock() = default;
  virtual Time now() const = 0;
  // Advances the line and its buses by the smallest step, and not beyond `latest`.
  virtual void step(Time latest) = 0;
  // Advances the line up to `target`. If `target` is in the past, nothing happens.
  virtual void run_until(Time target) {
    while (now() < target) step(target);
  }
};

}  // namespace servodrome::links
