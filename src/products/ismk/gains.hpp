#pragma once

#include <cstddef>
#include <cstdint>

#include "drive/loops/gains.hpp"
#include "drive/loops/motor_data.hpp"
#include "products/ismk/objects.hpp"

// The gains of the iSMK, converted from its units to physical ones and back (ch. 6).
//
// The scale of kvp follows from the printed formula (ch. 6.2.1): its constant 1.853358080e5 is 0.0707 x 2^18 x 10,
// where 0.0707 = 4 x 1.414 x 2048 / 16.384 x 1e-4 comes from the units of current, speed, inertia and torque constant
// that the manual prints (ch. 7.3). So a current in DEC is kvp / 2^18 times a speed error in DEC, and Imax "in DEC"
// counts in 0.1 Ap. Where the manual has no formula, a constant below holds this project's reading.
namespace servodrome::products::ismk {

// Kvi adds to the integral in every period of the slower velocity loop, 4 kHz, with the scale of kvp. With the factory
// values (kvp 4, Kvi/32 2) the integral time is then 16 ms. Kvi/32 acts with set 0 only.
inline constexpr double velocity_ki_rate_hz = 4000.0;

inline constexpr double kpp_per_hz = 100.0;  // Table 6-5; ch. 6.2.2 has 103 (C26)

// 60FBh sub 2 has the unit of 2FF0h sub 1Ah: 1000 is 100 % (Table 6-5, ch. 7.8).
inline constexpr double velocity_feed_forward_full = 1000.0;

// The acceleration in DEC, divided by K_Acc_FF, is a current in DEC. The factory value of K_Acc_FF, which gives the
// weakest feed-forward, means off.
inline constexpr std::int16_t acceleration_feed_forward_off = 32767;
inline constexpr double acceleration_percent_constant =
    6746518.0;  // of ch. 6.2.2: ACC % = this / K_Acc_FF / Easy_Kload x 100

inline constexpr float current_bandwidth_hz = 2000.0F;  // appendix I

// The width of a notch as a fraction of its frequency, and its gain at the centre. The manual prints neither.
inline constexpr float notch_relative_width = 0.5F;
inline constexpr float notch_depth = 0.05F;
// A notch needs some samples in its period: above this frequency, at 4 kHz, it is off, although 250Bh permits 2000 Hz.
inline constexpr float highest_notch_hz = 1750.0F;

// Number of notches, of four, that bits 0 and 1 of 60F9h sub 4 switch on (ch. 6.2.1: "BCD code"): none; the single
// filter of 60F9h sub 3; this filter and the second filter of automatic setting; all filters.
inline constexpr std::array<std::size_t, 4> notches_of_code{0, 1, 2, 4};

// 60F9h sub 6 without bit 7 (Table 6-2).
struct SpeedMode {
  std::uint8_t code;
  drive::VelocityFeedback feedback;
  bool feedback_filtered;
  bool command_filtered;
};
inline constexpr auto speed_modes = std::to_array<SpeedMode>({
    {0, drive::VelocityFeedback::second_order, true, false},
    {1, drive::VelocityFeedback::first_order, false, false},
    {2, drive::VelocityFeedback::observer, true, false},
    {4, drive::VelocityFeedback::first_order, true, false},
    {10, drive::VelocityFeedback::second_order, true, true},
    {11, drive::VelocityFeedback::first_order, false, true},
    {12, drive::VelocityFeedback::observer, true, true},
    {14, drive::VelocityFeedback::first_order, true, true},
});
inline constexpr std::uint8_t fast_sampling = 0x80;  // bit 7: 8 and 2 kHz instead of 4 and 1 kHz
inline constexpr drive::Rates slow_rates{4, 16};
inline constexpr drive::Rates fast_rates{2, 8};

// nullptr for an unknown code.
const SpeedMode* find_speed_mode(std::uint8_t object_value);

constexpr double feedback_filter_hz(std::uint8_t n) { return 100.0 + 20.0 * n; }  // Table 6-2
// f = 1 / (2 pi 62.5 us N); 1 is off (ch. 6.2.1).
double output_filter_hz(std::uint16_t n);

// The manual's formula (ch. 6.2.1), for the inertia of rotor and load in kg m^2 and a bandwidth in Hz; not rounded.
double kvp_of_bandwidth(double bandwidth_hz, double inertia_kgm2, const drive::MotorData& motor);
double bandwidth_of_kvp(double kvp, double inertia_kgm2, const drive::MotorData& motor);

// A per rad/s of the shaft for kvp 1.
double velocity_kp_unit(const drive::MotorData& motor);

// K_Acc_FF that fully compensates an inertia; Easy_Kload is the value with which the manual's formula then gives 100 %.
double full_acceleration_feed_forward(double inertia_kgm2, const drive::MotorData& motor);
constexpr double easy_kload(double full_feed_forward) { return acceleration_percent_constant / full_feed_forward; }

// 2FF0h sub 1Bh, permille, to K_Acc_FF and back.
std::int16_t acceleration_feed_forward_of(double permille, double inertia_kgm2, const drive::MotorData& motor);
double acceleration_permille_of(std::int16_t k_acc_ff, double inertia_kgm2, const drive::MotorData& motor);

// Kvi_Mix = 32 Kvi + Kvi/32 (Table 6-2).
constexpr std::uint32_t kvi_mix(std::uint16_t kvi, std::uint16_t kvi_32) { return 32U * kvi + kvi_32; }

// The gains of the loops for the set that the pointer selects. `motor.inertia_kgm2`: rotor and load as far as known.
drive::Gains loop_gains(const Gains& gains, const Tuning& tuning, const drive::MotorData& motor);

// Inputs of the choice of the gain set (ch. 6.3 and 6.4).
struct PointerSources {
  bool inputs_assigned = false;  // an input has the function gain switch 0 or 1 (ch. 6.3.1)
  std::uint8_t inputs = 0;       // gain switch 0 in bit 0, 1 in bit 1
  bool automatic = false;        // 60F9h sub 9
  bool at_target = false;        // target reached, or standing
  std::uint8_t written = 0;      // 60F9h sub 28h
};
constexpr std::uint8_t gain_pointer(const PointerSources& sources) {
  if (sources.inputs_assigned) return sources.inputs;
  if (sources.automatic) return sources.at_target ? 1 : 0;
  return sources.written;
}

}  // namespace servodrome::products::ismk
