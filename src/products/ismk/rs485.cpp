// The RS485 port of the iSMK: Modbus RTU or the 10-byte protocol (ch. 4.1.2.1, 8.1 and 8.2).
#include <algorithm>

#include "products/ismk/servo.hpp"

namespace servodrome::products::ismk {

namespace {

// 6510h sub 0Ch (ch. 4.1.2.1, 8.1 and 8.2).
constexpr std::uint8_t speaks_serial10 = 1U << 0;
constexpr std::uint8_t after_restart = 1U << 1;

SerialProtocol protocol_of(std::uint8_t selection) {
  return (selection & speaks_serial10) != 0 ? SerialProtocol::serial10 : SerialProtocol::modbus_rtu;
}

}  // namespace

bool supports(const modbus::CharacterFormat& format) {
  return format.data_bits == 8 && format.stop_bits == 1 && format.parity == modbus::Parity::none &&  // ch. 4.1.2.1
         std::any_of(rs485_bit_rates.begin(), rs485_bit_rates.end(),
                     [&](std::uint16_t code) { return rs485_bit_rate_of(code) == format.bit_rate; });
}

void Servo::prepare_rs485(dictionary::Area areas) {
  Buses& own = objects_.buses;
  if (contains(areas, dictionary::Area::manufacturer)) {
    for (const std::uint16_t code : rs485_bit_rates) {
      if (settings_.serial.format && rs485_bit_rate_of(code) == settings_.serial.format->bit_rate) {
        own.rs485_bit_rate = code;
      }
    }
  }
  if (contains(areas, dictionary::Area::profile) && settings_.serial.protocol) {
    own.rs485_protocol = *settings_.serial.protocol == SerialProtocol::serial10 ? speaks_serial10 : 0;
  }
}

SerialSetup Servo::serial_setup() const {
  const Buses& own = objects_.buses;
  SerialSetup setup;
  setup.protocol = protocol_of(own.rs485_protocol);
  setup.station = static_cast<std::uint8_t>(own.station);
  setup.format = {.bit_rate = rs485_bit_rate_of(own.rs485_bit_rate), .parity = modbus::Parity::none};
  // The manual gives no pauses. 3.5 characters end a frame, as in Modbus; shorter pauses within a frame are ignored.
  setup.timing = modbus::character_timing(setup.format);
  setup.timing.inter_character = Time{0};
  setup.timing = modbus::at_least(settings_.serial.silence, setup.timing);
  return setup;
}

void Servo::select_protocol(SerialPort& port) {
  const std::uint8_t selection = objects_.buses.rs485_protocol;
  if ((selection & after_restart) == 0) port.select(protocol_of(selection));
}

}  // namespace servodrome::products::ismk
