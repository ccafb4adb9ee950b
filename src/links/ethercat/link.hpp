#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <string>

#include "links/descriptor_watch.hpp"
#include "links/ethercat/bus.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link.hpp"

namespace servodrome::links {

// A connection to the bus through which masters send frames and receive them back. Each frame passes the stations at
// the line's time when it is read. It is sent back immediately, unless a disturbance delays it; the stations do their
// work after that. The destructor closes the link. The bus and the io_context must outlive it.
class EthercatLink {
 public:
  virtual ~EthercatLink() = default;
  // The name with which masters open the link. A port number of 0 is replaced by the actual one.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // With `,busy` no event wakes the link: the line must call poll() continuously.
  virtual bool busy() const = 0;
  // Serves the frames that have come. Returns false if there were none.
  virtual bool poll() = 0;
  // For a line that calls poll(): checks for other events, such as the loss of an interface.
  virtual void check() {}
};

// Opens the link with this name. `io` serves udp:, `watch` serves raw:, and calls of poll() serve busy links. Throws
// LinkError, also for `mem:`, which needs no link: use MemoryEthercatClient.
std::unique_ptr<EthercatLink> open_ethercat_link(const EthercatLinkName& name, EthercatBus& bus,
                                                 boost::asio::io_context& io, DescriptorWatch& watch, LineHost& host);

}  // namespace servodrome::links
