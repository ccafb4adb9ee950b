#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "canopen/frame.hpp"
#include "dictionary/dictionary.hpp"
#include "drive/hardware.hpp"
#include "drive/loops/motor_data.hpp"
#include "products/lamps.hpp"
#include "products/serial_port.hpp"

namespace servodrome::dictionary {
class Medium;
}
namespace servodrome::drive {
class Drive;
struct FaultRow;
}  // namespace servodrome::drive
namespace servodrome::canopen {
class Node;
}
namespace servodrome::ethercat {
class Esc;
class Slave;
}  // namespace servodrome::ethercat

// A drive as it leaves the factory: dictionary, servo drive and bus stacks of one product, wired together. What a line
// or a microcontroller's board support sees of it.
namespace servodrome::products {

using Time = std::chrono::nanoseconds;  // since the start of the line; never the wall clock

// How a drive's RS485 port is commissioned; what is not given is the product's factory value.
struct SerialSettings {
  std::uint8_t station = 0;  // 0: the product's
  std::optional<modbus::CharacterFormat> format;
  std::optional<SerialProtocol> protocol;
  // At least so long is the line silent at the end of a Modbus frame, and no pause within one matters: for stations
  // whose pauses come from an operating system. 0: the protocol's silence.
  Time silence{};
};

// What an EtherCAT slave has of its own on the line.
struct EthercatSettings {
  std::uint16_t station_alias = 0;                  // configured station alias in its SII; 0: none
  std::int32_t oscillator_ppb = 0;                  // error of its oscillator, parts per billion
  std::optional<std::uint16_t> sync_error_limit{};  // 10F1h:02 at power-on; else the factory's
};

// What the commissioning of a real drive would set by switches, PC tool or nameplate.
struct Settings {
  std::uint8_t node_id = 0;    // 0: the product's factory value
  std::uint32_t bit_rate = 0;  // bit/s; 0: the product's factory value
  std::uint32_t serial_number = 1;
  std::string_view model{};  // name of one of the product's models (model.hpp); empty: its default
  drive::MotorData motor{};
  SerialSettings serial{};
  EthercatSettings ethercat{};
  dictionary::Medium* store = nullptr;       // non-volatile memory; nullptr: nothing is saved
  std::span<const std::byte> description{};  // the EDS text, for products that carry it (1021h)
};

// A fault that a device remembers with how it was then. For devices whose manual describes such a memory but prints no
// objects of it.
struct PastFault {
  const drive::FaultRow* fault = nullptr;
  float dc_link_v = 0.0F;
  float velocity_rpm = 0.0F;
  float current_a = 0.0F;      // torque-producing, amplitude
  float temperature_c = 0.0F;  // of the motor
  std::int8_t mode = 0;        // 6060h
  bool power_stage_on = false;
};

// The life of a device: `power_on`; then, for every base tick, the board calls `drive().tick(feedback, actuation)` and,
// when that completed a position-loop cycle (Drive::tick returns true), `cycle(now)`. `poll` is due at `next_deadline`.
// A device stands on one fieldbus. CAN: frames arrive through `receive`, in time order with the ticks, and those to
// send are fetched with `take`. EtherCAT: frames pass the controller (ethercat::Segment), and `poll` is due after each
// that the slave wants to hear of. The RS485 port, for devices that have one, is handed its characters in the same
// order of time.
class Device {
 public:
  virtual void power_on(const drive::Feedback& feedback,
                        Time now) = 0;  // from the non-volatile values; also a power cycle
  virtual void power_off() = 0;

  virtual void cycle(Time now) = 0;
  virtual void poll(Time now) = 0;
  virtual Time next_deadline() = 0;

  // CAN. nullptr: the device is not on it, and has neither node-ID nor bit rate (0).
  virtual canopen::Node* can_node() { return nullptr; }
  virtual std::uint8_t node_id() const { return 0; }
  virtual std::uint32_t bit_rate() const { return 0; }  // in force now, bit/s
  virtual void receive(const canopen::Frame&, Time /*now*/) {}
  virtual bool take(canopen::Frame&) { return false; }
  // For a controller that can take a frame back until the wire has begun with it (canopen::Node::next_frame).
  virtual const canopen::WaitingFrame* next_frame() { return nullptr; }
  virtual void frame_sent(const canopen::Frame&) {}

  // EtherCAT. nullptr: the device is not on it.
  virtual ethercat::Slave* ethercat_slave() { return nullptr; }
  virtual ethercat::Esc* ethercat_controller() { return nullptr; }

  // nullptr: the device has no RS485 port.
  virtual SerialPort* serial_port() { return nullptr; }

  virtual drive::Drive& drive() = 0;
  // All objects, as the service port and the bench see them, and those that the fieldbus sees.
  virtual dictionary::Dictionary& dictionary() = 0;
  virtual dictionary::Dictionary& bus_dictionary() = 0;

  // As the manual has them, or the standard of the bus; none where neither says anything.
  virtual Lamps lamps(Time /*now*/) { return {}; }

  // The fault before the `n` last ones, 0 is the last; nullptr: so many are not remembered.
  virtual const PastFault* past_fault(std::size_t /*n*/) const { return nullptr; }

 protected:
  ~Device() = default;
};

}  // namespace servodrome::products
