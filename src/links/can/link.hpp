#pragma once

#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "links/can/bus.hpp"
#include "links/can/link_name.hpp"

namespace servodrome::links {

// What a link needs of the line it belongs to; all calls come from the line's thread.
class LineHost {
 public:
  virtual ~LineHost() = default;
  // The line's time at this instant: when a frame that has just been read came in.
  virtual Time now() = 0;
  // A frame was queued on the bus: its next_event() may be earlier than it was.
  virtual void wake() = 0;
  // Wall-clock time (since 1970) of the line's time 0, for the timestamps a link hands out.
  virtual Time epoch() const { return Time{}; }
};

struct LinkCounters {
  std::uint64_t to_bus = 0;     // frames outside programs put on the bus
  std::uint64_t from_bus = 0;   // frames handed to outside programs
  std::uint64_t dropped = 0;    // frames lost because a reader was too slow
  std::uint64_t refused = 0;    // frames the bus did not take (queue full, bus-off)
  std::uint64_t malformed = 0;  // commands that could not be read
  std::uint32_t clients = 0;    // connected now
};

// A door to the bus: one port, and what is behind it. Closes on destruction; the bus and the io_context must outlive
// it.
class CanLink {
 public:
  virtual ~CanLink() = default;
  virtual PortId port() const = 0;
  // The name under which clients find it; a port number 0 is replaced by the one the system chose.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
};

// Opens the link a name asks for, as a port on `bus`, served by `io`. Throws LinkError. `mem:` has nothing to open: use
// MemoryPort; asking for it here is an error.
std::unique_ptr<CanLink> open_can_link(const CanLinkName& name, CanBus& bus, boost::asio::io_context& io,
                                       LineHost& host);

// What outside programs may have waiting to be sent on the bus. When the queue is full a link stops reading as long as
// the controller is error active, so that a burst is slowed down and not lost; otherwise it discards, as a controller
// nobody hears does.
inline constexpr std::size_t link_queue_depth = 256;

}  // namespace servodrome::links
