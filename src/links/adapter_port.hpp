#pragma once

#include <memory>
#include <string>

#include "links/serial_stream.hpp"

namespace servodrome::links {

// The serial port of a simulated adapter, to which a program connects: a new pty at `path`, or on Windows the existing
// port `path`, whose other end is the program's (a pair of virtual ports, or a cable). Windows does not show whether a
// program has the other end open, so there a client is always assumed until the port is lost.
class AdapterPort {
 public:
  // Throws LinkError.
  AdapterPort(const std::string& path, boost::asio::io_context& io);
  ~AdapterPort();
  AdapterPort(const AdapterPort&) = delete;
  AdapterPort& operator=(const AdapterPort&) = delete;

  SerialStream& stream() { return stream_; }
  // Returns true if a client has the port open or has left bytes to read.
  bool has_client() const;
  // Returns true if there are bytes of a client to read.
  bool has_input() const;
  // Prepares the port for the next client, after stream() has failed because the last one is gone.
  void reset();

 private:
  struct System;
  std::unique_ptr<System> system_;
  SerialStream stream_;
};

}  // namespace servodrome::links
