#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <string>

#include "links/link.hpp"
#include "links/serial/line.hpp"
#include "links/serial/link_name.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::links {

// A door to a serial line, or to the Modbus units of a line. Closes on destruction; what it was opened with must
// outlive it.
class SerialLink {
 public:
  virtual ~SerialLink() = default;
  // The name under which clients find it; a port number 0 is replaced by the one the system chose.
  virtual std::string name() const = 0;
  virtual const LinkCounters& counters() const = 0;
  // What clients have written is on the line or answered, as far as there is room.
  virtual bool settled() { return true; }
};

// Opens the link a name asks for, served by `io`: `pty:` and `serial:` are one more station on `line`, `tcp:` answers
// for `units` in no time. In real time Units::find() is where a line catches up with the moment a request came. Throws
// LinkError. `mem:` has nothing to open: attach a station to the line; asking for it here is an error.
std::unique_ptr<SerialLink> open_serial_link(const SerialLinkName& name, SerialLine& line, modbus::Units& units,
                                             boost::asio::io_context& io, LineHost& host);

}  // namespace servodrome::links
