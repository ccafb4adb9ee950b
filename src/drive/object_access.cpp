#include <algorithm>
#include <cstring>

#include "drive/rounding.hpp"
#include "drive/with_mode.hpp"

// The drive as owner of dictionary objects: effects of writes, and values computed for reads.
namespace servodrome::drive {

namespace {

using dictionary::AbortCode;
using dictionary::Entry;
using dictionary::Handlers;
using dictionary::Listener;
using Value = std::span<const std::byte>;

bool allowed(std::uint32_t values, std::int64_t code) { return code >= 0 && code < 32 && (values >> code & 1u) != 0; }

// The signal that 60FDh shows for `signal`.
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
  return static_cast<Integer>(round_to_integer(value));
}

std::int64_t number(const Entry& entry, Value value) { return dictionary::decode_number(entry.type, value); }

AbortCode legal(bool is) { return is ? AbortCode::none : AbortCode::value_invalid; }

// For 605Ah and 605Dh, which have codes for stopping at once.
bool allowed_stop(const OptionCodes& codes, std::uint32_t values, std::int64_t code) {
  return allowed(values, code) || (codes.at_once_from != 0 && code >= codes.at_once_from);
}

double sign(const Units& units) { return units.velocity_inverted ? -1.0 : 1.0; }

// Handlers that call `act` with their drive.
template <auto act>
constexpr auto check_by =
    [](Listener& drive, const Entry& entry, Value value) { return act(static_cast<Drive&>(drive), entry, value); };
template <auto act>
constexpr auto written_by = [](Listener& drive, const Entry& entry) { act(static_cast<Drive&>(drive), entry); };
template <auto act>
constexpr auto refresh_by = [](Listener& drive, const Entry& entry) {
  if constexpr (requires(Drive & its) { act(its, entry); }) {  // for a range of objects
    act(static_cast<Drive&>(drive), entry);
  } else {
    act(static_cast<Drive&>(drive));
  }
};

}  // namespace

struct Drive::OwnObjects {
  std::uint16_t first;
  std::uint16_t last;
  Handlers handlers;

  constexpr OwnObjects(std::uint16_t only, Handlers its_handlers) : OwnObjects(only, only, its_handlers) {}
  constexpr OwnObjects(std::uint16_t from, std::uint16_t to, Handlers their_handlers)
      : first(from), last(to), handlers(their_handlers) {}
};

// Not inlined, because only this function needs stack for a copy of all objects.
[[gnu::noinline]] AbortCode Drive::check_units(const Entry& entry, std::span<const std::byte> value) const {
  if (energised()) return AbortCode::device_state;
  if (entry.offset < objects_base_ || entry.offset + value.size() > objects_base_ + sizeof(Objects)) {
    return AbortCode::none;
  }
  Objects tried = axis_.objects;
  std::memcpy(reinterpret_cast<std::byte*>(&tried) + (entry.offset - objects_base_), value.data(), value.size());
  Units units = axis_.units;
  const bool possible = policy_.units == nullptr || policy_.units(tried, axis_.configuration.motor, units);
  return possible ? AbortCode::none : AbortCode::parameter_incompatible;
}

// Sorted by index.
std::span<const Drive::OwnObjects> Drive::own_objects() {
  // A change of units would make the axis jump, so it needs power off. Afterwards the position demand is the position
  // of the shaft in the new units.
  static constexpr Handlers unit{
      .check = check_by<[](Drive& drive, const Entry& entry, Value value) { return drive.check_units(entry, value); }>,
      .written = written_by<[](Drive& drive, const Entry&) {
        drive.set_units();
        drive.axis_.generator.reset(drive.axis_.position());
      }>};
  static constexpr auto table = std::to_array<OwnObjects>({
      {0x6040, {.written = written_by<[](Drive& drive, const Entry&) {
                  drive.handle_controlword(drive.controlword_, drive.axis_.objects.controlword);
                }>}},
      {0x6041, {.refresh = refresh_by<[](Drive& drive) { drive.axis_.objects.statusword = drive.statusword(); }>}},
      {0x6043, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.vl_velocity_demand =
                      saturated<std::int16_t>(VelocityMode::to_vl(drive.axis_, drive.axis_.generator.velocity()));
                }>}},
      {0x6044, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.vl_velocity_actual_value =
                      saturated<std::int16_t>(VelocityMode::to_vl(drive.axis_, drive.axis_.shown_velocity()));
                }>}},
      {0x604B,
       0x604C,
       {.check = check_by<[](Drive&, const Entry& entry, Value value) { return legal(number(entry, value) != 0); }>}},
      {0x605A, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(allowed_stop(drive.policy_.power.option_codes,
                                            drive.policy_.power.option_codes.quick_stop, number(entry, value)));
                }>}},
      {0x605B, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(allowed(drive.policy_.power.option_codes.shutdown, number(entry, value)));
                }>}},
      {0x605C, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(allowed(drive.policy_.power.option_codes.disable_operation, number(entry, value)));
                }>}},
      {0x605D, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(allowed_stop(drive.policy_.power.option_codes, drive.policy_.power.option_codes.halt,
                                            number(entry, value)));
                }>}},
      {0x605E, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(allowed(drive.policy_.power.option_codes.fault_reaction, number(entry, value)));
                }>}},
      {0x6060,
       {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
          const std::int64_t mode = number(entry, value);
          return legal(mode == 0 ? drive.policy_.modes.none
                                 : (drive.policy_.modes.supported & mode_bit(static_cast<Mode>(mode))) != 0);
        }>,
        .written = written_by<[](Drive& drive, const Entry&) { drive.change_mode(); }>}},
      {0x6061, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.modes_of_operation_display = static_cast<std::int8_t>(drive.mode_);
                }>}},
      {0x6062, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.position_demand_value =
                      wrap_to_32_bits(drive.axis_.to_user_position(drive.axis_.generator.nearest_position()));
                }>}},
      {0x6063, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.position_actual_internal_value = wrap_to_32_bits(drive.axis_.position());
                }>}},
      {0x6064, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.position_actual_value =
                      wrap_to_32_bits(drive.axis_.to_user_position(drive.axis_.position()));
                }>}},
      {0x6069, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.velocity_sensor_actual_value =
                      saturated<std::int32_t>(drive.axis_.shown_velocity() / drive.axis_.units.velocity_sensor);
                }>}},
      {0x606B, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.velocity_demand_value =
                      saturated<std::int32_t>(drive.axis_.units.velocity_to_user(drive.axis_.generator.velocity()));
                }>}},
      {0x606C, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.velocity_actual_value =
                      saturated<std::int32_t>(drive.axis_.units.velocity_to_user(drive.axis_.shown_velocity()));
                }>}},
      {0x6074, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.torque_demand = saturated<std::int16_t>(
                      sign(drive.axis_.units) * 1000.0 * static_cast<double>(drive.cascade_.state().torque_reference));
                }>}},
      {0x6077, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.torque_actual_value = saturated<std::int16_t>(
                      sign(drive.axis_.units) * 1000.0 * static_cast<double>(drive.cascade_.state().torque));
                }>}},
      {0x6078, {.refresh = refresh_by<[](Drive& drive) {
                  const float rated = drive.axis_.configuration.motor.rated_current_a;
                  drive.axis_.objects.current_actual_value =
                      saturated<std::int16_t>(sign(drive.axis_.units) / drive.axis_.units.current *
                                              static_cast<double>(drive.cascade_.state().current_q_a / rated));
                }>}},
      {0x6079, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.dc_link_circuit_voltage_mv =
                      saturated<std::uint32_t>(1000.0 * static_cast<double>(drive.dc_link_.voltage_v()));
                }>}},
      {0x607A, {.written = written_by<[](Drive& drive, const Entry&) { drive.axis_.new_set_point = true; }>}},
      {0x607E, unit},
      {0x6086, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  return legal(drive.policy_.ramps.zeros_are_faults ||
                               drive.axis_.has_shape(static_cast<std::int16_t>(number(entry, value))));
                }>}},
      {0x608F, unit},
      {0x6090, 0x6094, unit},
      {0x6096, 0x6097, unit},
      {0x6098, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  const std::int64_t method = number(entry, value);
                  return legal(drive.axis_.monitors(Cause::homing_method) || method == entry.default_value ||
                               find_method(drive.policy_.homing.methods, static_cast<std::int8_t>(method)) != nullptr);
                }>}},
      {0x60A9, unit},
      {0x60B8, {.written = written_by<[](Drive& drive, const Entry&) {
                  drive.touch_probe_.write_function(drive.axis_.objects.touch_probe_function);
                }>}},
      {0x60B9,
       {.refresh =
            refresh_by<[](Drive& drive) { drive.axis_.objects.touch_probe_status = drive.touch_probe_.status(); }>}},
      {0x60BA, 0x60BD, {.refresh = refresh_by<[](Drive& drive, const Entry& entry) {
                          drive.show_touch_probe_position(entry.index - 0x60BAU);
                        }>}},
      {0x60C1,
       {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
          if (entry.sub != 1 || !drive.buffers_records()) return AbortCode::none;
          const auto record = static_cast<std::int32_t>(number(entry, value));
          return drive.interpolated_position_.takes_record(drive.axis_, record) ? AbortCode::none
                                                                                : AbortCode::device_state;
        }>,
        .written = written_by<[](Drive& drive, const Entry& entry) {
          if (entry.sub != 1) return;
          if (drive.buffers_records()) drive.interpolated_position_.data_record(drive.axis_);
          drive.synchronous_interpolation_.data_record();
        }>}},
      {0x60C2, {.check = check_by<[](Drive& drive, const Entry& entry, Value value) {
                  const InterpolationPolicy::Periods& periods = drive.policy_.interpolation.periods;
                  const std::int64_t written = number(entry, value);
                  if (entry.sub == 1) return legal(written >= periods.least_value);
                  return legal(written >= periods.least_index && written <= periods.greatest_index);
                }>}},
      {0x60C4,
       {.check = check_by<[](Drive&, const Entry& entry, Value value) {
          return legal(entry.sub != 2 ||
                       number(entry, value) <= static_cast<std::int64_t>(InterpolatedPosition::capacity));
        }>,
        .written = written_by<[](Drive& drive, const Entry& entry) {
          if (entry.sub == 6 || entry.sub == 2 || entry.sub == 4) drive.interpolated_position_.clear_buffer();
        }>,
        .refresh = refresh_by<[](Drive& drive) {
          drive.axis_.objects.interpolation_buffer_position =
              static_cast<std::uint16_t>(drive.buffers_records() ? drive.interpolated_position_.buffered() : 0);
        }>}},
      {0x60D0,
       {.check = check_by<[](Drive&, const Entry& entry, Value value) {
          const std::int64_t source = number(entry, value);
          return legal(source == 1 || source == 2 || source == 5 || source == 6);
        }>,
        .written = written_by<[](Drive& drive, const Entry& entry) {
          const std::size_t probe = entry.sub - 1U;
          drive.touch_probe_.write_source(probe, drive.axis_.objects.touch_probe_source[probe]);
        }>}},
      {0x60D5, 0x60D8, {.refresh = refresh_by<[](Drive& drive, const Entry& entry) {
                          const std::size_t slot = entry.index - 0x60D5U;
                          drive.axis_.objects.touch_probe_edge_counter[slot] = drive.touch_probe_.edge_counter(slot);
                        }>}},
      {0x60F4, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.following_error_actual_value =
                      drive.axis_.demand.loop == Loop::position || drive.axis_.demand.loop == Loop::locked
                          ? wrap_to_32_bits(drive.axis_.units.to_user(drive.cascade_.state().following_error_counts))
                          : 0;
                }>}},
      {0x60FA, {.refresh = refresh_by<[](Drive& drive) {
                  const auto reference = static_cast<double>(drive.cascade_.state().velocity_reference_counts_per_s);
                  drive.axis_.objects.control_effort =
                      saturated<std::int32_t>(drive.axis_.units.velocity_to_user(reference));
                }>}},
      {0x60FC, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.position_demand_internal_value =
                      wrap_to_32_bits(drive.axis_.generator.nearest_position());
                }>}},
      {0x60FD, {.refresh = refresh_by<[](Drive& drive) { drive.show_digital_inputs(); }>}},
      {0x6502, {.refresh = refresh_by<[](Drive& drive) {
                  drive.axis_.objects.supported_drive_modes = drive.policy_.modes.supported;
                }>}},
  });
  static_assert(std::is_sorted(table.begin(), table.end(),
                               [](const OwnObjects& a, const OwnObjects& b) { return a.last < b.first; }));
  return table;
}

const Handlers* Drive::handlers_of(const Entry& entry) {
  const auto objects = own_objects();
  const auto found = std::lower_bound(objects.begin(), objects.end(), entry.index,
                                      [](const OwnObjects& one, std::uint16_t index) { return one.last < index; });
  return found != objects.end() && found->first <= entry.index ? &found->handlers : nullptr;
}

Handlers Drive::handlers(const Entry& entry) {
  const Handlers* own = handlers_of(entry);
  return own != nullptr ? *own : Handlers{};
}

AbortCode Drive::check(const Entry& entry, Value value) {
  const Handlers* own = handlers_of(entry);
  return own != nullptr && own->check != nullptr ? own->check(*this, entry, value) : AbortCode::none;
}

void Drive::written(const Entry& entry) {
  if (const Handlers* own = handlers_of(entry); own != nullptr && own->written != nullptr) own->written(*this, entry);
}

void Drive::refresh(const Entry& entry) {
  if (const Handlers* own = handlers_of(entry); own != nullptr && own->refresh != nullptr) own->refresh(*this, entry);
}

void Drive::show_touch_probe_position(std::size_t slot) {
  const bool deviation = axis_.configuration.touch_probe.index_value == TouchProbeCapability::IndexValue::deviation;
  const Counts counts = touch_probe_.position(slot);
  axis_.objects.touch_probe_position[slot] =
      wrap_to_32_bits(deviation ? counts : axis_.to_user_position(counts + axis_.offset));
}

void Drive::show_digital_inputs() {
  std::uint32_t word = 0;
  const bool exchanged = policy_.terminals.limit_inputs_follow_polarity && axis_.units.position_inverted;
  for (const DigitalInputBit& input : policy_.terminals.inputs) {
    const bool wire = input.source == DigitalInputBit::Source::wire;
    const std::uint8_t number = wire ? input.number : shown_limit(input.number, exchanged);
    word |= ((wire ? inputs_.wires : axis_.signals) >> number & 1u) << input.bit;
  }
  axis_.objects.digital_inputs = word;
}

}  // namespace servodrome::drive
