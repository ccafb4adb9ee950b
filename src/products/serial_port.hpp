#pragma once

#include "modbus/rtu_server.hpp"
#include "serial10/server.hpp"

namespace servodrome::products {

// The protocol of a drive's RS485 port.
enum class SerialProtocol : std::uint8_t { modbus_rtu, serial10 };

// How an RS485 port is set up.
struct SerialSetup {
  SerialProtocol protocol = SerialProtocol::modbus_rtu;
  std::uint8_t station = 0;  // 0: none, the drive receives broadcasts only
  modbus::CharacterFormat format{};
  modbus::RtuTiming timing{};
};

// The RS485 port of a drive: a station on a shared line, with one protocol at a time. Its use is that of
// modbus::RtuServer: call receive() for every character on the line except its own, poll() no later than
// next_deadline(), and send the result of take() after each of these calls.
class SerialPort final {
 public:
  using Time = modbus::Time;

  // All arguments must outlive the port.
  SerialPort(dictionary::Dictionary& dictionary, std::span<const modbus::Register> map, const modbus::Profile& profile)
      : server_(dictionary, map, profile), rtu_(server_, modbus::broadcast_station, {}), serial10_(dictionary, 0) {}
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  // Discards frames that are being received or sent.
  void open(const SerialSetup& setup) {
    setup_ = setup;
    selected_ = setup.protocol;
    rtu_.reset(setup.timing);
    rtu_.set_station(setup.station);
    serial10_.reset();
    serial10_.set_id(setup.station);
  }
  // The protocol changes with the next character: the answer to the request that changes it still uses the old
  // protocol.
  void select(SerialProtocol protocol) { selected_ = protocol; }

  // `intact` is false for a parity or framing error, or a collision of two stations.
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
  // The registers, for requests over another path (Modbus TCP); nullptr while the port uses another protocol.
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
