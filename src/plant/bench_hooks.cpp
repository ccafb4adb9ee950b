// The bench hooks and the true state of Plant: functions that step() does not call.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include "plant/plant.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

constexpr std::uint32_t bit(Injection injection) { return 1u << static_cast<unsigned>(injection); }
constexpr std::uint32_t bit(drive::EncoderFault fault) { return static_cast<std::uint32_t>(fault); }

static_assert([] {
  for (std::size_t i = 0; i < injection_names.size(); ++i) {
    if (static_cast<std::size_t>(injection_names[i].injection) != i) return false;
  }
  return injection_names.size() <= 32;
}());

constexpr std::array encoder_bits{
    std::pair{Injection::encoder_loss, drive::EncoderFault::connection_lost},
    std::pair{Injection::encoder_crc, drive::EncoderFault::crc},
    std::pair{Injection::encoder_delimiter, drive::EncoderFault::delimiter},
    std::pair{Injection::encoder_multi_turn, drive::EncoderFault::multi_turn},
    std::pair{Injection::encoder_count, drive::EncoderFault::count},
    std::pair{Injection::encoder_overflow, drive::EncoderFault::count_overflow},
    std::pair{Injection::hall_wiring, drive::EncoderFault::hall_wiring},
    std::pair{Injection::hall_state, drive::EncoderFault::hall_state},
};
constexpr std::array hardware_bits{
    std::pair{Injection::bus_overcurrent, drive::HardwareFault::bus_overcurrent},
    std::pair{Injection::short_circuit, drive::HardwareFault::short_circuit},
    std::pair{Injection::gate_supply_low, drive::HardwareFault::gate_supply_low},
    std::pair{Injection::internal, drive::HardwareFault::internal},
};
constexpr std::uint32_t freezes_encoder =
    bit(Injection::encoder_loss) | bit(Injection::encoder_crc) | bit(Injection::encoder_delimiter);

constexpr double rpm_per_rad_s = 30.0 / std::numbers::pi;

const Parameters& accepted(const Parameters& parameters) {
  const auto messages = validate(parameters);
  if (!messages.empty()) throw std::invalid_argument(messages.front());
  return parameters;
}

void accept_wire(int wire) {
  if (wire < 0 || wire > 31)
    throw std::invalid_argument("input wire: " + std::to_string(wire) + " is not within 0 .. 31");
}

}  // namespace

void Plant::apply_load() {
  shaft_.set_load(parameters_.load);
  const Motor& motor = parameters_.motor;
  uneven_ = motor.cogging_torque_nm > 0.0 || motor.cogging_count > 0 || shaft_.varies();
  books_ =
      motor.iron_hysteresis_nm > 0.0 || motor.iron_eddy_nms > 0.0 || motor.brake_torque_nm > 0.0 || shaft_.varies();
  if (shaft_.varies()) shaft_.place(load_revolutions());
  rests_ = false;
}

void Plant::set_external_torque_nm(double torque_nm) {
  Parameters changed = parameters_;
  changed.load.external_torque_nm = torque_nm;
  parameters_ = accepted(changed);
  apply_load();
}

void Plant::set_load_inertia_kgm2(double inertia_kgm2) {
  Parameters changed = parameters_;
  changed.load.inertia_kgm2 = inertia_kgm2;
  parameters_ = accepted(changed);
  apply_load();
}

void Plant::set_coulomb_friction_nm(double torque_nm) {
  Parameters changed = parameters_;
  changed.load.static_friction_nm += torque_nm - changed.load.coulomb_friction_nm;
  changed.load.coulomb_friction_nm = torque_nm;
  // Rounding may have made the sum lose the last bit of the difference.
  changed.load.static_friction_nm = std::max(changed.load.static_friction_nm, torque_nm);
  parameters_ = accepted(changed);
  apply_load();
}

void Plant::set_supply_v(double volts) {
  Parameters changed = parameters_;
  changed.supply.volts = volts;
  parameters_ = accepted(changed);
  dc_link_.set_supply_v(volts);
}

void Plant::set_ambient_c(double temperature_c) {
  Parameters changed = parameters_;
  changed.thermal.ambient_c = temperature_c;
  parameters_ = accepted(changed);
  heat_.set_ambient_c(temperature_c);
  update_readings();
}

void Plant::set_position_counts(std::int64_t position_counts) {
  Parameters changed = parameters_;
  changed.encoder.start_position_counts = position_counts;
  accepted(changed);  // checks the range and the hard stops
  shaft_.stop();
  place(position_counts);
  apply_load();
  rests_ = false;
}

void Plant::lock_rotor(bool locked) {
  locked_ = locked;
  shaft_.set_locked(locked);
  rests_ = false;
}

void Plant::queue_edge(int wire) {
  if (pending_edge_count_ >= pending_edges_.size()) return;
  pending_edges_[pending_edge_count_++] = {static_cast<std::uint8_t>(wire), travel_.level(wire), position_};
}

void Plant::force_input(int wire, bool level) {
  accept_wire(wire);
  if (travel_.force(wire, level)) queue_edge(wire);
}

void Plant::release_input(int wire) {
  accept_wire(wire);
  if (travel_.release(wire)) queue_edge(wire);
}

void Plant::inject(Injection injection, bool on) {
  rests_ = false;
  injections_ = on ? injections_ | bit(injection) : injections_ & ~bit(injection);
  encoder_faults_ = 0;
  for (const auto& [cause, fault] : encoder_bits) {
    if (injected(cause)) encoder_faults_ |= bit(fault);
  }
  hardware_faults_ = 0;
  for (const auto& [cause, fault] : hardware_bits) {
    if (injected(cause)) hardware_faults_ |= bit(fault);
  }
  const bool frozen = (injections_ & freezes_encoder) != 0;
  if (frozen && (unusual_ & encoder_frozen) == 0) frozen_position_ = position_;
  unusual_ = static_cast<std::uint8_t>((unusual_ & two_phases) | (frozen ? encoder_frozen : 0u));
  const unsigned phases = (unusual_ & two_phases) != 0 ? 2 : 3;  // a motor with two windings has no wire W
  for (unsigned phase = 0; phase < phases; ++phase) {
    const auto open = static_cast<unsigned>(Injection::open_phase_u) + phase;
    const auto shorted = static_cast<unsigned>(Injection::short_phase_u) + phase;
    unusual_ |= static_cast<std::uint8_t>((injections_ >> open & 1u) << (open_shift + phase));
    unusual_ |= static_cast<std::uint8_t>((injections_ >> shorted & 1u) << (short_shift + phase));
  }
  // lets the brake evaluate its command again
  if (injection == Injection::brake_stuck && brake_countdown_ == 0) brake_countdown_ = 1;
  update_readings();
}

void Plant::discharge_dc_link() { dc_link_.discharge(); }

const Parameters& Plant::parameters() const { return parameters_; }
std::int64_t Plant::position_counts() const { return position_; }
double Plant::position_fraction() const { return fraction(); }
double Plant::velocity_rpm() const { return shaft_.speed_rad_s() * rpm_per_rad_s; }
double Plant::load_velocity_rpm() const { return shaft_.load_speed_rad_s() * rpm_per_rad_s; }
double Plant::coupling_twist_rad() const { return shaft_.twist_rad(); }
double Plant::load_position_counts() const {
  return static_cast<double>(position_) + fraction() -
         shaft_.twist_rad() * counts_per_revolution_ / (2.0 * std::numbers::pi);
}
double Plant::load_angle_rad(std::int64_t from_counts) const {
  const double counts = static_cast<double>(position_ - from_counts) + fraction();
  return counts * (2.0 * std::numbers::pi / counts_per_revolution_) - shaft_.twist_rad();
}
double Plant::torque_nm() const { return torque_nm_; }
// If the encoder counts in the other direction, a positive q current gives a torque towards smaller counts.
double Plant::current_a() const { return windings_.quadrature_a * parameters_.encoder.direction; }
double Plant::direct_current_a() const { return windings_.direct_a; }
double Plant::electrical_angle_turns() const {
  const double turns = electrical_phase() / phases_in_turn;
  return turns - std::floor(turns);
}
double Plant::dc_link_v() const { return dc_link_.volts(); }
double Plant::winding_temperature_c() const { return heat_.winding_c; }
double Plant::case_temperature_c() const { return heat_.case_c; }
double Plant::power_stage_temperature_c() const { return heat_.stage_c; }
bool Plant::brake_engaged() const { return parameters_.motor.brake_torque_nm > 0.0 && brake_engaged_; }
bool Plant::rotor_locked() const { return locked_; }

Energy Plant::energy() const {
  return {.supplied_j = dc_link_.supplied_j(),
          .chopped_j = dc_link_.chopped_j(),
          .standby_j = dc_link_.standby_j(),
          .stage_j = dc_link_.stage_j(),
          .to_motor_j = drive::tick_seconds * motor_power_sum_w_,
          .copper_j = copper_j_ + windings_.phase_factor() * drive::tick_seconds * windings_.resistance_ohm() *
                                      current_squared_sum_,
          .iron_j = iron_j_ + iron_since_j_,
          .brake_j = brake_j_,
          .shaft_j = drive::tick_seconds * shaft_power_sum_w_,
          .link_stored_j = dc_link_.stored_j(),
          .magnetic_j = windings_.magnetic_j(),
          .kinetic_j = shaft_.kinetic_j(),
          .elastic_j = shaft_.elastic_j(stop_distance()),
          .weight_j = shaft_.weight_j(load_revolutions()),
          .cogging_j = cogging_j(),
          .stop_j = stop_j_};
}

}  // namespace servodrome::plant
