#pragma once

#include <cmath>
#include <cstdint>

#include "drive/hardware.hpp"
#include "plant/geometry.hpp"
#include "plant/parameters.hpp"
#include "plant/windings.hpp"

// The mechanical part: rotor, load, friction, brake, coupling, hard stops.
//
// Every step solves J (w1 - w0) / h = torques(mean speed) - friction implicitly for the new speed w1, with friction in
// [-F, F] opposing w1. So dry friction either slides or holds exactly, and a standing shaft stays at exactly 0 until
// the torque exceeds the breakaway value. A rigid shaft away from its stops needs one multiplication (`slide`); an
// elastic one with unchanged contacts needs one solution of its two equations.
//
// Contacts are springs with dampers that push and never pull: the hard stops, and the flanks of a backlash. A tick in
// which a contact opens, closes or pushes is divided into pieces, as many as its vibration requires, and a piece ends
// where a contact opens or closes. A vibration too fast for the finest piece is damped away: from about 2e6 rad/s on.
namespace servodrome::plant {

// Speeds in rad/s at the end of a tick and their means over it; positions change by mean * tick.
struct ShaftTick {
  double end = 0.0;
  double mean = 0.0;
  double load_end = 0.0;
  double load_mean = 0.0;
  double slope = 0.0;         // change of the rotor's mean speed with the electromagnetic torque
  double stop_j = 0.0;        // heat in the damping of the hard stops
  std::int8_t direction = 0;  // of the rotor; 0: held by friction
  std::int8_t load_direction = 0;
};

// Position of the load relative to its stops, in rad: positive beyond the stop.
struct StopDistance {
  double low;   // low stop - position
  double high;  // position - high stop
};

class Shaft {
 public:
  Shaft(const Motor& motor, const Load& load);

  // No bearing survives this speed. Speeds are limited to it, so that no torque can cause an overflow.
  static constexpr double largest_speed_rad_s = 1.0e5;

  // Response of the rigid shaft to this tick's torque, in the friction state of the last tick.
  ShaftResponse response(double other_torque_nm) const {
    return {carried_ * speed_ + mobility_ * (other_torque_nm - friction_nm_), mobility_};
  }

  // Solves the rigid shaft away from its stops, for the response to the torque of everything but motor and friction.
  // Returns true if the friction state is that of the last tick, as response() assumed. Returns false if friction
  // starts or stops holding; then the torque found with that response is not valid.
  bool slide(const ShaftResponse& response, double motor_torque_nm, double other_torque_nm, ShaftTick& tick) const {
    if (direction_ != 0) [[likely]] {
      const double mean = response.offset_rad_s + response.slope * motor_torque_nm;
      const double end = (mean - old_weight_ * speed_) * per_new_weight_;
      const double forward = end * sign_;
      if (forward > 0.0 && forward < largest_speed_rad_s) [[likely]] {
        tick.end = end;
        tick.mean = mean;
        tick.slope = mobility_;
        tick.direction = direction_;
        return true;
      }
    }
    if (held() && std::abs(motor_torque_nm + other_torque_nm) <= total_friction_.held_nm) [[unlikely]] {
      tick = {};
      return true;
    }
    const double holding_nm = direction_ == 0 ? total_friction_.held_nm : total_friction_.sliding_nm;
    return slide_anew(motor_torque_nm + other_torque_nm, holding_nm, tick);
  }
  // The same without static friction: only the sliding friction can hold the shaft. So the speed is a continuous
  // function of the torque.
  ShaftTick slide_freely(double torque_nm) const {
    ShaftTick tick;
    slide_anew(torque_nm, total_friction_.sliding_nm, tick);
    return tick;
  }

  // General solution for the given torque, with coupling and stops. `freely`: without static friction, as above; then
  // the speed is also continuous when contacts open and close.
  ShaftTick solve(double motor_torque_nm, double rotor_torque_nm, const StopDistance& stops, bool freely) const;

  void commit(const ShaftTick& tick) {
    speed_ = tick.end;
    if (tick.direction != direction_) [[unlikely]]
      set_direction(tick.direction);
  }
  void commit_general(const ShaftTick& tick);

  // A load that depends on its place and its speed. `adapt` gives the shaft the values at mid-tick, `arrive` the
  // inertia at the end of the tick; both keep the kinetic energy. `place` puts a load there without a motion.
  bool varies() const { return geometry_.varies() || stribeck_per_speed_ > 0.0; }
  void adapt(double load_revolutions);
  void arrive(double load_revolutions) { take_inertia(geometry_.at(load_revolutions).inertia_kgm2); }
  void place(double load_revolutions);
  double weight_j(double load_revolutions) const { return geometry_.at(load_revolutions).weight_j; }

  void set_load(const Load& load);
  void set_brake(double torque_nm);
  void couple();                     // set_pull will follow; see prepare()
  void set_pull(double torque_nm) {  // of another axis on the load, positive towards larger counts
    pull_nm_ = torque_nm;
    update_load_torque();
  }
  double pull_nm() const { return pull_nm_; }
  void set_locked(bool locked);
  void stop();  // stops the shaft and relaxes the coupling

  bool elastic() const { return elastic_; }
  bool held() const { return direction_ == 0 && speed_ == 0.0; }  // the rotor, by friction
  bool at_rest() const { return held() && !elastic_; }            // a rigid shaft
  double load_torque_nm() const { return load_torque_; }          // weight, external torque and pull, with sign
  double speed_rad_s() const { return speed_; }
  double load_speed_rad_s() const { return elastic_ ? load_speed_ : speed_; }
  double twist_rad() const { return twist_; }
  double kinetic_j() const;
  double elastic_j(const StopDistance& stops) const;

 private:
  // The coupling as an active spring with its deflection at the start of the step, or open within the backlash.
  struct Coupling {
    bool engaged;
    double deflection_rad;
  };
  struct Stop {
    int side;  // +1 high, -1 low, 0 none
    double penetration_rad;
  };
  // State of motion at the beginning of a tick or of a piece.
  struct Motion {
    double speed = 0.0;
    double load_speed = 0.0;
    double twist = 0.0;
    std::int8_t direction = 0;
    std::int8_t load_direction = 0;
  };
  // The contact at which a piece ended; its state in the next piece is fixed, independent of rounding.
  struct Forced {
    bool is = false;
    int side = 0;  // side that pushes; 0: none
    // `was`: the side that pushed in the piece. The other arguments: present overlap of the contacts on both sides.
    void look(int was, double high_rad, double low_rad);
  };
  struct Friction {
    double held_nm;     // at standstill
    double sliding_nm;  // while moving
  };

  static double limited(double speed) {
    return speed > largest_speed_rad_s ? largest_speed_rad_s
                                       : (speed < -largest_speed_rad_s ? -largest_speed_rad_s : speed);
  }
  void take_inertia(double load_kgm2);
  void update_load_torque() {
    load_torque_ = -(load_.gravity_torque_nm + load_.external_torque_nm + weight_nm_ - pull_nm_);
  }
  bool slide_anew(double torque_nm, double holding_nm, ShaftTick& tick) const;
  void set_direction(std::int8_t direction);
  void prepare();
  void prepare_pieces();
  // Solved in pieces: the rigid shaft near stops, and the elastic shaft when contacts change.
  ShaftTick solve_rigid(double torque_nm, const StopDistance& stops, bool freely) const;
  ShaftTick solve_elastic(double rotor_torque_nm, const StopDistance& stops, bool freely) const;
  ShaftTick solve_in_pieces(double rotor_torque_nm, const StopDistance& stops, bool freely) const;
  struct Step {
    double seconds;
    double weight;  // least weight of the final speed in the mean; friction may need more:
    double rotor_weight;
    double load_weight;
    double rotor_rate;  // inertia / seconds
    double load_rate;
    double stretch = 1.0;        // factor on the time in which the masses move against each other
    double relative_rate = 0.0;  // reduced inertia / that time - reduced inertia / `seconds`
    double longer = 0.0;         // (stretch - 1) / inertia of both
  };
  // The equations of both masses over a step without dry friction: matrix and right-hand side.
  struct Pair {
    double m11;
    double m12;
    double m21;
    double m22;
    double rotor_nm;
    double load_nm;
    double old_speed;  // share of the old speed in the mean
    double old_load_speed;
    double rotor_weight;
    double load_weight;
    void take(int rotor_way, int load_way, double end, double load_end, double slope, ShaftTick& tick) const;
  };
  Pair pair_of(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
               const Stop& stop) const;
  Step step_of(double seconds, double weight) const;
  // Solves both masses over a step with given coupling and stop; determines the friction states.
  bool slide_pair(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
                  const Stop& stop, ShaftTick& tick) const;
  void solve_pair(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
                  const Stop& stop, bool freely, ShaftTick& tick) const;
  Motion motion() const { return {speed_, load_speed_, twist_, direction_, load_direction_}; }
  Coupling coupling_of(double twist_rad) const;
  double stop_push_nm(double penetration_rad, double inward_rad_s) const {
    return load_.stop_stiffness_nm_per_rad * penetration_rad + load_.stop_damping_nms * inward_rad_s;
  }
  double flank_push_nm(double overlap_rad, double inward_rad_s) const {
    return load_.stiffness_nm_per_rad * overlap_rad + load_.damping_nms * inward_rad_s;
  }
  double stop_heat_j(const StopDistance& gaps, int side, double way, double mean, double weight) const;
  int pushing_stop(const StopDistance& stops, double speed) const;
  int pushing_flank(double twist_rad, double twist_rate) const;

  // Rigid shaft, used in every tick.
  double speed_ = 0.0;
  double old_weight_ = 0.5;  // mean = old_weight * w0 + new_weight * w1
  double new_weight_ = 0.5;
  double per_new_weight_ = 2.0;
  double carried_ = 0.0;      // share of the old speed in the mean, in the friction state of the last tick
  double mobility_ = 0.0;     // mean speed per torque: 0 while held
  double friction_nm_ = 0.0;  // sliding friction with its present sign
  double sign_ = 0.0;         // direction_
  double load_torque_ = 0.0;
  std::int8_t direction_ = 0;
  bool elastic_ = false;
  bool locked_ = false;
  bool stops_ = false;
  bool coupled_ = false;  // to another axis

  // Used in other cases.
  std::int8_t load_direction_ = 0;
  double load_speed_ = 0.0;
  double twist_ = 0.0;
  Friction total_friction_{};
  double momentum_ = 0.0;        // J / h minus the share of viscous friction in the old speed
  double admittance_ = 0.0;      // new speed per torque
  double turning_weight_ = 1.0;  // new_weight_ and derived values for a tick in which the friction reverses
  double turning_momentum_ = 0.0;
  double turning_admittance_ = 0.0;
  double rotor_friction_nm_ = 0.0;  // includes the brake
  double rotor_inertia_;
  double rotor_viscous_;
  double rotor_coulomb_;
  double brake_torque_ = 0.0;
  double coupling_weight_ = 0.5;
  Step whole_{};  // a tick with the coupling engaged, and one within the backlash
  Step loose_{};
  double piece_s_ = 0.0;       // length of the pieces of a tick with contacts
  double piece_weight_ = 0.5;  // weight of the new speed in a piece
  Load load_;                  // with the inertia, stiffness and sliding friction of the present place and speed
  Geometry geometry_;
  double pull_nm_ = 0.0;
  double weight_nm_ = 0.0;           // of the present place, with the force of a belt whose stiffness changes
  double sliding_nm_ = 0.0;          // of the load at high speed
  double stribeck_nm_ = 0.0;         // additional sliding friction at standstill
  double stribeck_per_speed_ = 0.0;  // 1 / scale of the speed; 0: no Stribeck friction
};

}  // namespace servodrome::plant
