#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/number_options.hpp"
#include "app/unit_options.hpp"
#include "catalogue/product.hpp"

// Shared by the commands that move one axis.
namespace servodrome::app {

struct MotionOptions {
  BusOptions bus{.timeout_s = 60.0, .timeout_is_for_motion = true};
  bool reset_fault = false;
  bool disable = false;
  UnitOptions units{};
};

// Adds all options except those of the single motion: bus, node, serial line, cycle, units, --reset-fault, --disable.
void add_motion_options(CLI::App& command, MotionOptions& options, const std::string& timeout_help);

// Converts the user's numbers to the drive's units, rounded. Throws Failure if the result is out of range.
class Units {
 public:
  explicit Units(const master::UnitScale& scale) : units_(scale.drive) {}

  // `name` is used in error messages.
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
  catalogue::AxisUnits units_;
};

// Result of a motion: a word for it ("moved"), and further values to print.
struct MotionResult {
  std::string done;
  std::vector<std::pair<std::string, std::optional<std::int32_t>>> positions{};  // in the drive's units
  nlohmann::ordered_json details = nlohmann::ordered_json::object();
};
using Motion = std::function<MotionResult(master::Axis402&, const master::Axis402::Progress&)>;

// Calls `plan` to create a motion from the options, enables the drive, runs the motion, and prints the final position.
// Invalid options leave the drive unchanged; after a later error the axis stands and is disabled.
void run_motion(const MotionOptions& options, const std::function<Motion(const Units&)>& plan);

}  // namespace servodrome::app
