#include "products/jmc_ec/jmc_ec.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace servodrome::products {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

// Terminals in the order of the connector (ch. 3.1.2): CW-, HW+, CCW+, DI3, DI4.
constexpr std::array terminals{drive::Signal::positive_limit, drive::Signal::home, drive::Signal::negative_limit,
                               drive::Signal::probe_1, drive::Signal::probe_2};

// Not printed: voltage thresholds as fractions of the nominal supply.
constexpr float over_voltage_share = 1.35F;
constexpr float under_voltage_share = 0.65F;
constexpr float under_voltage_near_share = 0.75F;
constexpr float motor_hot_c = 130.0F;
constexpr float overload_near_percent = 90.0F;
constexpr float following_error_near = 0.8F;  // of 6065h
constexpr std::uint32_t jammed_ms = 500;
constexpr std::uint32_t index_lost_revolutions = 3;
constexpr double speed_reached_rpm = 20.0;
// A jerk-limited ramp (6086h = 3) reaches the default of 60C5h after 100 ms. The manual has no object for the jerk.
constexpr std::uint32_t jerk_per_max_acceleration = 10;

constexpr std::int64_t sync_granularity_ns = 125'000;

std::uint32_t milli(float value) { return static_cast<std::uint32_t>(std::lround(1000.0F * value)); }

}  // namespace

ethercat::SiiDescription JmcEc::sii_description(const Settings& settings) {
  static constexpr std::array dc_modes{
      ethercat::DcMode{.name = "DC", .description = "DC-Synchron", .assign_activate = 0x0300, .sync0_factor = 1},
      ethercat::DcMode{.name = "FreeRun", .description = "FreeRun"},
  };
  const jmc_ec::Rating& rating = jmc_ec::find_rating(settings.model);
  return {.vendor_id = jmc_ec::vendor_id,
          .product_code = rating.product_code,
          .revision_number = jmc_ec::revision_number,
          .serial_number = settings.serial_number,
          .station_alias = settings.ethercat.station_alias,
          .group = "EC",
          .order = rating.device_name,
          .name = rating.device_name,
          .dc_modes = dc_modes};
}

void JmcEc::prepare(dictionary::Area areas) {
  jmc_ec::Objects& own = objects();
  const jmc_ec::Rating& made = rating();
  own.communication.product_code = made.product_code;
  own.communication.serial_number = settings().serial_number;
  const std::string_view name = made.device_name;
  own.own.device_name.length = static_cast<std::uint32_t>(std::min(name.size(), own.own.device_name.bytes.size()));
  std::copy_n(name.begin(), own.own.device_name.length, own.own.device_name.bytes.begin());
  if (contains(areas, dictionary::Area::manufacturer)) prepare_panel();
  if (!contains(areas, dictionary::Area::profile)) return;
  own.drive.motor_rated_current_ma = milli(made.model.motor.rated_current_a / jmc_ec::rating::root2);
  own.drive.motor_rated_torque_mnm = milli(made.model.motor.rated_torque_nm);
  own.drive.positioning_option_code = 0;  // relative to the last target (D-39)
  own.drive.position_window_time_ms = 0;
  own.drive.profile_jerk[0] = jerk_per_max_acceleration * own.drive.max_acceleration;
}

drive::Configuration JmcEc::configuration() const {
  const Model& model = rating().model;
  drive::Configuration configuration;
  drive::Monitors& monitors = configuration.monitors;
  monitors.over_voltage_v = over_voltage_share * model.supply_v;
  monitors.under_voltage_v = under_voltage_share * model.supply_v;
  monitors.under_voltage_near_v = under_voltage_near_share * model.supply_v;
  monitors.chopper_on_v = monitors.chopper_off_v = 1e9F;  // none is printed
  monitors.power_stage_hot_c = 95.0F;                     // ch. 9.2, AL.440
  monitors.motor_hot_c = motor_hot_c;
  monitors.encoder_hot_c = monitors.ambient_hot_c = 0.0F;
  monitors.ambient_cold_c = -1e9F;
  monitors.warning_margin_c = 0.0F;
  monitors.i2t_peak_time_s = 3.0F;  // ch. 2.1
  monitors.stage_rated_current_a = model.stage_rated_current_a;
  monitors.stage_peak_current_a = model.motor.peak_current_a;
  monitors.stage_apart = true;
  monitors.overload_near_percent = overload_near_percent;
  monitors.following_error_near = following_error_near;
  monitors.acceleration_clipped = true;
  monitors.jammed_ms = jammed_ms;
  monitors.index_lost_revolutions = index_lost_revolutions;
  monitors.limit_switch_levels = true;
  monitors.window_of_zero = jmc_ec::window_of_zero;
  configure_panel(configuration);
  for (std::size_t i = 0; i < terminals.size(); ++i) configuration.inputs[i].signal = terminals[i];
  configuration.touch_probe = {
      .probes = 2, .input_rising = true, .input_falling = true, .index_rising = true, .index_falling = true};
  configuration.homing_end = drive::HomingEnd::offset;  // D-25
  configuration.speed_windows.used = true;
  configuration.speed_windows.reached_counts_per_s =
      speed_reached_rpm / 60.0 * configuration.motor.counts_per_revolution;
  configuration.position_change = {.limited = position_change_written_ || !jmc_ec::position_change_needs_writing,
                                   .least = objects().own.min_position_change,
                                   .greatest = objects().own.max_position_change};
  configuration.set_point_period_s = set_point_period_s_;
  return configuration;
}

void JmcEc::power_on(const drive::Feedback& feedback, Time now) {
  position_change_written_ = false;
  set_point_period_s_ = 0.0;
  bus_error_ = ethercat::AlStatusCode::none;
  fault_told_ = false;
  last_frame_ = Time{-1};
  EthercatDevice::power_on(feedback, now);
  set_position_window();
  drive().inject(drive::Cause::motor_mismatch, false);
  drive().inject(jmc_ec::cause::power_cycle_pending, false);
}

void JmcEc::cycle(Time now) {
  follow_bus_error();
  if (esc().frames() != frames_) {
    frames_ = esc().frames();
    last_frame_ = now;
  }
  cycle_panel();
  EthercatDevice::cycle(now);
}

// Sets the window of bit 10 (P03-06), in position units.
void JmcEc::set_position_window() {
  const double units = objects().panel.in_position_window * drive().axis().units.position.inverse().value();
  objects().drive.position_window = static_cast<std::uint32_t>(std::max(1L, std::lround(units)));
}

AbortCode JmcEc::check(const Entry& entry, std::span<const std::byte> value) {
  switch (entry.index) {
    case 0x608F:
    case 0x6091:
    case 0x6092: {
      // "Effective only when set in Pre-Op" ('Electronic gear'). A ratio out of range is accepted, because its parts
      // are written one by one, and is AL.105 until it is valid.
      const ethercat::AlState state = slave().state();
      const bool before = state == ethercat::AlState::init || state == ethercat::AlState::pre_operational;
      return before && !drive().energised() ? AbortCode::none : AbortCode::device_state;
    }
    default: return check_panel(entry, dictionary::decode_number(entry.type, value));
  }
}

void JmcEc::written(const Entry& entry) {
  jmc_ec::Objects& own = objects();
  switch (entry.index) {
    case 0x608F:
    case 0x6091:
    case 0x6092:
      drive().written(entry);
      set_position_window();
      break;
    case 0x6075: {  // AL.060: beyond what the power stage can give (ch. 9.2)
      const float wanted_a = 0.001F * static_cast<float>(own.drive.motor_rated_current_ma) * jmc_ec::rating::root2;
      drive().inject(drive::Cause::motor_mismatch, wanted_a > rating().model.stage_rated_current_a);
      break;
    }
    case 0x607B: {
      const auto& now = drive().configuration().position_change;
      if (now.limited && now.least == own.own.min_position_change && now.greatest == own.own.max_position_change) break;
      position_change_written_ = true;
      reconfigure();
      break;
    }
    case 0x60B2: {
      constexpr std::int32_t low = std::numeric_limits<std::int16_t>::min();
      constexpr std::int32_t high = std::numeric_limits<std::int16_t>::max();
      own.drive.torque_offset = static_cast<std::int16_t>(std::clamp(own.own.torque_offset, low, high));
      break;
    }
    default: panel_written(entry); break;
  }
}

ethercat::AlStatusCode JmcEc::may_change(ethercat::AlState from, ethercat::AlState to) {
  if (from != ethercat::AlState::pre_operational || to != ethercat::AlState::safe_operational) {
    return ethercat::AlStatusCode::none;
  }
  const std::uint32_t cycle_ns = objects().communication.output_sync.sync0_cycle_time_ns;
  return cycle_ns % sync_granularity_ns == 0 ? ethercat::AlStatusCode::none
                                             : ethercat::AlStatusCode::invalid_sync_cycle_time;
}

void JmcEc::state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time) {
  using ethercat::AlState;
  if (from == AlState::operational) {
    // Outputs are no longer valid: 6007h determines the reaction, and the alarm shows the reason. If the master itself
    // takes an enabled drive out of Operational, the reason is "no valid outputs". If an alarm already stops the drive,
    // this function raises no second alarm.
    const bool stops = drive().state() == drive::PowerState::fault_reaction_active;
    const auto why = cause != ethercat::AlStatusCode::none ? cause : ethercat::AlStatusCode::no_valid_outputs;
    if (cause != ethercat::AlStatusCode::none || !stops) {
      drive().communication_lost(jmc_ec::communication_cause(jmc_ec::communication_alarm_index(why)));
    }
  }
  if (cause != ethercat::AlStatusCode::none) bus_error(cause);
  if (from == AlState::pre_operational && to == AlState::safe_operational) {
    // With SYNC0 the period of the targets is the cycle of SYNC0, otherwise 60C2h.
    const double period_s = 1e-9 * objects().communication.output_sync.sync0_cycle_time_ns;
    if (period_s != set_point_period_s_) {
      set_point_period_s_ = period_s;
      reconfigure();
    }
  }
}

}  // namespace servodrome::products
