#pragma once

#include "modbus/rtu_server.hpp"
#include "serial10/server.hpp"

namespace servodrome::products {

// What a drive speaks on its RS485 port.
enum class SerialProtocol : std::uint8_t { modbus_rtu, serial10 };

// How an RS485 port is set up.
struct SerialSetup {
  SerialProtocol protocol = SerialProtocol::modbus_rtu;
  std::uint8_t station = 0;  // 0: none, only broadcasts are heard
  modbus::CharacterFormat format{};
  modbus::RtuTiming timing{};
};

// The RS485 port of a drive: a station of a line that all stations hear, with one protocol at a time. Used as
// modbus::RtuServer is: receive() every character of the line but its own, poll() no later than next_deadline(), and
// take() what there is to send after each of these calls.
class SerialPort final {
 public:
  using Time = modbus::Time;

  // All outlive the port.
  SerialPort(dictionary::Dictionary& dictionary, std::span<const modbus::Register> map, const modbus::Profile& profile)
      : server_(dictionary, map, profile), rtu_(server_, modbus::broadcast_station, {}), serial10_(dictionary, 0) {}
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  // What was being received or sent is forgotten.
  void open(const SerialSetup& setup) {
    setup_ = setup;
    selected_ = setup.protocol;
    rtu_.reset(setup.timing);
    rtu_.set_station(setup.station);
    serial10_.reset();
    serial10_.set_id(setup.station);
  }
  // The protocol from the next character on: the answer to the request that changes it goes out in the old one.
  void select(SerialProtocol protocol) { selected_ = protocol; }

  // Not `intact`: a parity or framing error, or a character that two stations sent at once.
  void receive(std::uint8_t character, bool intact, Time at) {
    follow_selection();
    if (speaks_modbus()) {
      intact ? rtu_.receive(character, at) : rtu_.receive_garbled(at);
    } else {
      intact ? serial10_.receive(character, at) : serial10_.receive_garbled(at);
    }
  }
  void poll(Time now) {
    if (speaks_modbus()) rtu_.poll(now);
  }
  Time next_deadline() const { return speaks_modbus() ? rtu_.next_deadline() : modbus::never; }
  // Valid until the next call of receive() or poll().
  std::span<const std::uint8_t> take() { return speaks_modbus() ? rtu_.take() : serial10_.take(); }

  const modbus::CharacterFormat& format() const { return setup_.format; }
  std::uint8_t station() const { return setup_.station; }
  SerialProtocol protocol() const { return selected_; }
  // The registers, for requests that come by another way (Modbus TCP); nullptr while another protocol is spoken.
  modbus::Server* modbus() { return selected_ == SerialProtocol::modbus_rtu ? &server_ : nullptr; }

 private:
  bool speaks_modbus() const { return setup_.protocol == SerialProtocol::modbus_rtu; }
  void follow_selection() {
    if (setup_.protocol == selected_) return;
    setup_.protocol = selected_;
    rtu_.reset(setup_.timing);
    serial10_.reset();
  }

  SerialSetup setup_;
  SerialProtocol selected_ = SerialProtocol::modbus_rtu;
  modbus::Server server_;
  modbus::RtuServer rtu_;
  serial10::Server serial10_;
};

}  // namespace servodrome::products
