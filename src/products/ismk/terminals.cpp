#include "products/ismk/terminals.hpp"

#include "drive/drive.hpp"
#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

namespace {

using drive::InputAction;

// 60B8h: bits of a unit that is on, with both edges enabled; each edge is caught once. The bits of the second unit are
// in the high byte.
constexpr std::uint16_t probe_on = 0x01;
constexpr std::uint16_t probe_rising = 0x10;
constexpr std::uint16_t probe_falling = 0x20;
constexpr std::uint16_t probes_on = 0x0101 * (probe_on | probe_rising | probe_falling);
// 60B9h
constexpr std::uint16_t stored_rising = 0x02;
constexpr std::uint16_t stored_falling = 0x04;

}  // namespace

void Terminals::configure(const ServoObjects& objects, drive::Configuration& configuration) {
  const Io& io = objects.io;
  inputs_.assign(input_functions, io.input_function, io.input_polarity, io.input_simulation, input_count);
  configuration.inputs = inputs_.map();
  configuration.touch_probe = fast_capture;
  configuration.remote = !inputs_.has(InputAction::enable);  // Table 5-5
  configuration.monitors.limit_switches = io.limit_function == 0;
  configuration.brake_inverted = (io.output_polarity >> brake_output & 1) == 0;
  configuration.brake_forced = (io.output_simulation >> brake_output & 1) != 0;
}

void Terminals::cycle(drive::Drive& drive, ServoObjects& objects) {
  if (objects.drive.touch_probe_function != probes_on) drive.set_touch_probe_function(probes_on);
  objects.io.input_real = inputs_.update(drive.wires());
  objects.io.positive_limit_position =
      drive::wrap_to_32_bits(drive.axis().units.to_user(drive.positive_limit_position()));
  objects.io.negative_limit_position =
      drive::wrap_to_32_bits(drive.axis().units.to_user(drive.negative_limit_position()));
  const Tables& tables = objects.tables;
  const drive::Objects& motion = objects.drive;
  const bool ramps = motion.profile_acceleration != 0 && motion.profile_deceleration != 0;
  commands_.step(
      inputs_,
      {.enabling_controlword = tables.controlword,
       .mode_off = tables.mode[0],
       .mode_on = tables.mode[1],
       .positions = tables.position,
       .speeds = tables.speed,
       .speed_modes = speed_table_modes,
       // Table 5-7, 6084h; ch. 5.2.1.1
       .speeds_valid = objects.device.analogue_speed_control == 0 && (motion.modes_of_operation != 3 || ramps)},
      drive, objects.drive);
  write_outputs(drive, objects);
}

void Terminals::write_outputs(drive::Drive& drive, ServoObjects& objects) {
  Io& io = objects.io;
  const Motion& motion = objects.motion;
  conditions_ = outputs_.update(
      drive, {.zero_speed_counts_per_ms = io.zero_speed_window_inc_per_ms,
              .zero_speed_ms = motion.zero_speed_time_ms,
              .torque_current_a = static_cast<float>(motion.torque_reached_reference / peak_current_dec) *
                                  drive.configuration().motor.peak_current_a,
              .torque_ms = static_cast<std::uint32_t>(std::max<std::int16_t>(0, motion.torque_reached_time_ms)),
              .reached_index = commands_.reached()});
  std::uint32_t on = 0;
  for (std::size_t i = 0; i < output_count; ++i) {
    drive::OutputCondition condition = drive::OutputCondition::none;
    if (i >= io.output_function.size()) {
      condition = fixed_outputs[i - io.output_function.size()];
    } else if (const drive::OutputFunctionRow* row = find_function(output_functions, io.output_function[i])) {
      condition = row->condition;
    }
    if (condition != drive::OutputCondition::none && (conditions_ & bit(condition)) != 0) on |= 1u << i;
  }
  // As for the inputs: polarity 1 is direct, 0 inverts; a simulation bit switches the output on.
  constexpr std::uint32_t all = (1u << output_count) - 1u;
  const std::uint32_t levels = (~(on ^ io.output_polarity) | io.output_simulation) & all;
  io.output_real = static_cast<std::uint16_t>(levels);
  drive.set_outputs(levels);
}

Capture Terminals::capture(const drive::Drive& drive, std::size_t unit) {
  const drive::TouchProbe& probe = drive.touch_probe();
  const unsigned status = probe.status() >> (8 * unit);
  const auto position = [&](std::size_t slot) {
    return drive.axis().units.to_user(probe.position(2 * unit + slot) + drive.position_offset());
  };
  return {.rising = (status & stored_rising) != 0,
          .falling = (status & stored_falling) != 0,
          .rising_position = position(0),
          .falling_position = position(1)};
}

void Terminals::rearm(drive::Drive& drive, std::size_t unit, bool rising_edge) {
  const auto edge = static_cast<unsigned>(rising_edge ? probe_rising : probe_falling) << (8 * unit);
  drive.set_touch_probe_function(static_cast<std::uint16_t>(probes_on & ~edge));
  drive.set_touch_probe_function(probes_on);
}

void enter_position(Tables& tables) {
  tables.position[tables.select & 7U] = tables.position_m * 10000 + tables.position_n;
}

}  // namespace servodrome::products::ismk
