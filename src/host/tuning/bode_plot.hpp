#pragma once

#include <string>

#include "host/tuning/loop.hpp"

namespace servodrome::host::tuning {

struct BodeCurve {
  std::string name;
  std::vector<BodePoint> points;
};

// Gain over phase, over one logarithmic axis of frequency, as an SVG document.
std::string bode_svg(std::span<const BodeCurve> curves, const std::string& title);

}  // namespace servodrome::host::tuning
