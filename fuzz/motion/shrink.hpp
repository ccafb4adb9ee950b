#pragma once

#include <functional>

#include "sequence.hpp"

namespace servodrome::motion {

// The shortest sequence found that still breaks what `breaks` looks for: events are taken out (by halves, quarters ...
// and one by one), then arguments and times made simpler, as long as that helps. At most `most_runs` runs.
Sequence shrink(Sequence sequence, const std::function<bool(const Sequence&)>& breaks, int most_runs = 2000);

}  // namespace servodrome::motion
