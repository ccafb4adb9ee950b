#pragma once

#include <string>

#include "tools/tuning/loop.hpp"

namespace servodrome::master::tuning {

struct BodeCurve {
  std::string name;
  std::vector<BodePoint> points;
};

// An SVG document with gain above phase, over a common logarithmic frequency axis.
std::string bode_svg(std::span<const BodeCurve> curves, const std::string& title);

}  // namespace servodrome::master::tuning
