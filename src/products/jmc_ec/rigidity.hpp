#pragma once

#include <array>
#include <cstdint>

// The gains that real-time adjustment (P01-02) sets for a rigidity level P01-03 (ch. 7 and 8.2.2). The manual prints
// one of the 32 gain sets, the defaults of level 13 (Table 65); the other 31 are this project's choice.
//
// The proportional gain of the velocity loop rises from level to level by a tenth to a third. The other values keep
// their ratio to this gain in level 13: the position gains are 48/27 and 57/27 of it, the torque filter is 0.84 ms x 27
// Hz divided by it. Up to level 13 the integral time is inversely proportional to the gain as well. Above level 13
// filters and encoder reduce the phase, so the integral time falls with the square root of the gain only. In every
// level the integral of the second set has nearly no effect (1000 ms).
namespace servodrome::products::jmc_ec {

// In the units of the parameters.
struct GainSetValues {
  std::uint16_t position_gain_1;  // P02-00, 0.1/s
  std::uint16_t position_gain_2;  // P02-01
  std::uint16_t velocity_gain_1;  // P02-10, 0.1 Hz
  std::uint16_t integral_time_1;  // P02-11, 0.1 ms
  std::uint16_t velocity_gain_2;  // P02-13
  std::uint16_t integral_time_2;  // P02-14
  std::uint16_t torque_filter;    // P08-20, 0.01 ms
};

inline constexpr std::uint8_t printed_level = 13;
inline constexpr GainSetValues printed_set{480, 570, 270, 100, 270, 10000, 84};

// P02-10 of each level, 0.1 Hz.
inline constexpr std::array<std::uint16_t, 32> velocity_gain_of_level{
    15,  20,  25,  30,  37,  46,   57,   70,   87,   107,  132,  165,  210,  270,  335,  400,
    480, 570, 680, 810, 970, 1150, 1370, 1620, 1900, 2200, 2550, 2950, 3400, 3900, 4450, 5000};

namespace rigidity {

// The square root of a positive number by Newton's method: <cmath> has none at compile time.
constexpr double square_root(double value) {
  double root = value > 1.0 ? value : 1.0;
  for (int i = 0; i < 60; ++i) root = 0.5 * (root + value / root);
  return root;
}
constexpr std::uint16_t rounded(double value) { return static_cast<std::uint16_t>(value + 0.5); }

}  // namespace rigidity

inline constexpr auto rigidity_levels = [] {
  std::array<GainSetValues, velocity_gain_of_level.size()> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double ratio = velocity_gain_of_level[i] / double{printed_set.velocity_gain_1};
    const double integral_ratio = i <= printed_level ? ratio : rigidity::square_root(ratio);
    levels[i] = {rigidity::rounded(printed_set.position_gain_1 * ratio),
                 rigidity::rounded(printed_set.position_gain_2 * ratio),
                 velocity_gain_of_level[i],
                 rigidity::rounded(printed_set.integral_time_1 / integral_ratio),
                 velocity_gain_of_level[i],
                 printed_set.integral_time_2,
                 rigidity::rounded(printed_set.torque_filter / ratio)};
  }
  return levels;
}();

}  // namespace servodrome::products::jmc_ec
