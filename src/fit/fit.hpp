#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/signals.hpp"

// Estimates the parameters of an axis from a recording of its motion: windings, torque constant, inertia, friction,
// weight, delays. docs/fit.md describes the model and its limits, docs/decisions/0022 the method.
namespace servodrome::fit {

enum class Parameter : std::uint8_t {
  resistance,
  direct_inductance,
  quadrature_inductance,
  torque_constant,
  inertia,
  coulomb_friction,
  viscous_friction,
  weight,
  voltage_delay,
  torque_delay,
};
inline constexpr std::size_t parameter_count = 10;

struct ParameterText {
  std::string_view word;  // for programs
  std::string_view text;  // for people
  std::string_view unit;
};
const ParameterText& text_of(Parameter parameter);

struct Figure {
  Parameter parameter;
  std::optional<double> value;  // empty: the recording does not determine it
  double half_width = 0.0;      // half width of the confidence interval of 95 %
  std::string why_not;          // the reason for a missing value
  std::string remedy;
};

struct Result {
  std::vector<Figure> figures;  // every parameter, in the order above
  std::vector<std::string> remarks;
  // Further results; empty if the recording does not determine them.
  std::optional<double> stage_drop_v;   // voltage drop of the power stage, along the current
  std::optional<bool> turns_backwards;  // the encoder counts opposite to the rotation of the phases
  double electrical_rms_v = 0.0;        // of the residuals, smoothed by the windows
  double mechanical_rms_nm = 0.0;
  std::size_t electrical_windows = 0;
  std::size_t mechanical_windows = 0;

  const Figure& of(Parameter parameter) const { return figures[static_cast<std::size_t>(parameter)]; }
};

inline constexpr std::size_t fewest_samples = 200;

// Throws Error if there are too few samples, no signal shows the motion, or the axis does not move.
Result fit(const Signals& signals, const Motor& motor);

}  // namespace servodrome::fit
