#pragma once

#include "links/time.hpp"

namespace servodrome::links {

// Moves virtual time for a client in the same process.
class VirtualClock {
 public:
  virtual ~VirtualClock() = default;
  virtual Time now() const = 0;
  // Advances the line, and with it its buses, by its smallest step.
  virtual void step() = 0;
};

}  // namespace servodrome::links
