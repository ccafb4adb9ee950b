#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <string>

#include "links/link.hpp"
#include "links/serial/line.hpp"
#include "links/serial/link_name.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::links {

// A connection of outside programs to a serial line, or to the Modbus units of a line. The destructor closes it. The
// objects that it was opened with must outlive it.
class SerialLink {
 public:
  virtual ~SerialLink() = default;
  // The name with which clients open the link. A port number of 0 is replaced by the actual one.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // Returns true if everything that clients have written is on the line or answered, or if there is no room for more.
  virtual bool settled() { return true; }
  // Ends the connections of all clients soon after the call.
  virtual void end_connections() {}
};

// Opens the link with this name, served by `io`. `pty:` and `serial:` are another station on `line`. `tcp:` answers for
// `units` immediately; in real time Units::find() lets the line catch up first. Throws LinkError, also for `mem:`,
// which needs no link: attach a station to the line.
std::unique_ptr<SerialLink> open_serial_link(const SerialLinkName& name, SerialLine& line, modbus::Units& units,
                                             boost::asio::io_context& io, LineHost& host);

}  // namespace servodrome::links
