#pragma once

#include "drive/drive.hpp"
#include "products/jmc_ec/gain_switching.hpp"
#include "products/jmc_ec/panel_objects.hpp"

// What the panel parameters do to the drive (ch. 7, ch. 8.2.2 to 8.2.8).
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
  // The factory values of P00 (ch. 6), of a motor.
  static void factory_values(Panel& panel, const drive::MotorData& motor);

  // Power-on, the parameters having their values: those that act from power-on do so now.
  void power_on(Panel& panel, const drive::MotorData& motor);

  // The motor as P00 has it: data of the rating where P00 has their rounded value (factory values), else P00's.
  drive::MotorData motor(const drive::MotorData& rating) const;

  // Puts what the parameters say into a configuration whose motor is the rotor alone and whose monitors are those of
  // the rating. The gains are those of the set in use.
  void configure(const Panel& panel, drive::Configuration& configuration) const;

  // Whether a parameter may be written now; the range has been checked.
  static dictionary::AbortCode check(const dictionary::Entry& entry, const drive::Drive& drive);
  // Parameters that real-time adjustment sets go back to what it makes of them (ch. 7, P01-02 and P01-03; ch. 8.2.2,
  // P01-02 and P01-03).
  static void written(Panel& panel);

  // Once per position-loop cycle, after the drive's own: gain switching and the outputs.
  void cycle(const Panel& panel, drive::Drive& drive);

  // P00-42 as the monitor of the DC link has it; `rating_v` stands for 0.
  float over_voltage_v(float rating_v) const { return active_.over_voltage_v != 0 ? active_.over_voltage_v : rating_v; }
  // P03-15 in command units: beyond, AL.501. 0: none.
  static std::uint32_t excessive_deviation(const Panel& panel) { return 10U * panel.position_deviation; }
  // A parameter has another value than the one that acts: AL.941, LED 13.
  bool power_cycle_needed(const Panel& panel) const;
  // Parameters as they were at power-on, for those that act from then on.
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

// P01-02 standard and positioning: the parameters that P01-03 sets, and those that positioning fixes.
void adjust_gains(Panel& panel);

}  // namespace servodrome::products::jmc_ec
