#include "plant/shaft.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "plant/fitting.hpp"

namespace servodrome::plant {

namespace {
constexpr double h = drive::tick_seconds;
constexpr double locked_nm = 1.0e15;  // more than any torque: the bench's clamp

constexpr double even_share = 0.02;  // of its deflection, by which a flank's may change in one step

int sign_of(double value) { return (value > 0.0) - (value < 0.0); }
}  // namespace

Shaft::Shaft(const Motor& motor, const Load& load)
    : rotor_inertia_(motor.rotor_inertia_kgm2),
      rotor_viscous_(motor.viscous_friction_nms),
      rotor_coulomb_(motor.coulomb_friction_nm),
      load_(load) {
  prepare();
}

void Shaft::set_load(const Load& load) {
  load_ = load;
  prepare();
}

void Shaft::set_brake(double torque_nm) {
  brake_torque_ = torque_nm;
  prepare();
}

void Shaft::set_locked(bool locked) {
  locked_ = locked;
  if (locked) {
    speed_ = 0.0;
    direction_ = 0;
  }
  prepare();
}

void Shaft::stop() {
  speed_ = load_speed_ = twist_ = 0.0;
  load_direction_ = 0;
  set_direction(0);
}

void Shaft::prepare() {
  elastic_ = load_.elastic;
  stops_ = load_.low_stop_counts != no_low_limit || load_.high_stop_counts != no_high_limit;
  load_torque_ = -(load_.gravity_torque_nm + load_.external_torque_nm);
  const double held = locked_ ? locked_nm : rotor_coulomb_ + brake_torque_;
  rotor_friction_nm_ = held;
  total_friction_ = {held + load_.static_friction_nm, held + load_.coulomb_friction_nm};

  const double inertia = rotor_inertia_ + load_.inertia_kgm2;
  const double viscous = rotor_viscous_ + load_.viscous_friction_nms;
  new_weight_ = fitted_weight(viscous * h / inertia);
  old_weight_ = 1.0 - new_weight_;
  momentum_ = inertia / h - viscous * old_weight_;
  admittance_ = 1.0 / (inertia / h + viscous * new_weight_);
  // Friction opposes the new speed. When that differs in sign from the old one, only backward Euler makes sure that it
  // takes energy.
  turning_weight_ = total_friction_.sliding_nm > 0.0 ? 1.0 : new_weight_;
  turning_momentum_ = inertia / h - viscous * (1.0 - turning_weight_);
  turning_admittance_ = 1.0 / (inertia / h + viscous * turning_weight_);

  if (elastic_) {
    // The trapezoidal rule keeps a vibration's energy and its frequency to (w h)^2 / 12. What is too fast or too
    // strongly damped for the tick to show is damped away instead of rung.
    const double reduced = rotor_inertia_ * load_.inertia_kgm2 / inertia;
    const double lightest = std::min(rotor_inertia_, load_.inertia_kgm2);
    const double fastest =
        h * std::max(std::sqrt(load_.stiffness_nm_per_rad / reduced),
                     load_.damping_nms / reduced + std::max(rotor_viscous_, load_.viscous_friction_nms) / lightest);
    coupling_weight_ = 0.5 + 0.5 * std::clamp(0.5 * (fastest - 1.0), 0.0, 1.0);
  }
  prepare_pieces();
  set_direction(direction_);
}

void Shaft::set_direction(std::int8_t direction) {
  direction_ = direction;
  mobility_ = direction == 0 ? 0.0 : new_weight_ * admittance_;
  friction_nm_ = direction * total_friction_.sliding_nm;
}

bool Shaft::slide_anew(double torque_nm, double holding_nm, ShaftTick& tick) const {
  const double drive = turning_momentum_ * speed_ + torque_nm;
  const bool held = std::abs(drive) <= holding_nm;
  tick.direction = static_cast<std::int8_t>(held ? 0 : sign_of(drive));
  tick.end = held ? 0.0 : limited((drive - tick.direction * total_friction_.sliding_nm) * turning_admittance_);
  tick.mean = (1.0 - turning_weight_) * speed_ + turning_weight_ * tick.end;
  tick.slope = held ? 0.0 : turning_weight_ * turning_admittance_;
  return held && direction_ == 0;
}

void Shaft::commit_general(const ShaftTick& tick) {
  commit(tick);
  if (!elastic_) return;
  twist_ += h * (tick.mean - tick.load_mean);
  load_speed_ = tick.load_end;
  load_direction_ = tick.load_direction;
}

ShaftTick Shaft::solve(double motor_torque_nm, double rotor_torque_nm, const StopDistance& stops, bool freely) const {
  if (elastic_) return solve_elastic(motor_torque_nm + rotor_torque_nm, stops, freely);
  return solve_rigid(motor_torque_nm + rotor_torque_nm + load_torque_, stops, freely);
}

Shaft::Coupling Shaft::coupling_of(double twist_rad) const {
  const double half = 0.5 * load_.backlash_rad;
  if (twist_rad > half) return {true, twist_ - half};
  if (twist_rad < -half) return {true, twist_ + half};
  return {half == 0.0, twist_};
}

double Shaft::solve_pair(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
                         const Stop& stop, bool freely, ShaftTick& best) const {
  const double seconds = step.seconds;
  const double weight = step.weight;
  const double old = 1.0 - weight;
  const double stiffness = coupling.engaged ? load_.stiffness_nm_per_rad : 0.0;
  const double spring = stiffness * coupling.deflection_rad;
  const double link = coupling.engaged ? stiffness * weight * seconds + load_.damping_nms : 0.0;
  const double stop_stiffness = stop.side != 0 ? load_.stop_stiffness_nm_per_rad : 0.0;
  const double stop_spring = stop.side * stop_stiffness * stop.penetration_rad;
  const double stop_link = stop.side != 0 ? stop_stiffness * weight * seconds + load_.stop_damping_nms : 0.0;
  const double load_viscous = load_.viscous_friction_nms;
  const double rotor_rate = rotor_inertia_ / seconds;
  const double load_rate = load_.inertia_kgm2 / seconds;

  const double m11 = rotor_rate + weight * (rotor_viscous_ + link);
  const double m12 = -weight * link;
  const double m22 = load_rate + weight * (load_viscous + link + stop_link);
  const double old_link = link * (from.speed - from.load_speed);
  const double rotor_drive =
      rotor_torque_nm + rotor_rate * from.speed - old * (rotor_viscous_ * from.speed + old_link) - spring;
  const double load_drive = load_torque_ + load_rate * from.load_speed -
                            old * ((load_viscous + stop_link) * from.load_speed - old_link) + spring - stop_spring;
  const double inverse = 1.0 / (m11 * m22 - m12 * m12);

  const auto take = [&](int rotor_way, int load_way, double end, double load_end, double slope) {
    best.end = limited(end);
    best.load_end = limited(load_end);
    best.direction = static_cast<std::int8_t>(rotor_way);
    best.load_direction = static_cast<std::int8_t>(load_way);
    best.slope = weight * slope;
    best.mean = old * from.speed + weight * best.end;
    best.load_mean = old * from.load_speed + weight * best.load_end;
  };
  // What held each mass before is tried first; a standing one may hold more than a sliding one.
  const int was = from.direction;
  const int load_was = from.load_direction;
  if (was != 0 && load_was != 0) [[likely]] {
    const double p = rotor_drive - was * rotor_friction_nm_;
    const double q = load_drive - load_was * load_.coulomb_friction_nm;
    const double end = (p * m22 - m12 * q) * inverse;
    const double load_end = (m11 * q - m12 * p) * inverse;
    if (end * was >= 0.0 && load_end * load_was >= 0.0) [[likely]] {
      take(was, load_was, end, load_end, m22 * inverse);
      return 0.0;
    }
  }
  const double load_hold = load_was == 0 && !freely ? load_.static_friction_nm : load_.coulomb_friction_nm;
  const std::array<int, 3> rotor_order{was, was == 0 ? 1 : 0, was == 0 ? -1 : -was};
  const std::array<int, 3> load_order{load_was, load_was == 0 ? 1 : 0, load_was == 0 ? -1 : -load_was};
  double least = -1.0;
  for (const int s : rotor_order) {
    for (const int t : load_order) {
      const double p = rotor_drive - s * rotor_friction_nm_;
      const double q = load_drive - t * load_.coulomb_friction_nm;
      double w = 0.0;
      double v = 0.0;
      double slope = 0.0;
      if (s != 0 && t != 0) {
        w = (p * m22 - m12 * q) * inverse;
        v = (m11 * q - m12 * p) * inverse;
        slope = m22 * inverse;
      } else if (s != 0) {
        w = p / m11;
        slope = 1.0 / m11;
      } else if (t != 0) {
        v = q / m22;
      }
      // Violations as torques, so that they compare.
      const double rotor_violation = s != 0 ? -s * w * m11 : std::abs(rotor_drive - m12 * v) - rotor_friction_nm_;
      const double load_violation = t != 0 ? -t * v * m22 : std::abs(load_drive - m12 * w) - load_hold;
      const double violation = std::max({rotor_violation, load_violation, 0.0});
      if (least >= 0.0 && violation >= least) continue;
      least = violation;
      take(s, t, w, v, slope);
      if (violation == 0.0) return 0.0;
    }
  }
  return least;
}

ShaftTick Shaft::solve_elastic(double rotor_torque_nm, const StopDistance& stops, bool freely) const {
  // Free of the stops, the coupling engaged (or not) and friction as it was throughout the tick: by far the most usual.
  const Coupling now = coupling_of(twist_);
  if (stops.high <= 0.0 && stops.low <= 0.0 && !freely) {
    ShaftTick tick;
    solve_pair(motion(), rotor_torque_nm, {h, coupling_weight_}, now, {0, 0.0}, freely, tick);
    const double twist = twist_ + h * (tick.mean - tick.load_mean);
    const Coupling then = coupling_of(twist);
    const bool same = then.engaged == now.engaged && then.deflection_rad == now.deflection_rad;
    // A flank that would pull has let go meanwhile.
    const bool pushes =
        load_.backlash_rad == 0.0 || !now.engaged ||
        (pushing_flank(twist_, speed_ - load_speed_) != 0 && pushing_flank(twist, tick.end - tick.load_end) != 0);
    // A rebound, whose force changes much within the tick, is over too soon for one step.
    const double turned = std::abs(h * (tick.mean - tick.load_mean));
    const bool even = load_.backlash_rad == 0.0 || !now.engaged || turned <= even_share * std::abs(now.deflection_rad);
    // Friction that turns around needs backward Euler, see prepare().
    const bool steady =
        (rotor_friction_nm_ == 0.0 || speed_ == 0.0 || tick.direction == direction_) &&
        (load_.coulomb_friction_nm == 0.0 || load_speed_ == 0.0 || tick.load_direction == load_direction_);
    const double high = stops.high + h * tick.load_mean;
    const double low = stops.low - h * tick.load_mean;
    if (same && pushes && even && steady && high <= 0.0 && low <= 0.0) return tick;
  }
  return solve_in_pieces(rotor_torque_nm, stops, freely);
}

double Shaft::kinetic_j() const {
  if (elastic_) return 0.5 * (rotor_inertia_ * speed_ * speed_ + load_.inertia_kgm2 * load_speed_ * load_speed_);
  return 0.5 * (rotor_inertia_ + load_.inertia_kgm2) * speed_ * speed_;
}

double Shaft::elastic_j(const StopDistance& stops) const {
  const double penetration = std::max({stops.low, stops.high, 0.0});
  const double contact = 0.5 * load_.stop_stiffness_nm_per_rad * penetration * penetration;
  if (!elastic_) return contact;
  const Coupling coupling = coupling_of(twist_);
  if (!coupling.engaged) return contact;
  return contact + 0.5 * load_.stiffness_nm_per_rad * coupling.deflection_rad * coupling.deflection_rad;
}

}  // namespace servodrome::plant
