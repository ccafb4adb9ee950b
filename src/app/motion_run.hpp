#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/number_options.hpp"
#include "app/unit_options.hpp"

// What the commands that move one axis share.
namespace servodrome::app {

struct MotionOptions {
  BusOptions bus{.timeout_s = 60.0, .timeout_is_for_motion = true};
  bool reset_fault = false;
  bool disable = false;
  UnitOptions units{};
};

// All but the motion's own: bus, node, serial line, cycle, units, --reset-fault, --disable.
void add_motion_options(CLI::App& command, MotionOptions& options, const std::string& timeout_help);

// Turns numbers of people into the drive's units, rounded. Throws Failure where there is no such number.
class Units {
 public:
  explicit Units(const host::UnitScale& scale) : units_(scale.drive) {}

  // `name` stands in error messages.
  template <typename T>
  T position(double number, const char* name) const {
    return whole_units<T>(number * units_.position, name, number);
  }
  template <typename T>
  T velocity(double number, const char* name) const {
    return whole_units<T>(number * units_.velocity, name, number);
  }
  template <typename T>
  T acceleration(double number, const char* name) const {
    return whole_units<T>(number * units_.acceleration, name, number);
  }
  std::optional<std::int32_t> position(const std::optional<double>& number, const char* name) const {
    return number ? std::optional(position<std::int32_t>(*number, name)) : std::nullopt;
  }
  std::optional<std::uint32_t> velocity(const std::optional<double>& number, const char* name) const {
    return number ? std::optional(velocity<std::uint32_t>(*number, name)) : std::nullopt;
  }
  std::optional<std::uint32_t> acceleration(const std::optional<double>& number, const char* name) const {
    return number ? std::optional(acceleration<std::uint32_t>(*number, name)) : std::nullopt;
  }

 private:
  host::AxisUnits units_;
};

// How a motion went: a word for the result ("moved"), and what else is to be printed of it.
struct MotionResult {
  std::string done;
  std::vector<std::pair<std::string, std::optional<std::int32_t>>> positions{};  // in the drive's units
  nlohmann::ordered_json details = nlohmann::ordered_json::object();
};
using Motion = std::function<MotionResult(host::Axis402&, const host::Axis402::Progress&)>;

// Lets `plan` make a motion of the options, enables the drive, lets the motion run, and says where the axis is. Options
// that cannot be followed leave the drive as it was; what fails later leaves it at rest and disabled.
void run_motion(const MotionOptions& options, const std::function<Motion(const Units&)>& plan);

}  // namespace servodrome::app
