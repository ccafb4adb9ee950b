#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string_view>

#include "canopen/frame.hpp"
#include "dictionary/dictionary.hpp"
#include "drive/hardware.hpp"
#include "drive/loops/motor_data.hpp"

namespace servodrome::dictionary {
class Medium;
}
namespace servodrome::drive {
class Drive;
}
namespace servodrome::canopen {
class Node;
}

// A drive as it leaves the factory: dictionary, servo drive and bus stacks of one product, wired together. What a line
// or a microcontroller's board support sees of it.
namespace servodrome::products {

using Time = std::chrono::nanoseconds;  // since the start of the line; never the wall clock

// What the commissioning of a real drive would set by switches, PC tool or nameplate.
struct Settings {
  std::uint8_t node_id = 0;    // 0: the product's factory value
  std::uint32_t bit_rate = 0;  // bit/s; 0: the product's factory value
  std::uint32_t serial_number = 1;
  std::string_view model;  // name of one of the product's models (model.hpp); empty: its default
  drive::MotorData motor{};
  dictionary::Medium* store = nullptr;     // non-volatile memory; nullptr: nothing is saved
  std::span<const std::byte> description;  // the EDS text, for products that carry it (1021h)
};

// The life of a device: `power_on`; then, for every base tick, the board calls `drive().tick(feedback, actuation)` and,
// when that completed a position-loop cycle (Drive::tick returns true), `cycle(now)`. Frames arrive through `receive`,
// in time order with the ticks; `poll` is due at `next_deadline`. Frames to send are fetched with `take`.
class Device {
 public:
  virtual void power_on(const drive::Feedback& feedback,
                        Time now) = 0;  // from the non-volatile values; also a power cycle
  virtual void power_off() = 0;

  virtual void cycle(Time now) = 0;
  virtual void receive(const canopen::Frame& frame, Time now) = 0;
  virtual void poll(Time now) = 0;
  virtual Time next_deadline() const = 0;
  virtual bool take(canopen::Frame& frame) = 0;

  virtual drive::Drive& drive() = 0;
  virtual dictionary::Dictionary& dictionary() = 0;
  virtual canopen::Node& node() = 0;
  virtual std::uint8_t node_id() const = 0;
  virtual std::uint32_t bit_rate() const = 0;  // in force now, bit/s

 protected:
  ~Device() = default;
};

}  // namespace servodrome::products
