#pragma once

#include <array>
#include <cstdint>

#include "drive/loops/motor_data.hpp"
#include "drive/transforms.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// Finds a wire to the motor that is cut, from what a current must do where it has its way, whatever the controllers ask
// for and the DC link can give. Two signs:
//
// - Turning: the current of a whole winding system turns with the rotor. Where it flows in two phases only and never in
//   the third, while the rotor passes most of an electrical turn, the third is open.
// - Standing: a voltage across a resistance drives a current. Where it lasts and none flows, the phase is open.
//
// It looks at moments that no speed keeps step with, on average once in 2 ms.
class OpenPhase {
 public:
  struct Sample {
    std::array<float, 3> current_a{};
    std::array<float, 3> voltage_v{};  // that was applied when the current was measured
    Phase angle = 0;                   // electrical
    Counts position = 0;
    float dc_link_v = 0.0F;
    bool field_turns = true;  // the current is meant to turn with the rotor: not while it is held by current
  };

  void configure(const MotorData& motor);
  void reset() {
    if (looked_) forget();
  }
  void look(const Sample& sample);
  // Ticks from one look to the next.
  std::uint32_t next_look() { return pattern[turn_++ % pattern.size()]; }
  bool open() const { return open_; }

 private:
  static constexpr std::array<std::uint8_t, 8> pattern{25, 37, 31, 43, 22, 34, 27, 37};

  struct Watched {
    std::uint16_t passed = 0;   // sixteenths of the electrical turn, since the phase last carried its share
    std::uint16_t without = 0;  // ... where the others carried current and this one none
    float most_a = 0.0F;        // of the window
    float volts = 0.0F;         // sum over it
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

  float least_a_ = 0.0F;        // that tells anything
  float least_v_ = 0.0F;        // across a phase that stands
  Counts standing_counts_ = 0;  // a quarter of an electrical turn
};

}  // namespace servodrome::drive
