#pragma once

#include <cstdint>
#include <string>

#include "links/time.hpp"

// What the links of all buses have in common.
namespace servodrome::links {

// What a link needs of the line it belongs to; all calls come from the line's thread.
class LineHost {
 public:
  virtual ~LineHost() = default;
  // The line's time at this instant: when a frame that has just been read came in.
  virtual Time now() = 0;
  // The same, and a frame finds its bus as it is then. For a bus whose frames are answered as they are read.
  virtual Time frame_time() { return now(); }
  // After such a frame: one that comes at `time` or later may find something else than now.
  virtual void expect(Time /*time*/) {}
  // Tells the operator of the line that a link was lost, or is back.
  virtual void report(const std::string& /*message*/) {}
  // Something was queued on the bus: its next_event() may be earlier than it was.
  virtual void wake() = 0;
  // Wall-clock time (since 1970) of the line's time 0, for the timestamps a link hands out.
  virtual Time epoch() const { return Time{}; }
};

// Frames of a CAN bus or an EtherCAT segment, characters of a serial line, requests and responses of Modbus TCP.
struct LinkCounters {
  std::uint64_t to_bus = 0;     // outside programs put on the bus
  std::uint64_t from_bus = 0;   // handed to outside programs
  std::uint64_t dropped = 0;    // lost because a reader was too slow
  std::uint64_t refused = 0;    // the bus did not take (queue full, bus-off)
  std::uint64_t malformed = 0;  // commands that could not be read
  std::uint32_t clients = 0;    // connected now
};

}  // namespace servodrome::links
