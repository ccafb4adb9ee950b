#pragma once

#include <cstdint>

#include "drive/axis.hpp"
#include "drive/tuning/inertia_estimator.hpp"

namespace servodrome::drive {

// Identifies inertia and friction by test moves: the torque moves the axis back and forth about its start position,
// between two speeds, until the estimate is accurate enough. It controls torque and not position, because the gains of
// a position loop are known only afterwards. While it runs, it replaces the current mode of operation.
//
// The torque begins at the holding torque and rises until the axis moves. After each reversal the torque is adapted so
// that a swing takes a few windows of the estimator for any inertia.
class InertiaIdentification {
 public:
  struct Request {
    double travel_counts = 65536.0;   // to either side of the start position
    double speed_counts_per_s = 0.0;  // a swing is reversed at this speed
    float torque_limit = 1.0F;        // fraction of rated torque, on top of the holding torque
    double uncertainty = 0.005;       // required relative uncertainty of the inertia
    double timeout_s = 6.0;
  };
  enum class Outcome : std::uint8_t {
    none,  // not requested yet
    running,
    done,
    travel_exceeded,  // the axis left the permitted travel, or met a software limit
    no_motion,        // the torque limit does not move it
    not_converged,    // not accurate enough within the time
    limit_switch,
    interrupted,  // halt, a stop, another mode, a fault, power off
  };

  // Precondition: the axis stands still under control of the loops. Returns false if the request is invalid, if
  // the software limits leave no room, or if identification already runs.
  bool begin(Axis& axis, const Request& request);
  void abort(Outcome outcome = Outcome::interrupted) {
    if (running()) outcome_ = outcome;
  }
  bool running() const { return outcome_ == Outcome::running; }
  Outcome outcome() const { return outcome_; }
  const InertiaEstimate& estimate() const { return estimate_; }  // with Outcome::done

  // --- Interface of a mode
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
  static bool meets_software_limit(const Axis& axis);
  void reverse();

  Request request_{};
  Outcome outcome_ = Outcome::none;
  InertiaEstimator estimator_{};
  InertiaEstimate estimate_{};
  Counts origin_ = 0;
  double cycle_s_ = 1e-3;
  double elapsed_s_ = 0.0;
  double swing_s_ = 0.0;    // since the last reversal
  float holding_ = 0.0F;    // torques as fractions of rated: holding torque,
  float amplitude_ = 0.0F;  // amplitude of the swing,
  float breakaway_ = 0.0F;  // breakaway torque,
  float level_ = 0.0F;      // and the present torque on top of `holding_`
  double direction_ = 1.0;
  std::uint32_t reversals_ = 0;
  bool probing_ = true;
  bool ending_ = false;
};

}  // namespace servodrome::drive
