#pragma once

#include <array>
#include <cstdint>

#include "drive/loops/motor_data.hpp"
#include "drive/transforms.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// Detects an open wire to the motor from the currents, independently of the controllers and of the DC link's voltage.
// Two criteria:
//
// - Turning: the current of an intact motor rotates with the rotor. If it flows in two phases but never in the third
//   while the rotor passes most of an electrical turn, the third phase is open.
// - Standing: a voltage across a winding's resistance drives a current. If the voltage lasts and no current flows, the
//   phase is open.
//
// Samples are taken at irregular intervals, on average every 2 ms, so that no speed is synchronous with them.
class OpenPhase {
 public:
  struct Sample {
    std::array<float, 3> current_a{};
    std::array<float, 3> voltage_v{};  // applied while the current was measured
    Phase angle = 0;                   // electrical
    Counts position = 0;
    float dc_link_v = 0.0F;
    // the current should rotate with the rotor; false while a constant current holds the rotor
    bool field_turns = true;
  };

  void configure(const MotorData& motor);
  void reset() {
    if (looked_) forget();
  }
  void look(const Sample& sample);
  // Ticks until the next sample.
  std::uint32_t next_look() { return pattern[turn_++ % pattern.size()]; }
  bool open() const { return open_; }

 private:
  static constexpr std::array<std::uint8_t, 8> pattern{25, 37, 31, 43, 22, 34, 27, 37};

  struct Watched {
    std::uint16_t passed = 0;   // sixteenths of the electrical turn passed since the phase last carried its current
    std::uint16_t without = 0;  // ... of them those in which the other phases carried current and this one none
    float most_a = 0.0F;        // greatest current in the window
    float volts = 0.0F;         // sum of the voltage over the window
  };
  void forget();
  void look_turning(const Sample& sample);
  void look_standing(const Sample& sample);
  void begin_window(const Sample& sample);

  std::uint8_t turn_ = 0;
  std::uint8_t phases_ = 3;
  bool open_ = false;
  bool looked_ = false;  // since reset()
  std::array<Watched, 3> watched_{};
  std::uint32_t window_samples_ = 0;
  Counts lowest_ = 0;
  Counts highest_ = 0;

  float least_a_ = 0.0F;        // least current that is evaluated
  float least_v_ = 0.0F;        // least voltage across a phase at standstill
  Counts standing_counts_ = 0;  // a quarter of an electrical turn
};

}  // namespace servodrome::drive
