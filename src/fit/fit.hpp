#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/signals.hpp"

// The parameters of an axis out of a recording of its motion: windings, torque constant, inertia, friction, weight,
// delays. The model and what it leaves out are in docs/fit.md, the method in docs/decisions/0022.
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
  std::optional<double> value;  // none: the recording does not show it
  double half_width = 0.0;      // of the confidence interval of 95 %
  std::string why_not;          // without a value
  std::string remedy;
};

struct Result {
  std::vector<Figure> figures;  // every parameter, in the order above
  std::vector<std::string> remarks;
  // What was found besides the parameters. Where it is not there, the recording does not show it.
  std::optional<double> stage_drop_v;   // that the power stage keeps for itself of the voltage, along the current
  std::optional<bool> turns_backwards;  // the encoder counts against the turn of the phases
  double electrical_rms_v = 0.0;        // of the residuals, smoothed by the windows
  double mechanical_rms_nm = 0.0;
  std::size_t electrical_windows = 0;
  std::size_t mechanical_windows = 0;

  const Figure& of(Parameter parameter) const { return figures[static_cast<std::size_t>(parameter)]; }
};

inline constexpr std::size_t fewest_samples = 200;

// Throws Error if there are too few samples, nothing says how the shaft moves, or it does not move.
Result fit(const Signals& signals, const Motor& motor);

}  // namespace servodrome::fit
