#include "products/generic402/generic402.hpp"

#include <algorithm>

namespace servodrome::products {

namespace {

struct BitTiming {
  std::uint8_t index;  // CiA 305 table 1
  std::uint32_t bit_rate;
};
constexpr auto bit_timings = std::to_array<BitTiming>(
    {{0, 1000000}, {1, 800000}, {2, 500000}, {3, 250000}, {4, 125000}, {6, 50000}, {7, 20000}, {8, 10000}});

}  // namespace

void Generic402::prepare(dictionary::Area areas) {
  objects().communication.serial_number = settings().serial_number;
  generic402::prepare(objects().manufacturer, objects().drive, settings(), areas);
}

void Generic402::power_on(const drive::Feedback& feedback, Time now) {
  CanDevice::power_on(feedback, now);
  open_serial_port();
}

void Generic402::reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) {
  CanDevice::reset(command, restore, node_id);
  if (command == canopen::NmtCommand::reset_node) open_serial_port();
}

void Generic402::open_serial_port() { serial_port_.open(generic402::serial_setup(objects().manufacturer, settings())); }

drive::Configuration Generic402::configuration() const {
  return generic402::configuration(objects().manufacturer, settings().motor);
}

dictionary::AbortCode Generic402::check(const dictionary::Entry& entry, std::span<const std::byte> value) {
  using dictionary::AbortCode;
  const std::int64_t number = dictionary::decode_number(entry.type, value);
  if (entry.index == 0x2F00 && number > 127 && number != canopen::unconfigured_node_id) return AbortCode::value_invalid;
  if (entry.index == 0x2F01) {
    const bool known = std::any_of(bit_timings.begin(), bit_timings.end(),
                                   [number](const BitTiming& timing) { return timing.bit_rate == number; });
    if (!known) return AbortCode::value_invalid;
  }
  return AbortCode::none;
}

void Generic402::written(const dictionary::Entry& entry) {
  if (entry.index < 0x2F00) reconfigure();
}

void Generic402::refresh(const dictionary::Entry& entry) {
  if (entry.index == 0x2060) {
    objects().manufacturer.i2t_utilisation = generic402::i2t_utilisation(drive());
  }
}

// The lamps RUN and ERR of CiA 303-3.
Lamps Generic402::lamps(Time) {
  Lamp run{"RUN", "green"};
  switch (node().nmt_state()) {
    case canopen::NmtState::initialising: break;
    case canopen::NmtState::stopped: run = {run.name, run.colour, Light::flashes, 1}; break;
    case canopen::NmtState::pre_operational: run.light = Light::blinking; break;
    case canopen::NmtState::operational: run.light = Light::on; break;
  }
  Lamp error{"ERR", "red"};
  switch (node().bus_state()) {
    case canopen::BusState::error_active:
      if (node().communication_error()) error = {error.name, error.colour, Light::flashes, 2};
      break;
    case canopen::BusState::error_passive: error = {error.name, error.colour, Light::flashes, 1}; break;
    case canopen::BusState::bus_off: error.light = Light::on; break;
  }
  Lamps lamps;
  lamps.add(run);
  lamps.add(error);
  return lamps;
}

std::span<const std::byte> Generic402::domain(const dictionary::Entry&) { return settings().description; }

bool Generic402::lss_bit_timing_supported(std::uint8_t index) {
  return std::any_of(bit_timings.begin(), bit_timings.end(),
                     [index](const BitTiming& row) { return row.index == index; });
}

canopen::LssStore Generic402::lss_store(std::uint8_t node_id, std::uint8_t bit_timing_index) {
  constexpr std::array<std::uint32_t, 2> keys{0x2F0000, 0x2F0100};  // node-ID, bit rate
  std::span<const std::uint32_t> configured = std::span(keys).first(1);
  objects().manufacturer.node_id = node_id;
  for (const BitTiming& row : bit_timings) {
    if (row.index != bit_timing_index) continue;
    objects().manufacturer.bit_rate = row.bit_rate;
    configured = keys;
  }
  if (settings().store == nullptr) return canopen::LssStore::not_supported;
  return save_objects(configured) == dictionary::AbortCode::none ? canopen::LssStore::done : canopen::LssStore::failed;
}

void Generic402::lss_activate_bit_timing(std::uint8_t index, Time delay, Time now) {
  for (const BitTiming& row : bit_timings) {
    if (row.index == index) switch_bit_rate(row.bit_rate, now + delay);
  }
}

}  // namespace servodrome::products
