#include "plant/shaft.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "plant/fitting.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {
constexpr double locked_nm = 1.0e15;  // more than any torque: the clamp of the bench

constexpr double even_share = 0.02;  // greatest relative change of a flank's deflection in one step

}  // namespace

Shaft::Shaft(const Motor& motor, const Load& load)
    : rotor_inertia_(motor.rotor_inertia_kgm2),
      rotor_viscous_(motor.viscous_friction_nms + motor.iron_eddy_nms),
      rotor_coulomb_(motor.coulomb_friction_nm + motor.iron_hysteresis_nm),
      geometry_(load) {
  set_load(load);
}

void Shaft::set_load(const Load& load) {
  load_ = load;
  geometry_ = Geometry(load);
  weight_nm_ = 0.0;
  sliding_nm_ = load.coulomb_friction_nm;
  stribeck_nm_ = load.static_friction_nm - load.coulomb_friction_nm;
  stribeck_per_speed_ = load.stribeck_speed_rad_s > 0.0 ? 1.0 / load.stribeck_speed_rad_s : 0.0;
  prepare();
}

void Shaft::adapt(double load_revolutions) {
  const Geometry::Point point = geometry_.at(load_revolutions);
  take_inertia(point.inertia_kgm2);
  load_.stiffness_nm_per_rad = point.stiffness_nm_per_rad;
  weight_nm_ = point.weight_nm;
  if (elastic_) {
    const double deflection = coupling_of(twist_).engaged ? coupling_of(twist_).deflection_rad : 0.0;
    weight_nm_ += 0.5 * point.stiffness_slope * deflection * deflection;
  }
  if (stribeck_per_speed_ > 0.0) {
    const double ratio = load_speed_rad_s() * stribeck_per_speed_;
    load_.coulomb_friction_nm = sliding_nm_ + stribeck_nm_ * std::exp(-ratio * ratio);
  }
  prepare();
}

void Shaft::take_inertia(double load_kgm2) {
  if (load_kgm2 == load_.inertia_kgm2) return;
  const double rigid = elastic_ ? 0.0 : rotor_inertia_;
  double& speed = elastic_ ? load_speed_ : speed_;
  speed = limited(speed * std::sqrt((rigid + load_.inertia_kgm2) / (rigid + load_kgm2)));
  load_.inertia_kgm2 = load_kgm2;
}

void Shaft::place(double load_revolutions) {
  load_.inertia_kgm2 = geometry_.at(load_revolutions).inertia_kgm2;
  adapt(load_revolutions);
}

void Shaft::set_brake(double torque_nm) {
  brake_torque_ = torque_nm;
  prepare();
}

void Shaft::couple() {
  coupled_ = true;
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

// If viscous friction stops a mass within a tick or two, uses the weight that is exact for it.
Shaft::Step Shaft::step_of(double seconds, double weight) const {
  const auto weight_of = [=](double viscous, double inertia) {
    const double decay = viscous * seconds / inertia;
    return decay > 0.1 ? std::max(weight, fitted_weight(decay)) : weight;
  };
  return {.seconds = seconds,
          .weight = weight,
          .rotor_weight = weight_of(rotor_viscous_, rotor_inertia_),
          .load_weight = weight_of(load_.viscous_friction_nms, load_.inertia_kgm2),
          .rotor_rate = rotor_inertia_ / seconds,
          .load_rate = load_.inertia_kgm2 / seconds};
}

void Shaft::prepare() {
  elastic_ = load_.elastic;
  stops_ = load_.low_stop_counts != no_low_limit || load_.high_stop_counts != no_high_limit;
  update_load_torque();
  const double held = locked_ ? locked_nm : rotor_coulomb_ + brake_torque_;
  rotor_friction_nm_ = held;
  total_friction_ = {held + load_.static_friction_nm, held + load_.coulomb_friction_nm};

  const double inertia = rotor_inertia_ + load_.inertia_kgm2;
  const double viscous = rotor_viscous_ + load_.viscous_friction_nms;
  new_weight_ = fitted_weight(viscous * h / inertia);
  old_weight_ = 1.0 - new_weight_;
  per_new_weight_ = 1.0 / new_weight_;
  momentum_ = inertia / h - viscous * old_weight_;
  admittance_ = 1.0 / (inertia / h + viscous * new_weight_);
  // Friction opposes the new speed. If that has the opposite sign of the old one, only backward Euler guarantees that
  // friction takes energy.
  turning_weight_ = total_friction_.sliding_nm > 0.0 ? 1.0 : new_weight_;
  turning_momentum_ = inertia / h - viscous * (1.0 - turning_weight_);
  turning_admittance_ = 1.0 / (inertia / h + viscous * turning_weight_);

  if (elastic_) {
    // The trapezoidal rule conserves the energy of a vibration, and its frequency up to (w h)^2 / 12. A vibration that
    // is too fast or too strongly damped for the tick is damped away instead of ringing.
    const double reduced = rotor_inertia_ * load_.inertia_kgm2 / inertia;
    const double fastest = h * std::max(std::sqrt(load_.stiffness_nm_per_rad / reduced), load_.damping_nms / reduced);
    coupling_weight_ = 0.5 + 0.5 * std::clamp(0.5 * (fastest - 1.0), 0.0, 1.0);
    // With a step lengthened by this factor, the trapezoidal rule gives the exact phase of the two masses against each
    // other. If the load is coupled to another axis, the step is not lengthened: the torque of that coupling makes a
    // leapfrog step (AxisCoupling) only together with the plain trapezoidal rule.
    const double half = 0.5 * h * std::sqrt(load_.stiffness_nm_per_rad / reduced);
    loose_ = whole_ = step_of(h, coupling_weight_);
    const bool rings = !coupled_ && fastest <= 1.0 && whole_.rotor_weight == 0.5 && whole_.load_weight == 0.5;
    if (rings) {
      whole_.stretch = std::tan(half) / half;
      whole_.relative_rate = reduced / h * (1.0 / whole_.stretch - 1.0);
      whole_.longer = (whole_.stretch - 1.0) / inertia;
    }
  }
  prepare_pieces();
  set_direction(direction_);
}

void Shaft::set_direction(std::int8_t direction) {
  direction_ = direction;
  sign_ = direction;
  mobility_ = direction == 0 ? 0.0 : new_weight_ * admittance_;
  carried_ = old_weight_ + mobility_ * momentum_;
  friction_nm_ = direction * total_friction_.sliding_nm;
}

bool Shaft::slide_anew(double torque_nm, double holding_nm, ShaftTick& tick) const {
  // A shaft that starts from rest does not reverse, so its mean speed is half its final speed.
  const bool rests = speed_ == 0.0;
  const double weight = rests ? new_weight_ : turning_weight_;
  const double admittance = rests ? admittance_ : turning_admittance_;
  const double drive = turning_momentum_ * speed_ + torque_nm;
  const bool held = std::abs(drive) <= holding_nm;
  tick.direction = static_cast<std::int8_t>(held ? 0 : sign_of(drive));
  tick.end = held ? 0.0 : limited((drive - tick.direction * total_friction_.sliding_nm) * admittance);
  tick.mean = (1.0 - weight) * speed_ + weight * tick.end;
  tick.slope = held ? 0.0 : weight * admittance;
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

[[gnu::always_inline]] inline Shaft::Pair Shaft::pair_of(const Motion& from, double rotor_torque_nm, const Step& step,
                                                         const Coupling& coupling, const Stop& stop) const {
  const double seconds = step.seconds * step.stretch;
  const double stiffness = coupling.engaged ? load_.stiffness_nm_per_rad : 0.0;
  const double spring = stiffness * coupling.deflection_rad;
  const double link = coupling.engaged ? stiffness * step.weight * seconds + load_.damping_nms : 0.0;
  const double stop_stiffness = stop.side != 0 ? load_.stop_stiffness_nm_per_rad : 0.0;
  const double stop_spring = stop.side * stop_stiffness * stop.penetration_rad;
  const double stop_link = stop.side != 0 ? stop_stiffness * step.weight * seconds + load_.stop_damping_nms : 0.0;
  Pair pair;
  pair.rotor_weight = step.rotor_weight;
  pair.load_weight = step.load_weight;
  pair.m11 = step.rotor_rate + step.relative_rate + pair.rotor_weight * (rotor_viscous_ + link);
  pair.m12 = -step.relative_rate - pair.load_weight * link;
  pair.m21 = -step.relative_rate - pair.rotor_weight * link;
  pair.m22 = step.load_rate + step.relative_rate + pair.load_weight * (load_.viscous_friction_nms + link + stop_link);
  pair.old_speed = (1.0 - pair.rotor_weight) * from.speed;
  pair.old_load_speed = (1.0 - pair.load_weight) * from.load_speed;
  const double old_link = link * (pair.old_speed - pair.old_load_speed);
  const double inert = step.relative_rate * (from.speed - from.load_speed);
  pair.rotor_nm =
      rotor_torque_nm + step.rotor_rate * from.speed + inert - (rotor_viscous_ * pair.old_speed + old_link) - spring;
  pair.load_nm = load_torque_ + step.load_rate * from.load_speed - inert -
                 ((load_.viscous_friction_nms + stop_link) * pair.old_load_speed - old_link) + spring - stop_spring;
  return pair;
}

[[gnu::always_inline]] inline void Shaft::Pair::take(int rotor_way, int load_way, double end, double load_end,
                                                     double slope, ShaftTick& tick) const {
  tick.end = limited(end);
  tick.load_end = limited(load_end);
  tick.direction = static_cast<std::int8_t>(rotor_way);
  tick.load_direction = static_cast<std::int8_t>(load_way);
  tick.slope = rotor_weight * slope;
  tick.mean = old_speed + rotor_weight * tick.end;
  tick.load_mean = old_load_speed + load_weight * tick.load_end;
}

// Solves the most frequent case: both masses keep sliding in their directions. Returns false if friction starts or
// stops holding one of them.
bool Shaft::slide_pair(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
                       const Stop& stop, ShaftTick& tick) const {
  const int way = from.direction;
  const int load_way = from.load_direction;
  if (way == 0 || load_way == 0) return false;
  const Pair pair = pair_of(from, rotor_torque_nm, step, coupling, stop);
  const double inverse = 1.0 / (pair.m11 * pair.m22 - pair.m12 * pair.m21);
  const double p = pair.rotor_nm - way * rotor_friction_nm_;
  const double q = pair.load_nm - load_way * load_.coulomb_friction_nm;
  const double end = (p * pair.m22 - pair.m12 * q) * inverse;
  const double load_end = (pair.m11 * q - pair.m21 * p) * inverse;
  if (end * way < 0.0 || load_end * load_way < 0.0) return false;
  pair.take(way, load_way, end, load_end, pair.m22 * inverse, tick);
  const double further = step.longer * (tick.mean - tick.load_mean);
  tick.mean += load_.inertia_kgm2 * further;
  tick.load_mean -= rotor_inertia_ * further;
  tick.slope += load_.inertia_kgm2 * step.longer * pair.rotor_weight * (pair.m22 + pair.m21) * inverse;
  return tick.mean * way >= 0.0 && tick.load_mean * load_way >= 0.0;
}

void Shaft::solve_pair(const Motion& from, double rotor_torque_nm, const Step& step, const Coupling& coupling,
                       const Stop& stop, bool freely, ShaftTick& tick) const {
  if (slide_pair(from, rotor_torque_nm, step, coupling, stop, tick)) return;
  const Pair pair = pair_of(from, rotor_torque_nm, step, coupling, stop);
  const double inverse = 1.0 / (pair.m11 * pair.m22 - pair.m12 * pair.m21);
  // Try the previous friction states first; static friction may be higher than sliding friction.
  const int was = from.direction;
  const int load_was = from.load_direction;
  const double load_hold = load_was == 0 && !freely ? load_.static_friction_nm : load_.coulomb_friction_nm;
  const std::array<int, 3> rotor_order{was, was == 0 ? 1 : 0, was == 0 ? -1 : -was};
  const std::array<int, 3> load_order{load_was, load_was == 0 ? 1 : 0, load_was == 0 ? -1 : -load_was};
  double least = -1.0;
  for (const int s : rotor_order) {
    for (const int t : load_order) {
      const double p = pair.rotor_nm - s * rotor_friction_nm_;
      const double q = pair.load_nm - t * load_.coulomb_friction_nm;
      double w = 0.0;
      double v = 0.0;
      double slope = 0.0;
      if (s != 0 && t != 0) {
        w = (p * pair.m22 - pair.m12 * q) * inverse;
        v = (pair.m11 * q - pair.m21 * p) * inverse;
        slope = pair.m22 * inverse;
      } else if (s != 0) {
        w = p / pair.m11;
        slope = 1.0 / pair.m11;
      } else if (t != 0) {
        v = q / pair.m22;
      }
      // Violations as torques, so that they are comparable.
      const double rotor_violation =
          s != 0 ? -s * w * pair.m11 : std::abs(pair.rotor_nm - pair.m12 * v) - rotor_friction_nm_;
      const double load_violation = t != 0 ? -t * v * pair.m22 : std::abs(pair.load_nm - pair.m21 * w) - load_hold;
      const double violation = std::max({rotor_violation, load_violation, 0.0});
      if (least >= 0.0 && violation >= least) continue;
      least = violation;
      pair.take(s, t, w, v, slope, tick);
      if (violation == 0.0) return;
    }
  }
}

ShaftTick Shaft::solve_elastic(double rotor_torque_nm, const StopDistance& stops, bool freely) const {
  // The most frequent case: no contact with the stops, and coupling and friction keep their states during the tick.
  const Coupling now = coupling_of(twist_);
  if (stops.high <= 0.0 && stops.low <= 0.0 && !freely) {
    ShaftTick tick;
    // Masses held by friction do not vibrate as the lengthened step assumes.
    if (!slide_pair(motion(), rotor_torque_nm, now.engaged ? whole_ : loose_, now, {0, 0.0}, tick)) [[unlikely]]
      solve_pair(motion(), rotor_torque_nm, loose_, now, {0, 0.0}, freely, tick);
    const double twist = twist_ + h * (tick.mean - tick.load_mean);
    const Coupling then = coupling_of(twist);
    const bool same = then.engaged == now.engaged && then.deflection_rad == now.deflection_rad;
    // A flank that would have to pull has opened during the tick.
    const bool pushes =
        load_.backlash_rad == 0.0 || !now.engaged ||
        (pushing_flank(twist_, speed_ - load_speed_) != 0 && pushing_flank(twist, tick.end - tick.load_end) != 0);
    // A rebound changes its force much within the tick, so one step is too coarse for it.
    const double turned = std::abs(h * (tick.mean - tick.load_mean));
    const bool even = load_.backlash_rad == 0.0 || !now.engaged || turned <= even_share * std::abs(now.deflection_rad);
    // Friction that reverses needs backward Euler, see prepare().
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
