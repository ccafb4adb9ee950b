#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

// A controller's routine from the JMC manual, read from tests/interop/ethercat/routines/*.toml (the README there
// explains the keys).
namespace examples {

struct Routine {
  struct StartUp {
    std::uint16_t index;
    std::uint8_t sub;
    std::int64_t value;
    unsigned bits;
  };
  struct Homing {
    bool by_drive = true;
    unsigned bit = 0;  // of 60FDh: the home switch, if the controller homes
    double direction = 1.0;
    double speed = 0.0;
    double creep = 0.0;
    double acceleration = 0.0;
  };
  struct Step {
    std::string block;
    double position = 0.0;  // position, or distance of a relative move
    double velocity = 0.0;  // may have a sign
    double acceleration = 0.0;
    double deceleration = 0.0;
    double direction = 1.0;
    double turns = 0.0;        // distance of a motion without a target
    std::optional<double> at;  // turns from home
  };

  std::string title;
  std::string model;
  double counts_per_unit = 1.0;
  std::vector<std::uint32_t> outputs, inputs;  // mapping words; empty: the drive's default mapping
  std::vector<StartUp> start_up;
  std::optional<Homing> homing;
  double home = 0.0;  // turns of the true shaft
  std::vector<Step> program;
};

// Throws std::runtime_error.
Routine load_routine(const std::string& path);

}  // namespace examples
