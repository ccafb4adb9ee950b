#pragma once

#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <memory>
#include <string>

#include "links/can/bus.hpp"
#include "links/can/link_name.hpp"
#include "links/link.hpp"

namespace servodrome::links {

// A door to the bus: one port, and what is behind it. Closes on destruction; the bus and the io_context must outlive
// it.
class CanLink {
 public:
  virtual ~CanLink() = default;
  virtual PortId port() const = 0;
  // The name under which clients find it; a port number 0 is replaced by the one the system chose.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // What clients have written is on the bus or queued for it, as far as there is room, and they are being shown frames.
  virtual bool settled() { return true; }
};

// Opens the link a name asks for, as a port on `bus`, served by `io`. Throws LinkError. `mem:` has nothing to open: use
// MemoryPort; asking for it here is an error.
std::unique_ptr<CanLink> open_can_link(const CanLinkName& name, CanBus& bus, boost::asio::io_context& io,
                                       LineHost& host);

// What outside programs may have waiting to be sent on the bus. When the queue is full a link stops reading as long as
// the controller is error active, so that a burst is slowed down and not lost; otherwise it discards, as a controller
// does that gets no acknowledge.
inline constexpr std::size_t link_queue_depth = 256;

}  // namespace servodrome::links
