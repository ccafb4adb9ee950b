#pragma once

#include <cstdint>
#include <string>

#include "links/time.hpp"

// The common part of the links of all buses.
namespace servodrome::links {

// The interface of a line for its links. All calls come from the line's thread.
class LineHost {
 public:
  virtual ~LineHost() = default;
  // The line's time now, which is the arrival time of a frame that has just been read.
  virtual Time now() = 0;
  // The same; also lets the line catch up to that time if necessary. For a bus that answers frames when they are read.
  virtual Time frame_time() { return now(); }
  // Reports to the line's operator that a link was lost or is back.
  virtual void report(const std::string& /*message*/) {}
  // Something was queued on the bus, so its next_event() may be earlier than before.
  virtual void wake() = 0;
  // The wall-clock time (since 1970) of the line's time 0, for the timestamps of a link.
  virtual Time epoch() const { return Time{}; }
};

// Counts frames of a CAN bus or an EtherCAT segment, characters of a serial line, or messages of Modbus TCP.
struct LinkCounters {
  std::uint64_t to_bus = 0;     // from outside programs to the bus
  std::uint64_t from_bus = 0;   // from the bus to outside programs
  std::uint64_t dropped = 0;    // lost, for example because a reader was too slow
  std::uint64_t refused = 0;    // not accepted by the bus (queue full, bus-off)
  std::uint64_t malformed = 0;  // invalid commands, frames or messages
  std::uint32_t clients = 0;    // connected now
};

}  // namespace servodrome::links
