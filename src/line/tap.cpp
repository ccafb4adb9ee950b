#include "line/tap.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "drive/drive.hpp"
#include "drive/transforms.hpp"
#include "line/axis.hpp"
#include "links/number_text.hpp"

namespace servodrome::line {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

template <typename Read>
double of_drive(Axis& axis, Read read) {
  return axis.powered() ? static_cast<double>(read(axis.device().drive())) : no_value;
}

// The voltage that the drive has set in this tick and that acts in the next one, in the rotor frame of this tick. It is
// not-a-number while the power stage switches nothing.
drive::DirectQuadrature voltage_v(const Axis& axis) {
  const drive::Actuation& set = axis.actuation();
  if (!set.pwm_enabled || set.short_circuit) return {std::nanf(""), std::nanf("")};
  const drive::SinCos angle = drive::sin_cos(drive::phase_of(axis.plant().electrical_angle_turns()));
  const bool two_phases = axis.plant().parameters().motor.phases == 2;
  return two_phases ? drive::to_rotor_frame<2>(set.phase_voltage_v, angle)
                    : drive::to_rotor_frame<3>(set.phase_voltage_v, angle);
}

constexpr std::array signal_table{
    Signal{"position_counts", "counts",
           [](Axis& axis, const Channel&) { return static_cast<double>(axis.plant().position_counts()); }},
    Signal{"velocity_rpm", "rpm", [](Axis& axis, const Channel&) { return axis.plant().velocity_rpm(); }},
    Signal{"torque_nm", "Nm", [](Axis& axis, const Channel&) { return axis.plant().torque_nm(); }},
    Signal{"current_a", "A", [](Axis& axis, const Channel&) { return axis.plant().current_a(); }},
    Signal{"direct_current_a", "A", [](Axis& axis, const Channel&) { return axis.plant().direct_current_a(); }},
    Signal{"direct_voltage_v", "V", [](Axis& axis, const Channel&) { return static_cast<double>(voltage_v(axis).d); }},
    Signal{"quadrature_voltage_v", "V",
           [](Axis& axis, const Channel&) { return static_cast<double>(voltage_v(axis).q); }},
    Signal{"temperature_c", "degC", [](Axis& axis, const Channel&) { return axis.plant().winding_temperature_c(); }},
    Signal{"stage_temperature_c", "degC",
           [](Axis& axis, const Channel&) { return axis.plant().power_stage_temperature_c(); }},
    Signal{"supply_v", "V", [](Axis& axis, const Channel&) { return axis.plant().dc_link_v(); }},
    Signal{"following_error", "counts",
           [](Axis& axis, const Channel&) {
             return of_drive(axis, [](const drive::Drive& drive) { return drive.loops().following_error_counts; });
           }},
    Signal{"statusword", "",
           [](Axis& axis, const Channel&) {
             return of_drive(axis, [](const drive::Drive& drive) { return drive.statusword(); });
           }},
    Signal{"state", "",
           [](Axis& axis, const Channel&) {
             return of_drive(axis, [](const drive::Drive& drive) { return static_cast<int>(drive.state()); });
           }},
    Signal{"fault_code", "",
           [](Axis& axis, const Channel&) {
             return of_drive(axis, [](const drive::Drive& drive) {
               return drive.any_fault() && drive.shown_fault() != nullptr ? drive.shown_fault()->code : 0;
             });
           }},
};

double read_input(Axis& axis, const Channel& channel) {
  return static_cast<double>(axis.feedback().inputs >> channel.wire & 1u);
}

double read_output(Axis& axis, const Channel& channel) {
  return static_cast<double>(axis.actuation().outputs >> channel.wire & 1u);
}

// Reads the object as an SDO upload would.
double read_object(Axis& axis, const Channel& channel) {
  if (!axis.powered()) return no_value;
  dictionary::ReadValue value;
  const dictionary::Entry& object = *channel.object;
  if (axis.device().dictionary().read(object, value) != dictionary::AbortCode::none) return no_value;
  const std::int64_t raw = dictionary::decode_number(object.type, value.bytes);
  switch (object.type) {
    case dictionary::Type::real32: return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
    case dictionary::Type::unsigned64: return static_cast<double>(static_cast<std::uint64_t>(raw));
    default: return static_cast<double>(raw);
  }
}

}  // namespace

std::span<const Signal> signals() { return signal_table; }

Channel signal_channel(Axis& axis, std::string_view name) {
  for (const Signal& signal : signal_table) {
    if (signal.name == name) return {&axis, signal.read};
  }
  struct Wires {
    std::string_view prefix;
    unsigned count;
    Channel::Read read;
  };
  const Product& product = *axis.settings().product;
  for (const Wires& wires :
       {Wires{"DI", product.input_wires, read_input}, Wires{"DO", product.output_wires, read_output}}) {
    if (!name.starts_with(wires.prefix) || name.size() > 4) continue;
    const auto wire = links::number_of_text<unsigned>(std::string_view(name).substr(2));
    if (wire && *wire < wires.count) return {&axis, wires.read, nullptr, *wire};
  }
  return {};
}

Channel object_channel(Axis& axis, const dictionary::Entry& object) {
  if (!object.readable() || !object.fixed_size()) return {};
  return {&axis, read_object, &object};
}

Tap::Tap(std::vector<Channel> channels, std::int64_t stride)
    : channels_(std::move(channels)),
      rows_(stride, (channels_.front().axis->ticks() / stride + 1) * stride, channels_.size()) {
  for (std::size_t column = 0; column < channels_.size(); ++column) samples_.emplace_back(rows_, column);
  channels_.front().axis->attach(*this);
}

Tap::~Tap() { channels_.front().axis->detach(*this); }

}  // namespace servodrome::line
