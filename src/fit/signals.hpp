#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "fit/table.hpp"

// What the columns of a recording are of an axis, in SI units on one time axis.
namespace servodrome::fit {

// What the fit takes from elsewhere. What is not given is not known.
struct Motor {
  std::optional<double> rated_torque_nm{};
  std::optional<double> rated_current_a{};           // rms
  std::optional<double> torque_constant_nm_per_a{};  // per A rms
  std::optional<int> pole_pairs{};
  std::optional<double> counts_per_revolution{};
  std::optional<double> rotor_inertia_kgm2{};
  int phases = 3;                            // 2: windings in quadrature
  double temperature_coefficient = 3.93e-3;  // of the winding's resistance, per K from 25 degC on
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

// "iq", as options have it, and "the quadrature current (iq)", as messages do.
std::string_view word_of(Role role);
std::string_view text_of(Role role);

// A column in the place of the one that is found by its name.
struct Assignment {
  Role role;
  std::string column;  // as the recording writes it, or as plain_name makes it
  std::string unit;    // empty: the recording's
};
// "ROLE=COLUMN" or "ROLE=COLUMN@UNIT", e.g. "iq=current_actual_value@0.1A". Throws Error.
Assignment parse_assignment(std::string_view text);

struct Signals {
  std::string source;
  std::vector<double> seconds;                         // rising
  std::array<std::vector<double>, role_count> values;  // rad, rad/s, Nm, A and V of amplitude, degC; empty: not there
  std::array<std::string, role_count> columns;         // whose they are
  std::array<std::string, role_count> why_not;         // recorded, but of no use: what is missing
  std::vector<std::string> remarks;

  bool has(Role role) const { return !values[static_cast<std::size_t>(role)].empty(); }
  const std::vector<double>& of(Role role) const { return values[static_cast<std::size_t>(role)]; }
  double rate_hz() const {
    if (seconds.size() < 2) return 0.0;
    return static_cast<double>(seconds.size() - 1) / (seconds.back() - seconds.front());
  }
};

// `axis` names the axis where the table has several. Throws Error: no column of any role, an axis or
// a column that is not there.
Signals signals_of(const Table& table, const Motor& motor, std::span<const Assignment> assignments,
                   const std::string& axis);

}  // namespace servodrome::fit
