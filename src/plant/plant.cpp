#include "plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

constexpr double most_off_middle = 0x1.ffffffffffffep-2;  // plus 0.5: the greatest value below 1
constexpr double close_share = 1.0e-10;  // share of the speed within which windings in pieces and shaft must agree

// Nearest integer to a value within +-2^51. Without SSE 4.1, std::nearbyint is a call, and a conversion to an integer
// and back takes three times as long, on the critical path of the tick.
double nearest_integer(double value) {
  constexpr double no_fraction = 0x1.8p52;  // adding it rounds to an integer
  return (value + no_fraction) - no_fraction;
}

const Parameters& valid(const Parameters& parameters) {
  const auto messages = validate(parameters);
  if (!messages.empty()) throw std::invalid_argument(messages.front());
  return parameters;
}

}  // namespace

// Called in every tick; defined here so that step() can inline it.
[[gnu::always_inline]] inline void Plant::update_angle(double phase) {
  const drive::SinCos angle = drive::sin_cos(static_cast<drive::Phase>(static_cast<std::int64_t>(phase)));
  sine_ = static_cast<double>(angle.sine);
  cosine_ = static_cast<double>(angle.cosine);
}

[[gnu::always_inline]] inline void Plant::fill_without_current(drive::Feedback& feedback) const {
  feedback.position_counts = position_;
  feedback.single_turn_counts = static_cast<std::uint32_t>(single_turn_);
  feedback.phase_current_a = {};
  feedback.dc_link_v = static_cast<float>(dc_link_.volts());
  feedback.inputs = travel_.inputs();
  feedback.index_level = travel_.index();
  feedback.encoder_faults = encoder_faults_;
  feedback.hardware_faults = hardware_faults_;
  feedback.supply_present = !injected(Injection::supply_loss);
  feedback.winding_temperature_c = winding_reading_c_;
  feedback.power_stage_temperature_c = stage_reading_c_;
  feedback.encoder_temperature_c = encoder_reading_c_;
  feedback.ambient_temperature_c = ambient_reading_c_;
}

[[gnu::always_inline]] inline void Plant::fill(drive::Feedback& feedback) const {
  fill_without_current(feedback);
  const auto direct = windings_.direct_a;
  const auto quadrature = windings_.quadrature_a;
  const double alpha = direct * cosine_ - quadrature * sine_;
  const double beta = direct * sine_ + quadrature * cosine_;
  const double across = 0.86602540378443865 * beta;
  feedback.phase_current_a[0] = static_cast<float>(alpha);
  feedback.phase_current_a[1] = static_cast<float>(across - 0.5 * alpha);
  feedback.phase_current_a[2] = static_cast<float>(-0.5 * alpha - across);
  if ((unusual_ & seen_otherwise) != 0) [[unlikely]]
    fill_unusual({alpha, beta}, feedback);
  if (alpha * alpha + beta * beta > overcurrent_squared_) [[unlikely]] {
    feedback.hardware_faults |= overcurrent_bits(feedback);
  }
}

Plant::Plant(const Parameters& parameters)
    : windings_(valid(parameters).motor, parameters.encoder.direction),
      angle_per_speed_(h * windings_.pole_pairs()),
      counts_per_speed_(h * parameters.encoder.counts_per_revolution / two_pi),
      phase_per_count_(phases_in_turn * windings_.pole_pairs() / parameters.encoder.counts_per_revolution),
      phase_per_speed_(counts_per_speed_ * phase_per_count_),
      middle_phase_(phases_in_turn * parameters.encoder.commutation_offset_turns + 0.5 * phase_per_count_),
      overcurrent_squared_(parameters.supply.overcurrent_a * parameters.supply.overcurrent_a),
      bus_overcurrent_a_(parameters.supply.bus_overcurrent_a),
      stage_factor_(windings_.phase_factor() * parameters.thermal.stage_resistance_ohm),
      stage_standby_w_(parameters.thermal.stage_standby_w),
      unusual_(parameters.motor.phases == 2 ? two_phases : 0),
      imperfect_(!parameters.stage.ideal || !parameters.sensors.ideal),
      counts_per_revolution_(parameters.encoder.counts_per_revolution),
      travel_(parameters.encoder, parameters.switches, parameters.switch_count),
      dc_link_(parameters.supply),
      shaft_(parameters.motor, parameters.load),
      heat_(parameters.thermal),
      stage_(parameters.stage, parameters.motor.phases, parameters.supply.overcurrent_a),
      measurement_(parameters.sensors, parameters.encoder.counts_per_revolution, parameters.supply.overcurrent_a),
      parameters_(parameters) {
  travel_.set_stops(parameters.load.low_stop_counts, parameters.load.high_stop_counts);
  place(parameters.encoder.start_position_counts);
  apply_load();
  update_brake();
  update_resistance();
  update_flux();
  update_readings();
}

void Plant::place(std::int64_t position_counts) {
  position_ = position_counts;
  off_middle_ = -0.5;
  travel_.place(position_);
  measurement_.place({position_, fraction()});
  wrap_single_turn();
  update_angle(electrical_phase());
}

void Plant::step_imperfect(const drive::Actuation& actuation, drive::Feedback& feedback) {
  if (stage_.ideal()) {
    step_machine(actuation, feedback);
  } else if (!PowerStage::modulates(actuation)) {
    stage_.pause();
    step_machine(actuation, feedback);
  } else {
    step_machine(stage_.apply(actuation, current_a_, dc_link_.volts()), feedback);
    switch_j_ += stage_.loss_w() * h;
  }
  for (std::size_t phase = 0; phase < 3; ++phase)
    current_a_[phase] = static_cast<double>(feedback.phase_current_a[phase]);
  if (!measurement_.ideal()) measurement_.measure({position_, fraction()}, (unusual_ & encoder_frozen) != 0, feedback);
}

void Plant::step_machine(const drive::Actuation& actuation, drive::Feedback& feedback) {
  feedback.edge_count = 0;
  if (pending_edge_count_ != 0) [[unlikely]] {
    feedback.edges = pending_edges_;
    feedback.edge_count = pending_edge_count_;
    pending_edge_count_ = 0;
  }
  if (actuation.brake_released != brake_command_released_ || brake_countdown_ != 0) [[unlikely]] {
    operate_brake(actuation.brake_released);
  }
  const bool idle = !actuation.pwm_enabled && !actuation.short_circuit;
  if (rests_ && idle) return rest(actuation, feedback);
  // If a tick without power begins and ends at rest, every further tick has the same result.
  const bool rested = idle && at_rest();

  const double rotor_torque = uneven_ ? adapt() : 0.0;
  const double other_torque = rotor_torque + shaft_.load_torque_nm();
  const ShaftResponse response = shaft_.response(other_torque);

  const Turn turn = foresee(response.offset_rad_s + response.slope * torque_nm_);
  const double phase = electrical_phase();

  const double link_v = dc_link_.volts();
  const double u = static_cast<double>(actuation.phase_voltage_v[0]);
  const double v = static_cast<double>(actuation.phase_voltage_v[1]);
  const double w = static_cast<double>(actuation.phase_voltage_v[2]);
  const double sum = u + (v + w);
  double range = std::max(u, std::max(v, w)) - std::min(u, std::min(v, w));
  double alpha = u - sum * (1.0 / 3.0);
  double beta = (v - w) * 0.57735026918962576;
  const bool star = (unusual_ & two_phases) == 0;
  if (!star) [[unlikely]] {  // two windings, each with a full bridge
    range = std::max(std::abs(u), std::abs(v));
    alpha = u;
    beta = v;
  }
  bridges_run_ = actuation.pwm_enabled && !actuation.short_circuit;
  const bool usual = bridges_run_ && (unusual_ & ~(encoder_frozen | two_phases)) == 0 && range <= link_v &&
                     sum - sum == 0.0 && windings_.turns_little(turn);  // finite
  const double direct_v = alpha * cosine_ + beta * sine_;
  const double quadrature_v = beta * cosine_ - alpha * sine_;
  const auto excitation = [&] {
    if (usual) return Excitation{.volts = {alpha, beta}};
    return unusual_excitation(actuation);
  };

  // The usual tick takes two steps, each with an exceptional case: first currents, then motion.
  WindingTick windings;
  ShaftTick shaft;
  if (shaft_.elastic()) {
    const Motion both = solve_general(excitation(), rotor_torque, torque_nm_);
    windings = both.windings;
    shaft = both.shaft;
    stop_j_ += shaft.stop_j;
  } else {
    // Two windings use driven() at rest too: recorded motions contain its rounding.
    windings = star && shaft_.held() ? windings_.driven_at_rest(direct_v, quadrature_v)
                                     : windings_.driven(direct_v, quadrature_v, turn, response);
    if (!usual || astray(windings)) [[unlikely]]
      windings = solve_windings(excitation(), response);
    if (!shaft_.slide(response, windings.torque_nm, other_torque, shaft)) [[unlikely]] {
      const Motion both = solve_turning(excitation(), other_torque, {windings, shaft});
      windings = both.windings;
      shaft = both.shaft;
    }
  }
  double moved = off_middle_ + shaft.mean * counts_per_speed_;
  double whole = nearest_integer(moved);
  std::int64_t position = position_ + static_cast<std::int64_t>(whole);
  if (!travel_.quiet(position)) [[unlikely]] {
    if (!shaft_.elastic() && (travel_.beyond_stop(position) || travel_.beyond_stop(position_))) {
      const Motion both = solve_general(excitation(), rotor_torque, windings.torque_nm);
      windings = both.windings;
      shaft = both.shaft;
      stop_j_ += shaft.stop_j;
      moved = off_middle_ + shaft.mean * counts_per_speed_;
      whole = nearest_integer(moved);
      position = position_ + static_cast<std::int64_t>(whole);
    }
    travel_.move(position_, position, feedback);
  }
  windings_.commit(windings);
  torque_nm_ = windings.torque_nm;
  shaft_.elastic() ? shaft_.commit_general(shaft) : shaft_.commit(shaft);
  position_ = position;
  const double off_middle = std::min(moved - whole, most_off_middle);  // a tie rounds to the even integer
  if (whole != 0.0 || off_middle != off_middle_) {
    off_middle_ = off_middle;
    update_angle(phase + shaft.mean * phase_per_speed_);
    single_turn_ += whole;
    if (single_turn_ < 0.0 || single_turn_ >= counts_per_revolution_) wrap_single_turn();
  }
  rests_ = rested && at_rest();
  if (books_) [[unlikely]]
    book(shaft);

  const double square_a2 = windings.mean_direct_a * windings.mean_direct_a +
                           windings.mean_quadrature_a * windings.mean_quadrature_a + windings.more_heat_a2;
  current_squared_sum_ += square_a2;
  const double stage_w = square_a2 * stage_factor_ + (actuation.pwm_enabled ? stage_standby_w_ : 0.0) + stage_.loss_w();
  dc_link_.step(windings.power_w, stage_w, actuation.chopper_on && !injected(Injection::chopper_broken),
                actuation.dc_link_connected && !injected(Injection::supply_loss));
  motor_power_sum_w_ += windings.power_w;
  shaft_power_sum_w_ += windings.torque_nm * shaft.mean;
  if (--heat_countdown_ == 0) [[unlikely]]
    update_heat(actuation.pwm_enabled);

  fill(feedback);
  if (std::abs(windings.power_w) > bus_overcurrent_a_ * link_v) [[unlikely]] {
    if (link_v > 0.0) feedback.hardware_faults |= bit(drive::HardwareFault::bus_overcurrent);
  }
}

bool Plant::at_rest() const {
  return shaft_.at_rest() && windings_.direct_a == 0.0 && windings_.quadrature_a == 0.0 && torque_nm_ == 0.0;
}

// The rest of a tick in which nothing moves.
void Plant::rest(const drive::Actuation& actuation, drive::Feedback& feedback) {
  dc_link_.step(0.0, 0.0, actuation.chopper_on && !injected(Injection::chopper_broken),
                actuation.dc_link_connected && !injected(Injection::supply_loss));
  if (--heat_countdown_ == 0) [[unlikely]]
    update_heat(false);
  fill_without_current(feedback);
  if ((unusual_ & seen_otherwise) != 0) [[unlikely]]
    fill_unusual({}, feedback);
}

void Plant::sample(drive::Feedback& feedback) const {
  feedback.edge_count = 0;
  fill(feedback);
}

void Plant::fill_unusual(Stationary current, drive::Feedback& feedback) const {
  if ((unusual_ & encoder_frozen) != 0) {
    feedback.position_counts = frozen_position_;
    const std::int64_t remainder = frozen_position_ % counts_per_revolution_;
    feedback.single_turn_counts =
        static_cast<std::uint32_t>(remainder < 0 ? remainder + counts_per_revolution_ : remainder);
  }
  if ((unusual_ & two_phases) != 0) {
    feedback.phase_current_a = {static_cast<float>(current.alpha), static_cast<float>(current.beta), 0.0F};
    // In every PWM period the upper switch of a shorted output closes on the negative rail. The current loop alone
    // would not detect it: the other end of the winding can keep the voltage across it at zero.
    const unsigned shorted = bridges_run_ ? unusual_ >> short_shift & 3u : 0u;
    feedback.hardware_faults |= shorted * bit(drive::HardwareFault::overcurrent_u);
  }
  for (unsigned phase = 0; phase < 3; ++phase) {
    if ((unusual_ >> (open_shift + phase) & 1u) != 0) feedback.phase_current_a[phase] = 0.0F;
  }
}

std::uint32_t Plant::overcurrent_bits(const drive::Feedback& feedback) const {
  std::uint32_t bits = 0;
  for (unsigned phase = 0; phase < 3; ++phase) {
    const double current = static_cast<double>(feedback.phase_current_a[phase]);
    if (current * current > overcurrent_squared_) bits |= bit(drive::HardwareFault::overcurrent_u) << phase;
  }
  return bits;
}

WindingTick Plant::solve_driven(Stationary volts, const Turn& turn, const ShaftResponse& shaft) const {
  const double direct_v = volts.alpha * cosine_ + volts.beta * sine_;
  const double quadrature_v = volts.beta * cosine_ - volts.alpha * sine_;
  if (windings_.turns_little(turn)) [[likely]] {
    return windings_.driven(direct_v, quadrature_v, turn, shaft);
  }
  return windings_.driven_in_pieces(direct_v, quadrature_v, turn);
}

WindingTick Plant::solve_turn(const Excitation& excitation, const Turn& turn, const ShaftResponse& shaft,
                              const Guess& guess) const {
  const Stationary volts = excitation.volts;
  if (excitation.bridge == Bridge::driven) return solve_driven(volts, turn, shaft);
  if (excitation.bridge == Bridge::freewheeling) {
    return windings_.freewheeling(dc_link_.volts(), sine_, cosine_, turn);
  }
  const Stationary axis = excitation.axis;
  if (axis.alpha == 0.0 && axis.beta == 0.0) return {};
  const double along_v = excitation.blocked ? dc_link_.volts() * windings_.bridge_share()
                                            : volts.alpha * axis.alpha + volts.beta * axis.beta;
  const double turn_sine = std::sin(0.5 * turn.angle);
  const double turn_cosine = std::cos(0.5 * turn.angle);
  const double sine = sine_ * turn_cosine + cosine_ * turn_sine;  // at mid-tick
  const double cosine = cosine_ * turn_cosine - sine_ * turn_sine;
  return windings_.along({axis.alpha * cosine + axis.beta * sine, axis.beta * cosine - axis.alpha * sine}, along_v,
                         excitation.blocked, shaft, guess);
}

WindingTick Plant::solve_windings(const Excitation& excitation, const ShaftResponse& shaft) const {
  const Turn turn = foresee(shaft.offset_rad_s + shaft.slope * torque_nm_);
  if (excitation.bridge == Bridge::driven && windings_.turns_little(turn)) [[likely]] {
    const WindingTick tick = solve_driven(excitation.volts, turn, shaft);
    if (!astray(tick)) return tick;
  }
  return solve_further(excitation, shaft);
}

// Solves speed and torque of the tick, first with Newton's method, then with the secant method.
WindingTick Plant::solve_further(const Excitation& excitation, const ShaftResponse& shaft) const {
  const bool driven = excitation.bridge == Bridge::driven;
  double torque = torque_nm_;
  double last_torque = 0.0;
  double last_missed = 0.0;
  double falls = driven ? windings_.per_speed_nm() * shaft.slope : 0.0;  // Nm per Nm, by the effect of torque on speed
  for (int pass = 0; pass < 12; ++pass) {
    const Turn turn = foresee(shaft.offset_rad_s + shaft.slope * torque);
    const WindingTick tick = solve_turn(excitation, turn, shaft, {torque, windings_.direct_a});
    if (driven && windings_.turns_little(turn)) {
      if (!astray(tick)) return tick;
      torque = tick.torque_nm;
      continue;
    }
    const double missed = tick.torque_nm - torque;
    if (std::abs(shaft.slope * missed) <= close_share * std::abs(turn.speed)) return tick;
    if (pass > 0 && torque != last_torque) falls = -(missed - last_missed) / (torque - last_torque) - 1.0;
    last_torque = torque;
    last_missed = missed;
    torque += missed / (1.0 + falls);
  }
  return solve_bracketed(excitation, [&](double trial) { return shaft.offset_rad_s + shaft.slope * trial; });
}

// Finds by bisection the torque at which windings and shaft agree, if the faster methods fail. A solution exists
// because torque - torque(speed(torque)) changes sign, since the windings' torque is bounded. If the speed jumps at
// that torque (a contact closes or not), windings and shaft cannot agree. The result is then the shaft's torque on that
// side of the jump on which energy is lost.
template <typename MeanSpeed>
WindingTick Plant::solve_bracketed(const Excitation& excitation, MeanSpeed mean_speed) const {
  WindingTick tick;
  double speed = 0.0;
  const auto excess = [&](double torque) {
    speed = mean_speed(torque);
    tick = solve_turn(excitation, foresee(speed), {speed, 0.0}, {torque, windings_.direct_a});
    return torque - tick.torque_nm;
  };
  double reach = std::abs(excess(torque_nm_)) + 1.0e-6;
  double low = torque_nm_ - reach;
  double high = torque_nm_ + reach;
  for (int i = 0; i < 200 && excess(low) > 0.0; ++i) low -= reach *= 2.0;
  for (int i = 0; i < 200 && excess(high) < 0.0; ++i) high += reach *= 2.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0.0 ? high : low) = middle;
  }
  double torque = low;
  if (excess(low) * speed > 0.0) excess(torque = high);
  tick.torque_nm = torque;
  return tick;
}

// Solves windings and shaft together if the shaft has several states: linearises the shaft at the known torque, solves
// the currents with it, and repeats if contact or friction has changed.
template <typename SolveShaft>
Plant::Motion Plant::settle(const Excitation& excitation, double torque, ShaftTick tick, SolveShaft solve_shaft) const {
  WindingTick windings;
  for (int pass = 0; pass < 6; ++pass) {
    const ShaftResponse response{tick.mean - tick.slope * torque, tick.slope};
    windings = solve_windings(excitation, response);
    torque = windings.torque_nm;
    const double expected = response.offset_rad_s + response.slope * torque;
    tick = solve_shaft(torque, false);
    if (std::abs(tick.mean - expected) <= 1.0e-9 * (1.0 + std::abs(expected))) return {windings, tick};
  }
  windings = solve_bracketed(excitation, [&](double trial) { return solve_shaft(trial, true).mean; });
  return {windings, solve_shaft(windings.torque_nm, true)};
}

Plant::Motion Plant::solve_turning(const Excitation& excitation, double other_torque_nm, const Motion& first) const {
  return settle(excitation, first.windings.torque_nm, first.shaft,
                [&](double torque, bool) { return shaft_.slide_freely(torque + other_torque_nm); });
}

Plant::Motion Plant::solve_general(const Excitation& excitation, double rotor_torque_nm, double torque_nm) const {
  const StopDistance stops = stop_distance();
  const auto solve_shaft = [&](double torque, bool freely) {
    return shaft_.solve(torque, rotor_torque_nm, stops, freely);
  };
  return settle(excitation, torque_nm, solve_shaft(torque_nm, false), solve_shaft);
}

// Voltage of the bridges across the windings, limited by the DC link and by shorted outputs; for a star relative to its
// star point.
Plant::Stationary Plant::inverter_voltage(const drive::Actuation& actuation) const {
  const double link_v = dc_link_.volts();
  std::array<double, 3> volts{};
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const double wanted = static_cast<double>(actuation.phase_voltage_v[phase]);
    volts[phase] = std::isfinite(wanted) ? wanted : 0.0;
  }
  const auto shorted = [this](std::size_t phase) { return (unusual_ >> (short_shift + phase) & 1u) != 0; };
  if ((unusual_ & two_phases) != 0) {
    // Both ends of a winding are symmetric about the middle of the DC link. If one is on the negative rail, the other
    // still has its half of the voltage.
    for (std::size_t winding = 0; winding < 2; ++winding) {
      volts[winding] = std::clamp(volts[winding], -link_v, link_v);
      if (shorted(winding)) volts[winding] = 0.5 * (volts[winding] - link_v);
    }
    return {volts[0], volts[1]};
  }
  const auto [least, most] = std::minmax({volts[0], volts[1], volts[2]});
  const double scale = most - least > link_v ? link_v / (most - least) : 1.0;  // the hexagon
  const double middle = 0.5 * (most + least);
  for (std::size_t phase = 0; phase < 3; ++phase) {
    volts[phase] = scale * (volts[phase] - middle);  // the terminals, relative to the middle of the DC link
    if (shorted(phase)) volts[phase] = -0.5 * link_v;
  }
  return {(2.0 * volts[0] - volts[1] - volts[2]) * (1.0 / 3.0), (volts[1] - volts[2]) * 0.57735026918962576};
}

Plant::Excitation Plant::unusual_excitation(const drive::Actuation& actuation) const {
  const bool freewheeling = !actuation.pwm_enabled && !actuation.short_circuit;
  Excitation excitation;
  if (actuation.pwm_enabled && !actuation.short_circuit) excitation.volts = inverter_voltage(actuation);
  excitation.blocked = freewheeling;
  excitation.bridge = freewheeling ? Bridge::freewheeling : Bridge::driven;

  const unsigned open = (unusual_ & open_bits) >> open_shift;
  if (open == 0) return excitation;
  excitation.bridge = Bridge::open_phase;
  if ((open & (open - 1u)) != 0) return excitation;  // two wires are cut: no closed path for a current
  // The current flows at right angles to the axis of the open phase.
  excitation.axis = {.alpha = 0.0, .beta = 1.0};
  if (open != 1u) {
    excitation.axis = (unusual_ & two_phases) != 0
                          ? Stationary{.alpha = 1.0, .beta = 0.0}
                          : Stationary{.alpha = 0.86602540378443865, .beta = open == 2u ? 0.5 : -0.5};
  }
  return excitation;
}

StopDistance Plant::stop_distance() const {
  const Load& load = parameters_.load;
  const double counts_per_rad = counts_per_revolution_ / two_pi;
  const double twist_counts = shaft_.twist_rad() * counts_per_rad;
  constexpr double far = -1.0e12;
  StopDistance distance{far, far};
  if (load.low_stop_counts != no_low_limit) {
    distance.low = (static_cast<double>(load.low_stop_counts - position_) - fraction() + twist_counts) / counts_per_rad;
  }
  if (load.high_stop_counts != no_high_limit) {
    distance.high =
        (static_cast<double>(position_ - load.high_stop_counts) + fraction() - twist_counts) / counts_per_rad;
  }
  return distance;
}

void Plant::wrap_single_turn() {
  const std::int64_t remainder = position_ % counts_per_revolution_;
  single_turn_ = static_cast<double>(remainder < 0 ? remainder + counts_per_revolution_ : remainder);
}

}  // namespace servodrome::plant
