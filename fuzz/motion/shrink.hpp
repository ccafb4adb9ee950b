#pragma once

#include <functional>

#include "sequence.hpp"

namespace servodrome::motion {

// Returns the shortest sequence found for which `breaks` still returns true. Removes axes and events (halves, quarters
// ... and single events), then simplifies set-up, times and values, and repeats this while it helps. Calls `breaks` at
// most `most_runs` times.
Sequence shrink(Sequence sequence, const std::function<bool(const Sequence&)>& breaks, int most_runs = 2000);

}  // namespace servodrome::motion
