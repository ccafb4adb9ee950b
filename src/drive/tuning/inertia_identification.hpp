#pragma once

#include <cstdint>

#include "drive/axis.hpp"
#include "drive/tuning/inertia_estimator.hpp"

namespace servodrome::drive {

// Identification of inertia and friction by moves of the drive's own: the torque swings the axis to and fro about where
// it stood, between two speeds, until the estimate is good. Torque, not position, because the gains that a position
// loop would need are what this is for. It behaves as a mode of operation that stands in for the one that is set.
//
// The torque begins at what holds the axis, rises until the axis moves, and after every reversal is set so that a swing
// takes some windows of the estimator, whatever the inertia.
class InertiaIdentification {
 public:
  struct Request {
    double travel_counts = 65536.0;   // to either side of where the axis stands
    double speed_counts_per_s = 0.0;  // swings turn around at this speed
    float torque_limit = 1.0F;        // fraction of rated torque, beyond what holds the axis
    double uncertainty = 0.005;       // relative, of the inertia: good enough
    double timeout_s = 6.0;
  };
  enum class Outcome : std::uint8_t {
    none,  // not asked for yet
    running,
    done,
    travel_exceeded,  // the axis left the travel allowed
    no_motion,        // the torque limit does not move it
    not_converged,    // not good enough within the time
    limit_switch,
    interrupted,  // halt, a stop, another mode, a fault, power off
  };

  // The axis must stand under control of the loops. False: the request makes no sense.
  bool begin(Axis& axis, const Request& request);
  void abort(Outcome outcome = Outcome::interrupted) {
    if (running()) outcome_ = outcome;
  }
  bool running() const { return outcome_ == Outcome::running; }
  Outcome outcome() const { return outcome_; }
  const InertiaEstimate& estimate() const { return estimate_; }  // with Outcome::done

  // --- As a mode
  static constexpr Loop loop = Loop::torque;
  void enter(Axis&) {}
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void step(Axis& axis);
  void halt(Axis&) { abort(); }
  void resume(Axis&) {}
  void interrupt(Axis&, int) { abort(); }
  double deceleration(const Axis& axis) const { return axis.profile_deceleration(); }
  std::uint16_t status(const Axis&) const { return 0; }

 private:
  void reverse();

  Request request_{};
  Outcome outcome_ = Outcome::none;
  InertiaEstimator estimator_{};
  InertiaEstimate estimate_{};
  Counts origin_ = 0;
  double cycle_s_ = 1e-3;
  double elapsed_s_ = 0.0;
  double swing_s_ = 0.0;    // since the last reversal
  float holding_ = 0.0F;    // torques as fractions of rated: what holds the axis,
  float amplitude_ = 0.0F;  // what swings it,
  float breakaway_ = 0.0F;  // what first moved it,
  float level_ = 0.0F;      // and what acts now beyond `holding_`
  double direction_ = 1.0;
  std::uint32_t reversals_ = 0;
  bool probing_ = true;
  bool ending_ = false;
};

}  // namespace servodrome::drive
