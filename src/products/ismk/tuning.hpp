#pragma once

#include <cstdint>

#include "dictionary/abort_code.hpp"
#include "drive/drive.hpp"
#include "drive/tuning/inertia_estimator.hpp"
#include "drive/tuning/resonance_analysis.hpp"
#include "products/ismk/objects.hpp"
#include "products/ismk/terminals.hpp"

namespace servodrome::products::ismk {

// 2340h sub 10h, Auto_Tuning_Control (Table 6-1).
namespace auto_tuning {
inline constexpr std::uint8_t enabled = 0x01;
inline constexpr std::uint8_t adjusts_kvp = 0x02;
inline constexpr std::uint8_t adjusts_acceleration_feed_forward = 0x04;
inline constexpr std::uint8_t not_forward = 0x10;
inline constexpr std::uint8_t not_reverse = 0x20;
// Bit 7, "use friction to calculate the load", is stored without effect: the estimate always separates friction.
}  // namespace auto_tuning

// 60F9h sub 4, notch filter control (Table 6-3).
namespace notch_control {
inline constexpr std::uint8_t filters = 0x03;
// Bit 4 selects the actual current (Table 6-3), but the value 128 selects it too, although its bit 4 is 0 (ch. 6.2.1).
// The analysis always uses the actual current.
inline constexpr std::uint8_t actual_speed = 0x20;
inline constexpr std::uint8_t run = 0x80;
}  // namespace notch_control

// Automatic tuning of the iSMK: online auto-tuning (ch. 6.1), inertia recognition and rigidity, which are functions
// of its PC software (ch. 4.1.3), automatic setting of notches (ch. 6.2.1), and the choice of the gain set
// (ch. 6.3 and 6.4).
//
// Every function that may change gains returns whether it did. The drive then needs a new configuration.
class LoopTuning {
 public:
  // Power-on: only the inertia of the rotor is known.
  void reset(double rotor_inertia_kgm2);
  // Call this when the objects have their saved values: sets Velocity_BW from kvp, and clears commands that were in
  // progress when the objects were saved.
  void objects_loaded(ServoObjects& objects, const drive::MotorData& motor);

  // Rotor and load, as far as known.
  double inertia_kgm2() const { return inertia_kgm2_; }
  // Inertia of the load divided by that of the rotor.
  double inertia_ratio() const { return inertia_kgm2_ / rotor_inertia_kgm2_ - 1.0; }
  bool identified() const { return identified_; }
  const drive::InertiaEstimate& estimate() const { return estimate_; }

  // Completes a configuration: inertia, gains, rates of the loops. During the search for resonances the gains are low,
  // so that an axis that oscillates by itself stops oscillating.
  void configure(const ServoObjects& objects, drive::Configuration& configuration) const;

  // Returns `none` if an object of this class' groups may take a value in the present state.
  static dictionary::AbortCode check(const dictionary::Entry& entry, std::int64_t value, const drive::Drive& drive);
  // Keeps objects with the same meaning equal to each other.
  void written(const dictionary::Entry& entry, ServoObjects& objects, drive::Drive& drive);
  void refresh(const dictionary::Entry& entry, ServoObjects& objects, const drive::MotorData& motor) const;

  // Call this once per position-loop cycle, after the drive's tick() and the terminals' cycle().
  bool cycle(drive::Drive& drive, ServoObjects& objects, const Terminals& terminals);

  // Inertia recognition of the PC software: moves of the drive's own, over up to `turns` revolutions to either side.
  // Returns false unless the axis is enabled and at rest. The result is the drive's identification().
  bool recognise_inertia(drive::Drive& drive, double turns);

  // Rigidity of the PC software. The manual does not print its table, so the bandwidth of the velocity loop selects the
  // gains: kvp by the formula, Kpp from a quarter of the bandwidth (ch. 6.2.2), integral and feedback filter to match
  // (ch. 6.2.1), for the inertia that is known.
  void set_rigidity(double bandwidth_hz, ServoObjects& objects, const drive::MotorData& motor);

  const drive::ResonanceAnalysis& analysis() const { return analysis_; }

 private:
  static bool select_gains(ServoObjects& objects, const Terminals& terminals);
  bool tune_online(drive::Drive& drive, ServoObjects& objects);
  bool take_recognition(drive::Drive& drive, ServoObjects& objects);
  bool set_notches(drive::Drive& drive, ServoObjects& objects);
  void adopt(const drive::InertiaEstimate& estimate, ServoObjects& objects, const drive::MotorData& motor,
             std::uint8_t adjust);
  void set_kvp(ServoObjects& objects, const drive::MotorData& motor) const;

  double rotor_inertia_kgm2_ = 1e-5;
  double inertia_kgm2_ = 1e-5;
  double bandwidth_hz_ = 24.0;  // Velocity_BW before rounding; kvp follows a new inertia so that this stays
  drive::InertiaEstimate estimate_{};
  std::uint32_t windows_ = 0;  // of the estimator at the last call
  drive::InertiaEstimator estimator_{};
  std::uint8_t learning_ = 0;     // Auto_Tuning_Control at the start of the estimator
  double learned_cycle_s_ = 0.0;  // the cycle of the estimator
  bool identified_ = false;
  bool recognising_ = false;
  bool analysing_ = false;
  drive::ResonanceAnalysis analysis_{};
};

}  // namespace servodrome::products::ismk
