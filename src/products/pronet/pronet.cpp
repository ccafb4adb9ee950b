#include "products/pronet/pronet.hpp"

#include <cstring>

namespace servodrome::products {

namespace {

constexpr unsigned can_open = 3;  // Pn006.0 (ch. 8)
// Pn703.0 (ch. 8)
constexpr auto pronet_bit_rates = std::to_array<std::uint32_t>({50'000, 100'000, 125'000, 250'000, 500'000, 1'000'000});
constexpr std::size_t terminal_count = 8;  // CN1_14 to CN1_17, CN1_39 to CN1_42

// Codes of Pn509 and Pn510. The CANopen manual names C (ch. 7.2.4); 2 and 3 are the codes of the ProNet series for POT
// and NOT.
drive::Signal signal_of_code(unsigned code) {
  switch (code) {
    case 0x2: return drive::Signal::positive_limit;
    case 0x3: return drive::Signal::negative_limit;
    case 0xC: return drive::Signal::home;
    default: return drive::Signal::none;
  }
}

// Hex digit of a terminal. Two parameters share the eight terminals: `first` has terminals 0 to 3, `second` 4 to 7.
unsigned digit(std::uint16_t first, std::uint16_t second, std::size_t terminal) {
  const std::uint16_t word = terminal < 4 ? first : second;
  return word >> (4 * (terminal % 4)) & 0xFU;
}

drive::Cause encoder_loss(pronet::Encoder encoder) {
  switch (encoder) {
    case pronet::Encoder::incremental: return drive::Cause::encoder_incremental;
    case pronet::Encoder::resolver: return drive::Cause::encoder_resolver;
    case pronet::Encoder::serial: break;
  }
  return drive::Cause::encoder_connection;
}

std::uint16_t low_word(double value) { return static_cast<std::uint16_t>(std::llround(value)); }

}  // namespace

void Pronet::power_on(const drive::Feedback& feedback, Time now) {
  CanDevice::power_on(feedback, now);
  encoder_zero_ = drive().configuration().encoder_begins_at_zero ? feedback.position_counts : 0;
  apply_transmit_masks();
  if (!pronet::bus_settings_are_possible(objects().manufacturer.parameters)) drive().raise(drive::Cause::bus_settings);
}

void Pronet::prepare(dictionary::Area areas) {
  pronet::Manufacturer& own = objects().manufacturer;
  objects().communication.serial_number = settings().serial_number;
  own.encoder_counts = settings().motor.counts_per_revolution;
  if (contains(areas, dictionary::Area::manufacturer)) {
    if (settings().node_id != 0) own.parameters.set<704>(settings().node_id);
    for (std::size_t i = 0; i < pronet_bit_rates.size(); ++i) {
      if (pronet_bit_rates[i] == settings().bit_rate) own.parameters.set<703>(static_cast<std::uint16_t>(i));
    }
  }
}

// The electronic gear comes from Pn201 and Pn202 at each power-on (ch. 4.2).
void Pronet::loaded(dictionary::Area areas) {
  const pronet::Manufacturer& own = objects().manufacturer;
  if (contains(areas, dictionary::Area::profile)) {
    objects().drive.position_factor_numerator = own.pn201;
    objects().drive.position_factor_divisor = own.pn202;
  }
  limit_torque();
}

// Pn401 and Pn402: the torque limits, forward and reverse, in per cent.
void Pronet::limit_torque() {
  const pronet::ParameterValues& pn = objects().manufacturer.parameters;
  const auto thousandths = [](unsigned percent) { return static_cast<std::uint16_t>(std::min(percent * 10U, 65535U)); };
  objects().drive.positive_torque_limit = thousandths(pn.get<401>());
  objects().drive.negative_torque_limit = thousandths(pn.get<402>());
}

drive::Configuration Pronet::configuration() const {
  const pronet::Manufacturer& own = objects().manufacturer;
  const pronet::ParameterValues& pn = own.parameters;
  drive::Configuration configuration;
  configuration.motor = settings().motor;
  const drive::MotorData& motor = configuration.motor;
  configuration.gains = drive::default_gains(motor, {policy.loops.velocity_ticks, policy.loops.position_ticks}, {});
  configuration.monitors.warning_margin_c = 0.0F;  // no temperature warnings: the alarm list has none
  configuration.monitors.brake_resistor_ms = 500;
  configuration.monitors.limit_switch_levels = true;
  const pronet::Encoder encoder = pronet::encoder_of(motor.counts_per_revolution);
  configuration.encoder_loss = encoder_loss(encoder);
  configuration.index_available = encoder == pronet::Encoder::incremental;  // ch. 7.2
  configuration.encoder_begins_at_zero = encoder == pronet::Encoder::incremental;
  // One count of this encoder is then 5 units of 606Ch, so that 606Fh = 10 can distinguish standing from moving.
  if (encoder == pronet::Encoder::incremental) configuration.shown_velocity_ms = 12.0F;
  for (std::size_t i = 0; i < terminal_count; ++i) {
    configuration.inputs[i] = {signal_of_code(digit(pn.get<509>(), pn.get<510>(), i)),
                               digit(pn.get<516>(), pn.get<517>(), i) != 0};
    if (digit(pn.get<512>(), pn.get<513>(), i) != 0) configuration.bus_inputs |= 1U << i;
  }
  // The unit of Pn514 is 0.2 ms (appendix, 3086h); a cycle takes 0.5 ms.
  configuration.input_filter_cycles = (pn.get<514>() * 2U + 4U) / 5U;
  configuration.sync_period_s = own.sync_time_period_us * 1e-6;
  return configuration;
}

// Without CANopen (Pn006.0), or with impossible bus settings, the node gets no node-ID and sends nothing.
std::uint8_t Pronet::chosen_node_id() const {
  const pronet::ParameterValues& pn = objects().manufacturer.parameters;
  const bool speaks = pn.digit<6>(0) == can_open && pronet::bus_settings_are_possible(pn);
  return speaks ? static_cast<std::uint8_t>(pn.get<704>()) : canopen::unconfigured_node_id;
}

std::uint32_t Pronet::chosen_bit_rate() const {
  const unsigned code = objects().manufacturer.parameters.digit<703>(0);
  return code < pronet_bit_rates.size() ? pronet_bit_rates[code] : factory_bit_rate;
}

void Pronet::apply_transmit_masks() {
  std::uint16_t tpdo = 0;
  for (const auto& mask : objects().manufacturer.transmit_mask) {
    node().set_tpdo_change_mask(tpdo++, std::uint64_t{mask.high} << 32 | mask.low);
  }
}

void Pronet::reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) {
  CanDevice::reset(command, restore, node_id);
  apply_transmit_masks();
}

// Fn000: newest first. A 69 is the only panel number that is printed; the other alarms are recorded by their EMCY
// codes.
void Pronet::record_alarm(const drive::FaultRow& row) {
  auto& alarms = objects().manufacturer.alarms;
  std::copy_backward(alarms.begin(), alarms.end() - 1, alarms.end());
  alarms.front() = row.alarm != 0 ? row.alarm : row.code;
}

void Pronet::fault_raised(const drive::FaultRow& fault) {
  record_alarm(fault);
  CanDevice::fault_raised(fault);
}

void Pronet::warning_raised(const drive::FaultRow& warning) {
  record_alarm(warning);
  CanDevice::warning_raised(warning);
}

dictionary::AbortCode Pronet::check(const dictionary::Entry& entry, std::span<const std::byte> value) {
  const pronet::Parameter* parameter = pronet::find_parameter(entry.index);
  if (parameter == nullptr || value.size() != sizeof(std::uint16_t)) return dictionary::AbortCode::none;
  std::uint16_t number = 0;
  std::memcpy(&number, value.data(), sizeof number);
  return pronet::is_possible(*parameter, number) ? dictionary::AbortCode::none : dictionary::AbortCode::value_invalid;
}

void Pronet::written(const dictionary::Entry& entry) {
  if (entry.index < 0x2004) return apply_transmit_masks();
  // A parameter is saved as soon as it is written. A parameter that acts after a restart does nothing else.
  if (entry.saved) keep(dictionary::Area::manufacturer);
  const pronet::Parameter* parameter = pronet::find_parameter(entry.index);
  const bool acts_later = entry.saved && (parameter == nullptr || parameter->effect == pronet::Effect::after_restart);
  if (acts_later) return;
  limit_torque();
  reconfigure();
}

void Pronet::refresh(const dictionary::Entry& entry) {
  pronet::Manufacturer& own = objects().manufacturer;
  const drive::Axis& axis = drive().axis();
  const drive::CascadeState& loops = drive().loops();
  const double counts_per_rpm = axis.units.counts_per_revolution / 60.0;
  const auto turn = static_cast<drive::Counts>(axis.units.counts_per_revolution);
  const drive::Counts counted = axis.encoder_position - encoder_zero_;
  const drive::Counts within = ((counted % turn) + turn) % turn;
  switch (entry.index) {
    // Monitors with a unit show the quantity that fits it (C43). Those without a unit stay 0, except Un005.
    case 0x320A: own.monitors[0] = low_word(axis.shown_velocity() / counts_per_rpm); break;
    case 0x320B: own.monitors[1] = low_word(axis.generator.velocity() / counts_per_rpm); break;
    case 0x320C: own.monitors[2] = low_word(100.0 * static_cast<double>(loops.torque_reference)); break;
    case 0x320D: own.monitors[3] = low_word(100.0 * static_cast<double>(loops.torque)); break;
    case 0x320E: own.monitors[4] = static_cast<std::uint16_t>(within); break;
    case 0x320F: own.monitors[5] = static_cast<std::uint16_t>(drive().wires()); break;
    case 0x3213: own.monitors[9] = static_cast<std::uint16_t>(loops.following_error_counts); break;
    case 0x3300: own.rotates = static_cast<std::uint16_t>((counted - within) / turn); break;
    case 0x3301: own.single_position = static_cast<std::uint16_t>(within); break;  // C41
    default: break;
  }
}

}  // namespace servodrome::products
