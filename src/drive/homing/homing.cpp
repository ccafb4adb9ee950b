#include "drive/homing/homing.hpp"

#include <cstdlib>
#include <utility>

namespace servodrome::drive {

namespace {

using Kind = HomingCommand::Kind;

// The greatest speed of a rebound from a hard stop, as a share of the leg's speed.
constexpr double rebound_share = 1.5;

constexpr double sign(Direction direction) { return direction == Direction::positive ? 1.0 : -1.0; }

}  // namespace

void Homing::start(const Method& method, const HomingConfig& config, const HomingInputs& inputs) {
  *this = Homing{};
  method_ = method;
  config_ = config;
  if (!is_well_formed(method)) {
    error_ = HomingError::internal;
  } else if (!method.idle) {
    leg_ = first_leg(inputs);
    phase_ = Phase::begin;
  }
}

void Homing::start(std::span<const Method> methods, std::int8_t number, const HomingConfig& config,
                   const HomingInputs& inputs) {
  if (const Method* method = find_method(methods, number)) {
    start(*method, config, inputs);
  } else {
    *this = Homing{};
    error_ = HomingError::unsupported_method;
  }
}

HomingCommand Homing::step(const HomingInputs& inputs) {
  if (!active()) return {};
  if (!latched_ && config_.timeout_cycles != 0 && ++cycles_ > config_.timeout_cycles) {
    return fail(HomingError::timed_out);
  }
  switch (phase_) {
    case Phase::idle: break;
    case Phase::begin:
      // Waits for standstill: edges on a ramp in the other direction would count as edges of this leg, and the level of
      // the switches may change until the axis stops.
      if (!inputs.standing) return std::exchange(stops_first_, true) ? HomingCommand{} : HomingCommand{Kind::stop};
      leg_ = first_leg(inputs);
      return begin_leg(inputs);
    case Phase::wait:
      if (inputs.standing) return begin_leg(inputs);
      break;
    case Phase::run: return run_leg(inputs);
    case Phase::settle:
      if (!inputs.standing) break;
      if (config_.end == HomingEnd::as_method ? method_.returns_to_latch : true) {
        phase_ = Phase::return_to;
        end_ = config_.end == HomingEnd::offset ? latch_ + config_.end_offset : latch_;
        return {.kind = Kind::position, .velocity = config_.slow, .position = end_};
      }
      [[fallthrough]];
    case Phase::return_to:
      if (!inputs.standing) {
        if (offset_leads_into_limit(inputs)) return fail(HomingError::wrong_limit);
        break;
      }
      finished_ = true;
      phase_ = Phase::idle;
      break;
  }
  return {};
}

HomingCommand Homing::step_halted(HomingInputs inputs) {
  if (phase_ != Phase::run) return {};
  inputs.standing = false;
  inputs.torque = 0.0F;
  return run_leg(inputs);
}

std::uint8_t Homing::first_leg(const HomingInputs& inputs) const {
  return is_active(Signal::home, inputs) ? method_.start_active : std::uint8_t{0};
}

// Returns true if the axis moves in the direction from the latch to the home offset and the limit switch there is
// active. A motion against that direction is not checked, because the latch may be at a switch itself.
bool Homing::offset_leads_into_limit(const HomingInputs& inputs) const {
  if (end_ == latch_ || (end_ > latch_) != (end_ > inputs.position)) return false;
  return is_active(limit_ahead(), inputs);
}

int Homing::pressing() const {
  if (phase_ != Phase::run || leg().until != Until::stalled) return 0;
  return travel() == Direction::positive ? 1 : -1;
}

Direction Homing::travel() const { return config_.reversed ? opposite(leg().direction) : leg().direction; }

Signal Homing::limit_ahead() const {
  if (latched_ && end_ != latch_) return end_ > latch_ ? Signal::positive_limit : Signal::negative_limit;
  return travel() == Direction::negative ? Signal::negative_limit : Signal::positive_limit;
}

bool Homing::meets(const SignalEdge& edge) const {
  switch (leg().until) {
    case Until::home_rising: return edge.signal == Signal::home && edge.rising;
    case Until::home_falling: return edge.signal == Signal::home && !edge.rising;
    case Until::limit_released:
      return edge.signal == (travel() == Direction::positive ? Signal::negative_limit : Signal::positive_limit) &&
             !edge.rising;
    case Until::index: return edge.signal == Signal::index && edge.rising;
    case Until::limit_reached:
    case Until::stalled:
    case Until::retracted: return false;  // not an edge
  }
  return false;
}

// An axis that lags behind its demand still runs on a little when the leg in the other direction begins. Edges beyond
// the turning point do not belong to this leg.
bool Homing::lies_ahead(Counts position) const {
  return travel() == Direction::positive ? position >= leg_start_ : position <= leg_start_;
}

Counts Homing::distance_from_switch(const SignalEdge& edge) const {
  const Counts distance = edge.position - switch_edge_;
  return distance < 0 ? -distance : distance;
}

bool Homing::is_blind_to(const SignalEdge& edge) const {
  return edge.signal == Signal::index && switch_seen_ && distance_from_switch(edge) < config_.blind_window;
}

Counts Homing::boundary(const SignalEdge& edge) const {
  if (travel() == Direction::positive) return edge.position;
  return edge.signal == Signal::index ? edge.position + 1 - config_.index_width : edge.position + 1;
}

// The torque alone does not show a hard stop: a hanging load or an acceleration may need as much, and the axis first
// rebounds from the stop. At the stop, the shaft stands while its demand goes on.
bool Homing::stalls(const HomingInputs& inputs) {
  const int direction = pressing();
  const float along = static_cast<float>(direction) * inputs.torque;
  const bool presses = along >= config_.stall_torque && inputs.ahead == direction && !inputs.moves;
  if (stall_count_ == 0 || std::abs(inputs.position - stall_position_) > config_.stall_window) {
    stall_count_ = 0;
    stall_position_ = inputs.position;
  }
  stall_count_ = presses ? stall_count_ + 1 : 0;
  return stall_count_ >= config_.stall_cycles;
}

// A hanging load may be stronger than the limited torque, and the axis would meet its other hard stop. A rebound from
// the stop ahead is different: it is slower than `rebound_share` times the speed of the leg, and does not reach the
// beginning of the leg.
bool Homing::is_driven_back(const HomingInputs& inputs) const {
  const double direction = sign(travel());
  const double fastest = leg().speed == HomingSpeed::fast ? config_.fast : config_.slow;
  const auto way = static_cast<double>(inputs.position - leg_start_);
  return way * direction < -static_cast<double>(config_.slack) ||
         inputs.velocity * direction < -rebound_share * fastest;
}

HomingCommand Homing::begin_leg(const HomingInputs& inputs) {
  if (method_.leg_count == 0) return take_latch(inputs.position);
  phase_ = Phase::run;
  stall_count_ = 0;
  leg_start_ = inputs.position;
  if (is_active(limit_ahead(), inputs)) return meet_limit();
  const double velocity = leg().speed == HomingSpeed::fast ? config_.fast : config_.slow;
  if (leg().until == Until::retracted) {
    if (config_.retraction == 0) return take_latch(inputs.position);
    const Counts distance = travel() == Direction::positive ? config_.retraction : -config_.retraction;
    return {.kind = Kind::position, .velocity = velocity, .position = inputs.position + distance};
  }
  return {.kind = Kind::velocity, .velocity = sign(travel()) * velocity};
}

HomingCommand Homing::run_leg(const HomingInputs& inputs) {
  bool next_leg = false;
  for (const SignalEdge& edge : inputs.edges) {
    if (edge.signal == limit_ahead() && edge.rising) return meet_limit();
    if (!meets(edge) || !lies_ahead(edge.position) || is_blind_to(edge)) continue;
    if (edge.signal == Signal::index) {
      if (switch_seen_) index_distance_ = distance_from_switch(edge);
    } else {
      switch_edge_ = edge.position;
      switch_seen_ = true;
    }
    if (leg().then == Then::latch) return take_latch(boundary(edge));
    if (leg().then == Then::stop) return stop_before(leg().next);
    leg_ = leg().next;  // further edges of this cycle belong to the next leg
    next_leg = true;
  }
  if (next_leg) return begin_leg(inputs);
  if (is_active(limit_ahead(), inputs)) return meet_limit();
  if (pressing() != 0 && is_driven_back(inputs)) return fail(HomingError::driven_back);
  if (leg().until == Until::stalled && stalls(inputs)) {
    stop_before(leg().next);
    return {.kind = Kind::hold, .position = inputs.position};
  }
  if (leg().until == Until::retracted && inputs.standing) return take_latch(inputs.position);
  return {};
}

HomingCommand Homing::meet_limit() {
  const std::uint8_t next = leg().until == Until::limit_reached ? leg().next : leg().on_limit;
  if (next == no_leg) return fail(limit_seen_ ? HomingError::home_not_found : HomingError::wrong_limit);
  limit_seen_ = true;
  return stop_before(next);
}

HomingCommand Homing::stop_before(std::uint8_t leg) {
  leg_ = leg;
  phase_ = Phase::wait;
  return {.kind = Kind::stop};
}

HomingCommand Homing::take_latch(Counts position) {
  latched_ = true;
  latch_ = end_ = position;
  phase_ = Phase::settle;
  return {.kind = Kind::stop};
}

HomingCommand Homing::fail(HomingError error) {
  error_ = error;
  phase_ = Phase::idle;
  return {.kind = Kind::stop};
}

}  // namespace servodrome::drive
