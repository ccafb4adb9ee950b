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

// A drive as it leaves the factory: dictionary, servo drive and bus stacks of one product, wired together. This is the
// interface for a simulated line or for the board support of a microcontroller.
namespace servodrome::products {

using Time = std::chrono::nanoseconds;  // since the start of the line; never the wall clock

// Settings of a drive's RS485 port. A member that is not set means the product's factory value.
struct SerialSettings {
  std::uint8_t station = 0;  // 0: the product's
  std::optional<modbus::CharacterFormat> format;
  std::optional<SerialProtocol> protocol;
  // The least silence that ends a Modbus frame; shorter pauses within a frame are ignored. For masters whose pauses
  // depend on an operating system. 0: the silence of the protocol.
  Time silence{};
};

// Settings of one EtherCAT slave.
struct EthercatSettings {
  std::uint16_t station_alias = 0;                  // configured station alias in its SII; 0: none
  std::int32_t oscillator_ppb = 0;                  // error of its oscillator, parts per billion
  std::optional<std::uint16_t> sync_error_limit{};  // 10F1h:02 at power-on; else the factory's
};

// Settings that a real drive gets from its switches, its PC tool or its nameplate.
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

// A fault in the history of a device, with the state of the drive at that time. For devices whose manual describes such
// a history but prints no objects for it.
struct PastFault {
  const drive::FaultRow* fault = nullptr;
  float dc_link_v = 0.0F;
  float velocity_rpm = 0.0F;
  float current_a = 0.0F;      // torque-producing, amplitude
  float temperature_c = 0.0F;  // of the motor
  std::int8_t mode = 0;        // 6060h
  bool power_stage_on = false;
};

// How to use a device: call `power_on`; then, for every base tick, call `drive().tick(feedback, actuation)` and, when
// that completed a position-loop cycle (Drive::tick returns true), `cycle(now)`. Call `poll` at `next_deadline`. A
// device is on one fieldbus. CAN: `receive` gets the frames that arrive, in time order with the ticks; `take` returns
// the frames to send. EtherCAT: frames pass the controller (ethercat::Segment); also call `poll` after each frame for
// which the slave requests it. An RS485 port receives its characters in the same time order.
class Device {
 public:
  virtual void power_on(const drive::Feedback& feedback,
                        Time now) = 0;  // loads the non-volatile values; also for a power cycle
  virtual void power_off() = 0;

  virtual void cycle(Time now) = 0;
  virtual void poll(Time now) = 0;
  virtual Time next_deadline() = 0;

  // CAN. nullptr: the device is not on CAN; node-ID and bit rate are 0 then.
  virtual canopen::Node* can_node() { return nullptr; }
  virtual std::uint8_t node_id() const { return 0; }
  virtual std::uint32_t bit_rate() const { return 0; }  // in force now, bit/s
  virtual void receive(const canopen::Frame&, Time /*now*/) {}
  virtual bool take(canopen::Frame&) { return false; }
  // For a CAN controller that can withdraw a frame until its transmission begins (canopen::Node::next_frame).
  virtual const canopen::WaitingFrame* next_frame() { return nullptr; }
  virtual void frame_sent(const canopen::Frame&) {}

  // EtherCAT. nullptr: the device is not on EtherCAT.
  virtual ethercat::Slave* ethercat_slave() { return nullptr; }
  virtual ethercat::Esc* ethercat_controller() { return nullptr; }

  // nullptr: the device has no RS485 port.
  virtual SerialPort* serial_port() { return nullptr; }

  virtual drive::Drive& drive() = 0;
  // All objects, for the service port and the bench, and the objects that the fieldbus can access.
  virtual dictionary::Dictionary& dictionary() = 0;
  virtual dictionary::Dictionary& bus_dictionary() = 0;

  // The lamps according to the manual or the bus standard; none if neither describes lamps.
  virtual Lamps lamps(Time /*now*/) { return {}; }

  // The `n`th newest fault of the history; 0 is the newest. nullptr: the history has fewer faults.
  virtual const PastFault* past_fault(std::size_t /*n*/) const { return nullptr; }

 protected:
  ~Device() = default;
};

}  // namespace servodrome::products
