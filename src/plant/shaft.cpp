#include "plant/shaft.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "plant/fitting.hpp"

namespace servodrome::plant {

namespace {
constexpr double h = drive::tick_seconds;
constexpr double locked_nm = 1.0e15;  // more than any torque: the bench's clamp

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

// In contact the step is backward Euler: a stop is there to end a motion, not to throw it back.
ShaftTick Shaft::solve_rigid(double torque_nm, const StopDistance& stops, bool freely) const {
  const int side = stops.high >= stops.low ? 1 : -1;
  const ShaftTick tick = solve_contact(torque_nm, side, side > 0 ? stops.high : stops.low, freely);
  // Thrown from one stop right through the other.
  const double other = (side > 0 ? stops.low : stops.high) - side * h * tick.end;
  return other > 0.0 ? solve_contact(torque_nm, -side, side > 0 ? stops.low : stops.high, freely) : tick;
}

ShaftTick Shaft::solve_contact(double torque_nm, int side, double penetration, bool freely) const {
  const double inertia_rate = (rotor_inertia_ + load_.inertia_kgm2) / h;
  const double viscous = rotor_viscous_ + load_.viscous_friction_nms;
  const double contact = load_.stop_stiffness_nm_per_rad * h + load_.stop_damping_nms;  // Nm per rad/s of end speed
  const double spring = load_.stop_stiffness_nm_per_rad * penetration;
  const double drive = inertia_rate * speed_ + torque_nm;
  const double holding = direction_ == 0 && !freely ? total_friction_.held_nm : total_friction_.sliding_nm;

  ShaftTick tick;
  const double held_drive = drive - side * std::max(spring, 0.0);
  if (std::abs(held_drive) > holding) {
    const int direction = sign_of(held_drive);
    const double sliding = drive - direction * total_friction_.sliding_nm;
    double divisor = inertia_rate + viscous;
    double end = sliding / divisor;
    if (penetration + side * h * end > 0.0 && spring + contact * side * end > 0.0) {  // the stop pushes back
      divisor += contact;
      end = (sliding - side * spring) / divisor;
    }
    tick.end = limited(end);
    tick.slope = 1.0 / divisor;
    tick.direction = static_cast<std::int8_t>(direction);
  }
  tick.mean = tick.end;
  return tick;
}

Shaft::Coupling Shaft::coupling_of(double twist_rad) const {
  const double half = 0.5 * load_.backlash_rad;
  if (twist_rad > half) return {true, twist_ - half};
  if (twist_rad < -half) return {true, twist_ + half};
  return {half == 0.0, twist_};
}

double Shaft::solve_pair(double rotor_torque_nm, double weight, const Coupling& coupling, const Stop& stop, bool freely,
                         ShaftTick& best) const {
  const double old = 1.0 - weight;
  const double stiffness = coupling.engaged ? load_.stiffness_nm_per_rad : 0.0;
  const double spring = stiffness * coupling.deflection_rad;
  const double link = coupling.engaged ? stiffness * weight * h + load_.damping_nms : 0.0;
  const double stop_stiffness = stop.side != 0 ? load_.stop_stiffness_nm_per_rad : 0.0;
  const double stop_spring = stop.side * stop_stiffness * stop.penetration_rad;
  const double stop_link = stop.side != 0 ? stop_stiffness * h + load_.stop_damping_nms : 0.0;
  const double load_viscous = load_.viscous_friction_nms;

  const double m11 = rotor_inertia_ / h + weight * (rotor_viscous_ + link);
  const double m12 = -weight * link;
  const double m22 = load_.inertia_kgm2 / h + weight * (load_viscous + link + stop_link);
  const double old_link = link * (speed_ - load_speed_);
  const double rotor_drive =
      rotor_torque_nm + rotor_inertia_ / h * speed_ - old * (rotor_viscous_ * speed_ + old_link) - spring;
  const double load_drive = load_torque_ + load_.inertia_kgm2 / h * load_speed_ -
                            old * ((load_viscous + stop_link) * load_speed_ - old_link) + spring - stop_spring;
  const double determinant = m11 * m22 - m12 * m12;

  // What held each mass in the last tick is tried first; a standing one may hold more than a sliding one.
  const double load_hold = load_direction_ == 0 && !freely ? load_.static_friction_nm : load_.coulomb_friction_nm;
  const std::array<int, 3> rotor_order{direction_, direction_ == 0 ? 1 : 0, direction_ == 0 ? -1 : -direction_};
  const std::array<int, 3> load_order{load_direction_, load_direction_ == 0 ? 1 : 0,
                                      load_direction_ == 0 ? -1 : -load_direction_};
  double least = -1.0;
  for (const int s : rotor_order) {
    for (const int t : load_order) {
      const double p = rotor_drive - s * rotor_friction_nm_;
      const double q = load_drive - t * load_.coulomb_friction_nm;
      double w = 0.0;
      double v = 0.0;
      double slope = 0.0;
      if (s != 0 && t != 0) {
        w = (p * m22 - m12 * q) / determinant;
        v = (m11 * q - m12 * p) / determinant;
        slope = m22 / determinant;
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
      best.end = limited(w);
      best.load_end = limited(v);
      best.direction = static_cast<std::int8_t>(s);
      best.load_direction = static_cast<std::int8_t>(t);
      best.slope = weight * slope;
      best.mean = old * speed_ + weight * best.end;
      best.load_mean = old * load_speed_ + weight * best.load_end;
      if (violation == 0.0) return 0.0;
    }
  }
  return least;
}

ShaftTick Shaft::solve_elastic(double rotor_torque_nm, const StopDistance& stops, bool freely) const {
  const Coupling now = coupling_of(twist_);
  ShaftTick tick;
  const auto twist_after = [&] { return twist_ + h * (tick.mean - tick.load_mean); };
  const auto gap_after = [&](int side) { return (side > 0 ? stops.high : stops.low) + side * h * tick.load_mean; };

  // Free of the stops, the coupling engaged (or not) and friction as it was throughout the tick: by far the most usual.
  if (stops.high <= 0.0 && stops.low <= 0.0 && !freely) {
    solve_pair(rotor_torque_nm, coupling_weight_, now, {0, 0.0}, freely, tick);
    const Coupling then = coupling_of(twist_after());
    const bool same = then.engaged == now.engaged && then.deflection_rad == now.deflection_rad;
    // Friction that turns around needs backward Euler, see prepare().
    const bool steady =
        (rotor_friction_nm_ == 0.0 || speed_ == 0.0 || tick.direction == direction_) &&
        (load_.coulomb_friction_nm == 0.0 || load_speed_ == 0.0 || tick.load_direction == load_direction_);
    if (same && steady && gap_after(1) <= 0.0 && gap_after(-1) <= 0.0) return tick;
  }

  // A contact opens or closes: backward Euler, and of the combinations of contacts the one that agrees with its own
  // outcome. What touches must push; what does not touch must not overlap, unless it is already being pulled apart.
  const double half = 0.5 * load_.backlash_rad;
  const std::array<int, 3> flanks{now.engaged ? sign_of(twist_) : 0, now.engaged ? 0 : 1,
                                  now.engaged ? -sign_of(twist_) : -1};
  const auto flank_push = [&](int flank) {
    return load_.stiffness_nm_per_rad * (flank * twist_after() - half) +
           load_.damping_nms * flank * (tick.mean - tick.load_mean);
  };
  const auto stop_push = [&](int side) {
    return load_.stop_stiffness_nm_per_rad * gap_after(side) + load_.stop_damping_nms * side * tick.load_mean;
  };
  ShaftTick best;
  double least = -1.0;
  for (const int contact : {0, 1, -1}) {
    for (std::size_t choice = 0; choice < (half > 0.0 ? 3 : 1); ++choice) {
      const int flank = flanks[choice];
      const Coupling coupling = half == 0.0  ? now
                                : flank == 0 ? Coupling{false, twist_}
                                             : Coupling{true, twist_ - flank * half};
      const Stop stop{contact, contact > 0 ? stops.high : stops.low};
      double violation = solve_pair(rotor_torque_nm, 1.0, coupling, stop, freely, tick);
      for (const int side : {1, -1}) {
        if (half > 0.0) {
          const double push = flank_push(side);
          const bool overlaps = side * twist_after() > half && push > 0.0;
          if (flank == side ? push < 0.0 : overlaps) violation += std::abs(push);
        }
        const double push = stop_push(side);
        const bool overlaps = gap_after(side) > 0.0 && push > 0.0;
        if (contact == side ? push < 0.0 : overlaps) violation += std::abs(push);
      }
      if (least >= 0.0 && violation >= least) continue;
      least = violation;
      best = tick;
      if (violation == 0.0) return best;
    }
  }
  return best;
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
