// The shaft in ticks in which contacts push, open or close.
#include <algorithm>
#include <cmath>

#include "plant/shaft.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

constexpr double piece_angle_rad = 0.1;  // greatest angle of the fastest vibration in one piece
constexpr double fewest_pieces = 16.0;
constexpr double most_pieces = 256.0;
constexpr int most_steps = 4096;        // including the pieces that contact events add
constexpr double least_share = 1.0e-3;  // of a piece: an earlier event counts as one at the beginning of the piece

// Time within `seconds` at which a value that changes linearly from `before` to `after` is 0.
double crossing(double before, double after, double seconds) { return seconds * before / (before - after); }

}  // namespace

// Checks the state at the real end of a piece, because speeds do not change linearly. A contact that was predicted to
// close may not be reached, and would then pull. When one contact opens, the opposite contact may be closed already.
void Shaft::Forced::look(int was, double high_rad, double low_rad) {
  const auto reached = [&](int other) { return (other > 0 ? high_rad : low_rad) >= 0.0; };
  if (!is) return;
  if (side != 0) {
    is = reached(side);
  } else if (was != 0 && reached(-was)) {
    side = -was;
  }
}

void Shaft::prepare_pieces() {
  const double carried = elastic_ ? load_.inertia_kgm2 : rotor_inertia_ + load_.inertia_kgm2;
  double fastest = 0.0;
  if (stops_) {
    fastest = std::max(std::sqrt(load_.stop_stiffness_nm_per_rad / carried), load_.stop_damping_nms / carried);
  }
  if (elastic_) {
    const double reduced = rotor_inertia_ * load_.inertia_kgm2 / (rotor_inertia_ + load_.inertia_kgm2);
    fastest = std::max({fastest, std::sqrt(load_.stiffness_nm_per_rad / reduced), load_.damping_nms / reduced});
  }
  const double pieces = std::clamp(std::ceil(h * fastest / piece_angle_rad), fewest_pieces, most_pieces);
  piece_s_ = h / pieces;
  // As for the coupling, see prepare().
  piece_weight_ = 0.5 + 0.5 * std::clamp(0.5 * (piece_s_ * fastest - 1.0), 0.0, 1.0);
}

int Shaft::pushing_stop(const StopDistance& stops, double speed) const {
  if (stops.high >= 0.0 && stop_push_nm(stops.high, speed) > 0.0) return 1;
  if (stops.low >= 0.0 && stop_push_nm(stops.low, -speed) > 0.0) return -1;
  return 0;
}

int Shaft::pushing_flank(double twist_rad, double twist_rate) const {
  const double half = 0.5 * load_.backlash_rad;
  for (const int side : {1, -1}) {
    const double overlap = side * twist_rad - half;
    if (overlap >= 0.0 && flank_push_nm(overlap, side * twist_rate) > 0.0) return side;
  }
  return 0;
}

// Heat in the damping of the stops for a distance `way` with the mean speed `mean`; `side` is the stop that pushes (0:
// none). It is the work on the stop minus the energy kept in the spring. A stop that has opened does not return the
// energy that remained in its spring.
double Shaft::stop_heat_j(const StopDistance& gaps, int side, double way, double mean, double weight) const {
  const auto stored = [this](double penetration) {
    const double deep = std::max(penetration, 0.0);
    return 0.5 * load_.stop_stiffness_nm_per_rad * deep * deep;
  };
  double heat_j = 0.0;
  for (const int each : {1, -1}) {
    const double before = each > 0 ? gaps.high : gaps.low;
    const double after = before + each * way;
    if (each == side) {
      heat_j += stop_push_nm(before + weight * each * way, each * mean) * (after - before);
    } else if (before <= 0.0) {
      continue;
    }
    heat_j -= stored(after) - stored(before);
  }
  return heat_j;
}

ShaftTick Shaft::solve_rigid(double torque_nm, const StopDistance& stops, bool freely) const {
  const double inertia = rotor_inertia_ + load_.inertia_kgm2;
  const double viscous = rotor_viscous_ + load_.viscous_friction_nms;
  const double weight = piece_weight_;
  double holding = direction_ == 0 && !freely ? total_friction_.held_nm : total_friction_.sliding_nm;

  StopDistance gaps = stops;
  double speed = speed_;
  double moved = 0.0;
  double stop_j = 0.0;
  Forced forced;
  bool slid = false;
  double left = h;
  for (int i = 0; left > 0.0 && i < most_steps; ++i) {
    const int side = forced.is ? forced.side : pushing_stop(gaps, speed);
    forced = {};
    const double penetration = side > 0 ? gaps.high : gaps.low;
    const double stiffness = side != 0 ? load_.stop_stiffness_nm_per_rad : 0.0;
    const double damping = side != 0 ? load_.stop_damping_nms : 0.0;
    const double spring = side != 0 ? side * stiffness * penetration : 0.0;
    int direction = sign_of(speed);
    if (direction == 0) {
      if (std::abs(torque_nm - spring) <= holding) break;  // it stands for the rest of the tick
      direction = sign_of(torque_nm - spring);
    }
    slid = true;
    const auto end_after = [&](double seconds) {
      const double rate = inertia / seconds;
      const double braking = viscous + damping + stiffness * weight * seconds;
      const double drive = torque_nm - spring - direction * total_friction_.sliding_nm;
      return limited((drive + (rate - (1.0 - weight) * braking) * speed) / (rate + weight * braking));
    };
    double seconds = std::min(piece_s_, left);
    double end = end_after(seconds);
    const auto mean = [&] { return (1.0 - weight) * speed + weight * end; };
    const bool turns = end * direction < 0.0 && speed != 0.0;
    double time = seconds;
    if (turns) {
      time = crossing(speed, end, seconds);
      if (side != 0) forced = {true, side};
    } else if (side != 0) {
      const double push = stop_push_nm(penetration, side * speed);
      const double push_then = stop_push_nm(penetration + side * seconds * mean(), side * end);
      if (push_then < 0.0) {
        time = push > 0.0 ? crossing(push, push_then, seconds) : 0.0;
        forced = {true, 0};
      }
    } else {
      for (const int other : {1, -1}) {
        const double gap = other > 0 ? gaps.high : gaps.low;
        const double gap_then = gap + other * seconds * mean();
        if (gap >= 0.0 || gap_then <= 0.0) continue;
        time = crossing(gap, gap_then, seconds);
        forced = {true, other};
      }
    }
    if (time < seconds) {  // the piece ends at the event
      if (time <= least_share * seconds) time = 0.0;
      seconds = time;
      end = time > 0.0 ? end_after(time) : speed;
    }
    const double way = time * mean();
    stop_j += stop_heat_j(gaps, side, way, mean(), weight);
    moved += way;
    gaps = {stops.low - moved, stops.high + moved};
    if (time > 0.0) forced.look(side, gaps.high, gaps.low);
    speed = turns ? 0.0 : end;  // at a reversal the next piece starts from rest
    if (turns) holding = total_friction_.sliding_nm;
    left -= time;
  }

  ShaftTick tick;
  tick.end = speed;
  tick.mean = moved / h;
  tick.slope = slid ? 0.5 * h / inertia : 0.0;
  tick.stop_j = stop_j;
  tick.direction = static_cast<std::int8_t>(sign_of(speed));
  return tick;
}

ShaftTick Shaft::solve_in_pieces(double rotor_torque_nm, const StopDistance& stops, bool freely) const {
  const double half = 0.5 * load_.backlash_rad;
  StopDistance gaps = stops;
  Motion now = motion();
  double moved = 0.0;
  double load_moved = 0.0;
  double stop_j = 0.0;
  bool slid = false;
  Forced forced_stop;
  Forced forced_flank;
  double left = h;
  for (int i = 0; left > 0.0 && i < most_steps; ++i) {
    const double seconds = std::min(piece_s_, left);
    const int side = forced_stop.is ? forced_stop.side : pushing_stop(gaps, now.load_speed);
    const int flank = half == 0.0       ? 0
                      : forced_flank.is ? forced_flank.side
                                        : pushing_flank(now.twist, now.speed - now.load_speed);
    forced_stop = forced_flank = {};
    const Coupling coupling = half == 0.0 ? Coupling{true, now.twist} : Coupling{flank != 0, now.twist - flank * half};
    const Stop stop{side, side > 0 ? gaps.high : gaps.low};
    ShaftTick piece;
    double weight = piece_weight_;
    const auto solve_for = [&](double time) {
      weight = piece_weight_;
      solve_pair(now, rotor_torque_nm, step_of(time, weight), coupling, stop, freely, piece);
      const bool turns = (now.speed != 0.0 && piece.direction != now.direction) ||
                         (now.load_speed != 0.0 && piece.load_direction != now.load_direction);
      if (!turns) return;
      weight = 1.0;
      solve_pair(now, rotor_torque_nm, step_of(time, weight), coupling, stop, freely, piece);
    };
    solve_for(seconds);
    slid |= piece.direction != 0;

    // The first contact that opens or closes ends the piece.
    double time = seconds;
    const auto ends_at = [&](double before, double after, Forced& forced, int then) {
      const double at = before == 0.0 ? 0.0 : crossing(before, after, seconds);
      if (at >= time) return;
      time = at;
      forced_stop = forced_flank = {};
      forced = {true, then};
    };
    const double twist_then = now.twist + seconds * (piece.mean - piece.load_mean);
    if (flank != 0) {
      const double push = flank_push_nm(flank * now.twist - half, flank * (now.speed - now.load_speed));
      const double push_then = flank_push_nm(flank * twist_then - half, flank * (piece.end - piece.load_end));
      if (push_then < 0.0) ends_at(std::max(push, 0.0), push_then, forced_flank, 0);
    } else if (half > 0.0) {
      for (const int other : {1, -1}) {
        const double overlap = other * now.twist - half;
        const double overlap_then = other * twist_then - half;
        if (overlap < 0.0 && overlap_then > 0.0) ends_at(overlap, overlap_then, forced_flank, other);
      }
    }
    if (side != 0) {
      const double push = stop_push_nm(stop.penetration_rad, side * now.load_speed);
      const double push_then =
          stop_push_nm(stop.penetration_rad + side * seconds * piece.load_mean, side * piece.load_end);
      if (push_then < 0.0) ends_at(std::max(push, 0.0), push_then, forced_stop, 0);
    } else {
      for (const int other : {1, -1}) {
        const double gap = other > 0 ? gaps.high : gaps.low;
        const double gap_then = gap + other * seconds * piece.load_mean;
        if (gap < 0.0 && gap_then > 0.0) ends_at(gap, gap_then, forced_stop, other);
      }
    }
    if (time < seconds) {
      if (time <= least_share * seconds) time = 0.0;
      if (time > 0.0) solve_for(time);
    }
    if (time > 0.0) {
      const double way = time * piece.load_mean;
      stop_j += stop_heat_j(gaps, side, way, piece.load_mean, weight);
      moved += time * piece.mean;
      load_moved += way;
      now = {piece.end, piece.load_end, twist_ + moved - load_moved, piece.direction, piece.load_direction};
      gaps = {stops.low - load_moved, stops.high + load_moved};
      forced_stop.look(side, gaps.high, gaps.low);
      forced_flank.look(flank, now.twist - half, -now.twist - half);
    }
    left -= time;
  }

  ShaftTick tick;
  tick.end = now.speed;
  tick.mean = moved / h;
  tick.load_end = now.load_speed;
  tick.load_mean = load_moved / h;
  tick.slope = slid ? 0.5 * h / rotor_inertia_ : 0.0;
  tick.stop_j = stop_j;
  tick.direction = now.direction;
  tick.load_direction = now.load_direction;
  return tick;
}

}  // namespace servodrome::plant
