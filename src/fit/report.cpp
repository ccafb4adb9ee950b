#include "fit/report.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::fit {

namespace {

// The value with as many decimal places as two digits of its confidence interval have.
std::string rounded(double value, double half_width) {
  if (!(half_width > 0.0) || value == 0.0) return fmt::format("{:.5g}", value);
  const int digits = static_cast<int>(std::floor(std::log10(std::abs(value))) - std::floor(std::log10(half_width))) + 2;
  return fmt::format("{:.{}g}", value, std::clamp(digits, 1, 9));
}

// In TOML a floating-point number has a point or an exponent; otherwise it is an integer.
std::string real(const std::string& digits) {
  return digits.find_first_of(".e") == std::string::npos ? digits + ".0" : digits;
}

class Keys {
 public:
  explicit Keys(const Result& result) : result_(result) {}

  void group(const char* name) {
    group_ = name;
    opened_ = false;
  }
  void line(std::string_view key, const std::string& number, const std::string& comment) {
    if (!opened_) text_ += fmt::format("{}[axis.{}]\n", text_.empty() ? "" : "\n", group_);
    opened_ = true;
    text_ += comment.empty() ? fmt::format("{} = {}\n", key, number)
                             : fmt::format("{:<44}# {}\n", fmt::format("{} = {}", key, number), comment);
  }
  // Writes a parameter that was found; a value below `low` is replaced by `low`.
  void figure(std::string_view key, Parameter parameter, double low, double less = 0.0) {
    const Figure& found = result_.of(parameter);
    if (!found.value) return;
    const double value = *found.value - less;
    const std::string spread = fmt::format("+-{:.2g} {}", found.half_width, text_of(parameter).unit);
    line(key, real(value < low ? fmt::format("{:g}", low) : rounded(value, found.half_width)),
         value < low ? fmt::format("found {:.3g} {}", value, spread) : spread);
  }
  std::string take() { return text_; }

 private:
  const Result& result_;
  std::string group_;
  bool opened_ = false;
  std::string text_;
};

}  // namespace

std::string table_of(const Result& result) {
  std::string text = fmt::format("{:<28} {:>12}  {:<12} {}\n", "parameter", "value", "95 %", "unit");
  std::vector<std::pair<std::string, std::string>> missing;  // reason and remedy, and the parameters
  for (const Figure& figure : result.figures) {
    const ParameterText& about = text_of(figure.parameter);
    if (figure.value) {
      text += fmt::format("{:<28} {:>12}  +-{:<10.2g} {}\n", about.text, rounded(*figure.value, figure.half_width),
                          figure.half_width, about.unit);
    } else {
      const std::string why = fmt::format("{}; {}", figure.why_not, figure.remedy);
      const auto same = std::find_if(missing.begin(), missing.end(), [&](const auto& one) { return one.first == why; });
      if (same == missing.end()) {
        missing.emplace_back(why, about.text);
      } else {
        same->second += fmt::format(", {}", about.text);
      }
    }
  }
  for (const auto& [why, what] : missing) text += fmt::format("not shown: {}: {}\n", what, why);
  for (const std::string& remark : result.remarks) text += fmt::format("remark: {}\n", remark);
  return text;
}

std::string toml_of(const Result& result, const Motor& motor) {
  using enum Parameter;
  std::string remarks;
  for (const std::string& remark : result.remarks) remarks += fmt::format("# remark: {}\n", remark);
  Keys keys(result);
  keys.group("motor");
  if (motor.phases == 2) keys.line("phases", "2", "");
  if (motor.rated_torque_nm) keys.line("rated_torque_nm", real(fmt::format("{:.6g}", *motor.rated_torque_nm)), "given");
  if (motor.rated_current_a) keys.line("rated_current_a", real(fmt::format("{:.6g}", *motor.rated_current_a)), "given");
  if (motor.pole_pairs) keys.line("pole_pairs", fmt::format("{}", *motor.pole_pairs), "given");
  keys.figure("resistance_ohm", resistance, 1e-3);
  const bool both = result.of(direct_inductance).value.has_value();
  keys.figure("direct_inductance_h", both ? direct_inductance : quadrature_inductance, 1e-6);
  keys.figure("quadrature_inductance_h", quadrature_inductance, 1e-6);
  if (result.of(torque_constant).value) {
    keys.figure("torque_constant_nm_per_a", torque_constant, 1e-4);
  } else if (motor.torque_constant_nm_per_a) {
    keys.line("torque_constant_nm_per_a", real(fmt::format("{:.6g}", *motor.torque_constant_nm_per_a)), "given");
  }
  // The recording determines only the sum of rotor and load.
  const double all = result.of(inertia).value.value_or(0.0);
  const bool has_rotor = motor.rotor_inertia_kgm2 && *motor.rotor_inertia_kgm2 < all;
  if (has_rotor) {
    keys.line("rotor_inertia_kgm2", real(fmt::format("{:.6g}", *motor.rotor_inertia_kgm2)), "given");
  } else {
    keys.figure("rotor_inertia_kgm2", inertia, 1e-8);
  }
  const bool friction = result.of(coulomb_friction).value || result.of(viscous_friction).value;
  if (friction) {
    keys.line("viscous_friction_nms", "0.0", "all of the friction is assigned to the load");
    keys.line("coulomb_friction_nm", "0.0", "the same");
  }
  keys.group("load");
  if (has_rotor) {
    keys.figure("inertia_kgm2", inertia, 0.0, *motor.rotor_inertia_kgm2);
  } else if (all > 0.0) {
    keys.line("inertia_kgm2", "0.0", "it includes the rotor: --rotor-inertia separates them");
  }
  keys.figure("viscous_friction_nms", viscous_friction, 0.0);
  keys.figure("coulomb_friction_nm", coulomb_friction, 0.0);
  if (const auto& found = result.of(coulomb_friction); found.value) {
    keys.line("static_friction_nm", real(rounded(std::max(*found.value, 0.0), found.half_width)),
              "not identified; at least the Coulomb friction");
  }
  keys.figure("gravity_torque_nm", weight, -1e5);
  keys.group("encoder");
  if (motor.counts_per_revolution) {
    keys.line("counts_per_revolution", fmt::format("{:.0f}", *motor.counts_per_revolution), "given");
  }
  if (result.turns_backwards.value_or(false))
    keys.line("direction", "-1", "it counts against the direction of the phases");
  return remarks + keys.take();
}

}  // namespace servodrome::fit
