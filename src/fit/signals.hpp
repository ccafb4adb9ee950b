#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "fit/table.hpp"
#include "fit/windows.hpp"

// The signals of an axis from the columns of a recording, in SI units on a common time axis.
namespace servodrome::fit {

// Known data of the motor; empty: unknown.
struct Motor {
  std::optional<double> rated_torque_nm{};
  std::optional<double> rated_current_a{};           // rms
  std::optional<double> torque_constant_nm_per_a{};  // per A rms
  std::optional<int> pole_pairs{};
  std::optional<double> counts_per_revolution{};
  std::optional<double> rotor_inertia_kgm2{};
  int phases = 3;                            // 2: windings in quadrature
  double temperature_coefficient = 3.93e-3;  // of the winding's resistance, per K above 25 degC
};

enum class Role : std::uint8_t {
  position,
  velocity,
  torque,
  quadrature_current,
  direct_current,
  quadrature_voltage,
  direct_voltage,
  temperature,
};
inline constexpr std::size_t role_count = 8;

// "iq", the name in options, and "the quadrature current (iq)", the name in messages.
std::string_view word_of(Role role);
std::string_view text_of(Role role);

// Selects a column for a role, instead of the search by name.
struct Assignment {
  Role role;
  std::string column;  // name as in the recording, or as from plain_name
  std::string unit;    // empty: the recording's unit
};
// "ROLE=COLUMN" or "ROLE=COLUMN@UNIT", e.g. "iq=current_actual_value@0.1A". Throws Error for any other text, and for a
// unit whose factor is 0, not finite, or outside of 1e-15 to 1e15.
Assignment parse_assignment(std::string_view text);

struct Signals {
  std::string source;
  std::vector<double> seconds;                         // increasing
  std::array<std::vector<double>, role_count> values;  // rad, rad/s, Nm, A and V of amplitude, degC; empty: none
  std::array<std::string, role_count> columns;         // name of the column used
  std::array<std::string, role_count> why_not;         // the missing value that makes a recorded column unusable
  std::vector<std::string> remarks;

  bool has(Role role) const { return !values[static_cast<std::size_t>(role)].empty(); }
  const std::vector<double>& of(Role role) const { return values[static_cast<std::size_t>(role)]; }
  // Samples per second outside of the gaps of `period_of`.
  double rate_hz() const { return seconds.size() < 2 ? 0.0 : 1.0 / period_of(seconds); }
};

// `axis` selects the axis if the table has several. Keeps only the rows in which every signal besides the temperature
// has a number; a temperature is held until the next one. Throws Error if no column has a role; if an axis or a column
// does not exist; if a column has no sample, or a sample beyond 1e20 in SI units; or if the columns have no time in
// common.
Signals signals_of(const Table& table, const Motor& motor, std::span<const Assignment> assignments,
                   const std::string& axis);

}  // namespace servodrome::fit
