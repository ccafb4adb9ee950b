#include <cstring>

#include "drive/with_mode.hpp"

// The drive as owner of dictionary objects: what a write means, and values computed when they are read.
namespace servodrome::drive {

namespace {

using dictionary::AbortCode;
using dictionary::Entry;

bool allowed(std::uint32_t values, std::int64_t code) { return code >= 0 && code < 32 && (values >> code & 1u) != 0; }

// The signal that stands for `signal` in 60FDh.
std::uint8_t shown_limit(std::uint8_t signal, bool exchanged) {
  constexpr auto negative = static_cast<std::uint8_t>(Signal::negative_limit);
  constexpr auto positive = static_cast<std::uint8_t>(Signal::positive_limit);
  if (!exchanged || (signal != negative && signal != positive)) return signal;
  return signal == negative ? positive : negative;
}

template <typename Integer>
Integer saturated(double value) {
  constexpr double low = static_cast<double>(std::numeric_limits<Integer>::min());
  constexpr double high = static_cast<double>(std::numeric_limits<Integer>::max());
  if (!(value > low)) return std::numeric_limits<Integer>::min();
  if (value >= high) return std::numeric_limits<Integer>::max();
  // As std::llround, halves away from zero, without the call.
  const auto whole = static_cast<std::int64_t>(value);
  const double rest = value - static_cast<double>(whole);
  return static_cast<Integer>(whole + (rest >= 0.5 ? 1 : rest <= -0.5 ? -1 : 0));
}

}  // namespace

AbortCode Drive::check(const Entry& entry, std::span<const std::byte> value) {
  const auto number = [&] { return dictionary::decode_number(entry.type, value); };  // few want it
  const OptionCodes& codes = policy_.option_codes;
  const auto at_once = [&codes](std::int64_t code) { return codes.at_once_from != 0 && code >= codes.at_once_from; };
  const auto legal = [](bool is) { return is ? AbortCode::none : AbortCode::value_invalid; };
  switch (entry.index) {
    case 0x604B:
    case 0x604C: return legal(number() != 0);
    case 0x605A: return legal(allowed(codes.quick_stop, number()) || at_once(number()));
    case 0x605B: return legal(allowed(codes.shutdown, number()));
    case 0x605C: return legal(allowed(codes.disable_operation, number()));
    case 0x605D: return legal(allowed(codes.halt, number()) || at_once(number()));
    case 0x605E: return legal(allowed(codes.fault_reaction, number()));
    case 0x6060:
      return legal(number() == 0 ? policy_.mode_none
                                 : (policy_.supported_modes & mode_bit(static_cast<Mode>(number()))) != 0);
    case 0x6086: return legal(policy_.zero_values_are_faults || axis_.has_shape(static_cast<std::int16_t>(number())));
    case 0x6098:
      return legal(axis_.monitors(Cause::homing_method) || number() == entry.default_value ||
                   find_method(policy_.homing_methods, static_cast<std::int8_t>(number())) != nullptr);
    case 0x608F:
    case 0x6090:
    case 0x6091:
    case 0x6092:
    case 0x6093:
    case 0x6094:
    case 0x6096:
    case 0x6097:
    case 0x60A9:
    case 0x607E: return check_units(entry, value);
    case 0x60C4:
      if (entry.sub == 2) return legal(number() <= static_cast<std::int64_t>(InterpolatedPosition::capacity));
      break;
    case 0x60D0: return legal(number() == 1 || number() == 2 || number() == 5 || number() == 6);
    default: break;
  }
  return AbortCode::none;
}

// Apart, since it alone needs room for all objects.
[[gnu::noinline]] AbortCode Drive::check_units(const Entry& entry, std::span<const std::byte> value) const {
  if (energised()) return AbortCode::device_state;  // the axis would jump in its own units
  if (entry.offset < objects_base_ || entry.offset + value.size() > objects_base_ + sizeof(Objects)) {
    return AbortCode::none;
  }
  Objects tried = axis_.objects;
  std::memcpy(reinterpret_cast<std::byte*>(&tried) + (entry.offset - objects_base_), value.data(), value.size());
  Units units = axis_.units;
  const bool possible = policy_.units == nullptr || policy_.units(tried, axis_.configuration.motor, units);
  return possible ? AbortCode::none : AbortCode::parameter_incompatible;
}

void Drive::written(const Entry& entry) {
  const Objects& objects = axis_.objects;
  switch (entry.index) {
    case 0x6040: handle_controlword(controlword_, objects.controlword); break;
    case 0x6060: change_mode(); break;
    case 0x607A: axis_.new_set_point = true; break;
    case 0x60B8: touch_probe_.write_function(objects.touch_probe_function); break;
    case 0x60C1:
      if (entry.sub != 1) break;
      interpolated_position_.data_record(axis_);
      synchronous_interpolation_.data_record();
      break;
    case 0x60C4:
      if (entry.sub == 6 || entry.sub == 2 || entry.sub == 4) interpolated_position_.clear_buffer();
      break;
    case 0x60D0:
      touch_probe_.write_source(static_cast<std::size_t>(entry.sub - 1), objects.touch_probe_source[entry.sub - 1U]);
      break;
    case 0x608F:
    case 0x6090:
    case 0x6091:
    case 0x6092:
    case 0x6093:
    case 0x6094:
    case 0x6096:
    case 0x6097:
    case 0x60A9:
    case 0x607E:
      set_units();
      axis_.generator.reset(axis_.position());
      break;
    default: break;
  }
}

void Drive::refresh(const Entry& entry) {
  Objects& objects = axis_.objects;
  const CascadeState& loops = cascade_.state();
  const Units& units = axis_.units;
  const auto sign = [&units] { return units.velocity_inverted ? -1.0 : 1.0; };
  switch (entry.index) {
    case 0x6041: objects.statusword = statusword(); break;
    case 0x6043:
      objects.vl_velocity_demand = saturated<std::int16_t>(VelocityMode::to_vl(axis_, axis_.generator.velocity()));
      break;
    case 0x6044:
      objects.vl_velocity_actual_value = saturated<std::int16_t>(VelocityMode::to_vl(axis_, axis_.velocity()));
      break;
    case 0x6061: objects.modes_of_operation_display = static_cast<std::int8_t>(mode_); break;
    case 0x6062:
      objects.position_demand_value = wrap_to_32_bits(axis_.to_user_position(axis_.generator.nearest_position()));
      break;
    case 0x6063: objects.position_actual_internal_value = wrap_to_32_bits(axis_.position()); break;
    case 0x6064: objects.position_actual_value = wrap_to_32_bits(axis_.to_user_position(axis_.position())); break;
    case 0x6069:
      objects.velocity_sensor_actual_value = saturated<std::int32_t>(axis_.shown_velocity() / units.velocity_sensor);
      break;
    case 0x606B:
      objects.velocity_demand_value = saturated<std::int32_t>(units.velocity_to_user(axis_.generator.velocity()));
      break;
    case 0x606C:
      objects.velocity_actual_value = saturated<std::int32_t>(units.velocity_to_user(axis_.shown_velocity()));
      break;
    case 0x6074:
      objects.torque_demand = saturated<std::int16_t>(sign() * 1000.0 * static_cast<double>(loops.torque_reference));
      break;
    case 0x6077:
      objects.torque_actual_value = saturated<std::int16_t>(sign() * 1000.0 * static_cast<double>(loops.torque));
      break;
    case 0x6078:
      objects.current_actual_value = saturated<std::int16_t>(
          sign() / units.current * static_cast<double>(loops.current_q_a / axis_.configuration.motor.rated_current_a));
      break;
    case 0x6079:
      objects.dc_link_circuit_voltage_mv = saturated<std::uint32_t>(1000.0 * static_cast<double>(dc_link_v_));
      break;
    case 0x60B9: objects.touch_probe_status = touch_probe_.status(); break;
    case 0x60BA:
    case 0x60BB:
    case 0x60BC:
    case 0x60BD: {
      const std::size_t slot = entry.index - 0x60BAU;
      const bool deviation = axis_.configuration.touch_probe.index_value == TouchProbeCapability::IndexValue::deviation;
      const Counts counts = touch_probe_.position(slot);
      objects.touch_probe_position[slot] =
          wrap_to_32_bits(deviation ? counts : axis_.to_user_position(counts + axis_.offset));
      break;
    }
    case 0x60C4:
      objects.interpolation_buffer_position = static_cast<std::uint16_t>(interpolated_position_.buffered());
      break;
    case 0x60D5:
    case 0x60D6:
    case 0x60D7:
    case 0x60D8: {
      const std::size_t slot = entry.index - 0x60D5U;
      objects.touch_probe_edge_counter[slot] = touch_probe_.edge_counter(slot);
      break;
    }
    case 0x60F4:
      objects.following_error_actual_value =
          axis_.demand.loop == Loop::position ? wrap_to_32_bits(units.to_user(loops.following_error_counts)) : 0;
      break;
    case 0x60FA:
      objects.control_effort =
          saturated<std::int32_t>(units.velocity_to_user(static_cast<double>(loops.velocity_reference_counts_per_s)));
      break;
    case 0x60FC: objects.position_demand_internal_value = wrap_to_32_bits(axis_.generator.nearest_position()); break;
    case 0x60FD: {
      std::uint32_t word = 0;
      const bool exchanged = policy_.limit_inputs_follow_polarity && units.position_inverted;
      for (const DigitalInputBit& input : policy_.digital_inputs) {
        const bool wire = input.source == DigitalInputBit::Source::wire;
        const std::uint8_t number = wire ? input.number : shown_limit(input.number, exchanged);
        word |= ((wire ? wires_ : axis_.signals) >> number & 1u) << input.bit;
      }
      objects.digital_inputs = word;
      break;
    }
    case 0x6502: objects.supported_drive_modes = policy_.supported_modes; break;
    default: break;
  }
}

}  // namespace servodrome::drive
