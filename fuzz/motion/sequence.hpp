#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

// A sequence: the axes of a line, and the actions of a master and a test bench with their ticks. It is a plain value:
// drawn from a seed, written to and read from text, reduced by shrinking, and carried out by a Machine.
namespace servodrome::motion {

inline constexpr std::int64_t ticks_per_ms = 16;

enum class Kind : std::uint8_t {
  // Actions of a master
  write,       // object := value
  write_here,  // object := present value of 6064h + value
  enable,      // controlwords 06h, 07h, 0Fh, each when the power state requires it
  stream,      // object grows by `value` in each of `count` cycles; every `gap`th value is not sent
  nmt,         // command `value`
  al,          // request of EtherCAT state `value`
  heartbeat,   // of the master, node 127, every `value` ms; 0: none
  cycle,       // SYNC or process data: 1 on, 0 off, 2 pause for `count` cycles
  // Actions of the test bench
  input,    // wire `count` is forced to level `value`; 2: the switches set it again
  supply,   // per mille of the rated voltage
  load,     // external torque, per mille of the rated torque
  inertia,  // per cent of the load's inertia
  lock,     // the rotor: 1 held, 0 free
  inject,   // plant::Injection `count` on or off
  power,    // of the drive's electronics: 0 off, 1 on
  cut,      // the bus cable at the drive: 1 cut, 0 connected
  kinds_end
};
inline constexpr std::size_t kinds = static_cast<std::size_t>(Kind::kinds_end);
const char* name_of(Kind kind);
constexpr bool is_masters(Kind kind) { return kind <= Kind::cycle; }

// The path of a write.
enum class Via : std::uint8_t {
  sdo,     // as an SDO, in a CAN frame or in the mailbox
  pdo,     // in process data if the object is mapped, otherwise as `sdo`
  direct,  // into the dictionary as the bench API does, without a frame
};

struct Event {
  std::int64_t tick = 0;
  Kind kind = Kind::write;
  std::uint8_t axis = 0;
  Via via = Via::sdo;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::int64_t value = 0;
  std::int64_t count = 0;
  std::int64_t gap = 0;

  friend bool operator==(const Event&, const Event&) = default;
};

struct AxisSetup {
  std::string product;
  std::string model;                   // empty: the product's default
  std::int64_t start_counts = 0;       // of the shaft
  std::int64_t inertia_percent = 100;  // of the default load
  std::int64_t friction_percent = 100;
  std::int64_t travel_counts = 0;  // distance of the limit switches from 0, on both sides; 0: no switches
  std::int64_t stop_counts = 0;    // distance of the hard stops from 0, on both sides; 0: none

  friend bool operator==(const AxisSetup&, const AxisSetup&) = default;
};

struct Sequence {
  std::vector<AxisSetup> axes;
  std::int64_t cycle_us = 1000;  // of SYNC or process data
  bool sync = false;             // CAN: SYNC is sent with each cycle; EtherCAT: SYNC0 runs
  bool mapped = true;            // the master maps its own PDOs; false: the factory mapping
  std::vector<Event> events;     // in order of time
  std::int64_t end_tick = 0;

  friend bool operator==(const Sequence&, const Sequence&) = default;
};

// Writes times in ms. They are exact, because a tick is 0.0625 ms.
std::string to_text(const Sequence& sequence);
std::string to_text(const Event& event);

struct ParsedSequence {
  Sequence sequence;
  std::string error;  // empty: none; otherwise "LINE: description"
};
ParsedSequence parse_sequence(std::string_view text);

}  // namespace servodrome::motion
