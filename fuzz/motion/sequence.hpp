#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

// A sequence: what stands on the line, and what a master and a bench do to it at which tick. A plain value: it is drawn
// from a seed, written to and read from a text, taken apart by shrinking, and carried out by a Machine.
namespace servodrome::motion {

inline constexpr std::int64_t ticks_per_ms = 16;

enum class Kind : std::uint8_t {
  // A master's doings
  write,       // object := value
  write_here,  // object := 6064h as it is then + value
  enable,      // 06h, 07h, 0Fh, each once 6041h asks for it
  stream,      // object grows by `value` with each cycle, `count` cycles long, every `gap`th of them left out
  nmt,         // command `value`
  al,          // EtherCAT state `value` is asked for
  heartbeat,   // of the master, node 127, every `value` ms; 0: none
  cycle,       // SYNC or process data: 1 they come, 0 they stop, 2 they pause for `count` cycles
  // A bench's
  input,    // wire `count`: level `value`, 2: back to the geometry
  supply,   // per mille of the rated voltage
  load,     // external torque, per mille of the rated one
  inertia,  // per cent of the load's
  lock,     // the rotor: 1 held, 0 free
  inject,   // plant::Injection `count` on or off
  power,    // of the drive's electronics: 0 off, 1 on
  cut,      // the bus at the drive: 1 cut, 0 whole
  kinds_end
};
inline constexpr std::size_t kinds = static_cast<std::size_t>(Kind::kinds_end);
const char* name_of(Kind kind);
constexpr bool is_masters(Kind kind) { return kind <= Kind::cycle; }

// How a write goes.
enum class Via : std::uint8_t {
  sdo,     // in an SDO frame, or a mailbox
  pdo,     // in process data where the object is mapped, else as `sdo`
  direct,  // put into the dictionary as the bench API does, without a frame
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
  std::int64_t travel_counts = 0;  // limit switches stand so far to both sides of 0; 0: none
  std::int64_t stop_counts = 0;    // hard stops stand so far to both sides of 0; 0: none

  friend bool operator==(const AxisSetup&, const AxisSetup&) = default;
};

struct Sequence {
  std::vector<AxisSetup> axes;
  std::int64_t cycle_us = 1000;  // of SYNC or process data
  bool sync = false;             // CAN: SYNC is sent with each cycle; EtherCAT: SYNC0 runs
  bool mapped = true;            // the master maps PDOs of its own; false: the factory's
  std::vector<Event> events;     // in order of time
  std::int64_t end_tick = 0;

  friend bool operator==(const Sequence&, const Sequence&) = default;
};

// Times in ms, exact: a tick is 0.0625 ms.
std::string to_text(const Sequence& sequence);
std::string to_text(const Event& event);

struct ParsedSequence {
  Sequence sequence;
  std::string error;  // empty: none; else "LINE: what is wrong with it"
};
ParsedSequence parse_sequence(std::string_view text);

}  // namespace servodrome::motion
