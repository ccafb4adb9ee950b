#pragma once

#include "drive/drive.hpp"
#include "products/jmc_ec/gain_switching.hpp"
#include "products/jmc_ec/panel_objects.hpp"

// The effects of the panel parameters on the drive (ch. 7, ch. 8.2.2 to 8.2.8).
namespace servodrome::products::jmc_ec {

// Not printed: the current loop's bandwidth.
inline constexpr float current_bandwidth_hz = 2000.0F;

// Units of the levels of gain switching (ch. 8.2.3).
inline constexpr double torque_level_of_rated = 4000.0;  // 1000 is 25 %
inline constexpr double speed_level_of_rpm = 5.0;        // 1000 is 200 rpm
inline constexpr double position_level_of_turn = 131072.0;

// The outputs: bit n for DOn (ch. 3.1.2).
inline constexpr std::uint32_t alarm_output = 1U << 0;
inline constexpr std::uint32_t in_position_output = 1U << 1;

class PanelControl {
 public:
  // Sets P00 to the factory values for a motor (ch. 6).
  static void factory_values(Panel& panel, const drive::MotorData& motor);

  // Call this at power-on, after the parameters are loaded: it applies the parameters that act from power-on.
  void power_on(Panel& panel, const drive::MotorData& motor);

  // The motor according to P00. Where P00 has the rounded value of the rating (its factory value), the exact value of
  // the rating applies.
  drive::MotorData motor(const drive::MotorData& rating) const;

  // Applies the parameters to a configuration that has the rotor's inertia alone and the monitors of the rating. The
  // gains are those of the set in use.
  void configure(const Panel& panel, drive::Configuration& configuration) const;

  // Returns `none` if a parameter may be written now; the range has been checked before.
  static dictionary::AbortCode check(const dictionary::Entry& entry, const drive::Drive& drive);
  // Real-time adjustment overwrites the parameters that it sets (P01-02 and P01-03, ch. 7 and 8.2.2).
  static void written(Panel& panel);

  // Gain switching and the outputs. Call this once per position-loop cycle, after the drive's tick().
  void cycle(const Panel& panel, drive::Drive& drive);

  // The threshold P00-42 for the monitor of the DC link; 0 stands for `rating_v`.
  float over_voltage_v(float rating_v) const { return active_.over_voltage_v != 0 ? active_.over_voltage_v : rating_v; }
  // P03-15 in command units: a greater deviation is AL.501. 0: no limit.
  static std::uint32_t excessive_deviation(const Panel& panel) { return 10U * panel.position_deviation; }
  // Returns true if a parameter differs from the value in force since power-on: AL.941, 13 flashes.
  bool power_cycle_needed(const Panel& panel) const;
  // The parameters at power-on, for those that act from power-on.
  const Panel& active() const { return active_; }

  bool in_position() const { return in_position_; }  // P03-05, P03-06
  std::uint32_t levels() const { return levels_; }   // of the outputs, 1 while the opto-coupler conducts
  const GainSwitching& switching() const { return switching_; }

 private:
  drive::Gains gains(const Panel& panel, const drive::MotorData& motor) const;
  bool reached(const Panel& panel, const drive::Drive& drive) const;

  Panel active_{};
  Panel factory_{};
  GainSwitching switching_{};
  bool in_position_ = false;
  std::uint32_t levels_ = 0;
};

// For P01-02 "standard" and "positioning": sets the parameters that follow from P01-03, and those that "positioning"
// fixes.
void adjust_gains(Panel& panel);

}  // namespace servodrome::products::jmc_ec
