#pragma once

#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <memory>
#include <string>

#include "links/can/bus.hpp"
#include "links/can/link_name.hpp"
#include "links/link.hpp"

namespace servodrome::links {

// A connection of outside programs to the bus, as one port. The destructor closes it. The bus and the io_context must
// outlive it.
class CanLink {
 public:
  virtual ~CanLink() = default;
  virtual PortId port() const = 0;
  // The name with which clients open the link. A port number of 0 is replaced by the actual one.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // Returns true if all frames that clients have written are on the bus or in its queue, or the queue is full, and if
  // frames can reach the clients.
  virtual bool settled() { return true; }
};

// Opens the link with this name as a port on `bus`, served by `io`. Throws LinkError, also for `mem:`, which needs no
// link: use MemoryPort.
std::unique_ptr<CanLink> open_can_link(const CanLinkName& name, CanBus& bus, boost::asio::io_context& io,
                                       LineHost& host);

// Maximum number of frames of outside programs that wait to be sent on the bus. When the queue is full and the
// controller is error active, a link stops reading (backpressure), so that a burst is slowed down and not lost.
// Otherwise it discards frames, like a controller that gets no acknowledge.
inline constexpr std::size_t link_queue_depth = 256;

}  // namespace servodrome::links
