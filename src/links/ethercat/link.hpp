#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <string>

#include "links/descriptor_watch.hpp"
#include "links/ethercat/bus.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link.hpp"

namespace servodrome::links {

// A door to the bus through which masters send frames and get them back. Each frame that is read passes the stations at
// the line's time of reading, and is sent back at once unless a disturbance delays it; what it left to do is done after
// that. Closes on destruction; the bus and the io_context must outlive it.
class EthercatLink {
 public:
  virtual ~EthercatLink() = default;
  // The name under which masters find it; a port number 0 is replaced by the one the system chose.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // `,busy`: nothing wakes the link when frames come, poll() is to be called without end.
  virtual bool busy() const = 0;
  // Serves the frames that are there; false: there were none.
  virtual bool poll() = 0;
  // For a caller that polls: sees to everything else, such as an interface that is gone.
  virtual void check() {}
};

// Opens the link a name asks for, served by `io` (udp:), `watch` (raw:) or, if busy, by polls. Throws LinkError.
// `mem:` has nothing to open: use MemoryEthercatClient; asking for it here is an error.
std::unique_ptr<EthercatLink> open_ethercat_link(const EthercatLinkName& name, EthercatBus& bus,
                                                 boost::asio::io_context& io, DescriptorWatch& watch, LineHost& host);

}  // namespace servodrome::links
