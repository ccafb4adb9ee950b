#pragma once

#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// The bytes of a serial port, or of a pty that programs open one after the other. The functions and the callbacks run
// in the thread of the io_context and never block. On Linux a second thread reads, because poll() and read() of a tty
// wait until a worker of the kernel has moved its bytes, on a busy machine for milliseconds.
class SerialStream {
 public:
  class Owner {
   public:
    // A program has opened the other end.
    virtual void on_open() = 0;
    // The answer to read(): at least one byte, at most as many as it asked for.
    virtual void on_bytes(std::string_view bytes) = 0;
    // The system has accepted all bytes of earlier calls of write().
    virtual void on_written() {}
    // The port is lost; or the program has closed the other end, and everything that it has written is read. A pending
    // read() gets no answer. Bytes that the program has not read are discarded. The stream notices the closing some
    // milliseconds late on a busy machine. If another program opens the pty before that, it continues the session of
    // the former program: the kernel reports no difference.
    virtual void on_close() = 0;

   protected:
    ~Owner() = default;
  };

  static constexpr std::size_t most_at_once = 1024;

  virtual ~SerialStream() = default;
  virtual bool is_open() const = 0;
  // Reads up to `most` (1 to most_at_once) bytes as soon as there are any. Only while the stream is open and no read()
  // is pending.
  virtual void read(std::size_t most) = 0;
  // Discards the bytes if the stream is not open. There is no limit: the owner checks unwritten() before.
  virtual void write(std::string_view bytes) = 0;
  virtual std::size_t unwritten() const = 0;
  // Returns true if no program waits for on_open() and there are no bytes for a pending read(). Bytes whose on_bytes()
  // is queued in the io_context do not count.
  virtual bool settled() = 0;
};

// The stream of a serial port. It is open from the beginning until the port is lost (unplugged).
std::unique_ptr<SerialStream> open_tty_stream(FileDescriptor tty, boost::asio::io_context& io,
                                              SerialStream::Owner& owner);

// The serial port of a simulated adapter, to which programs connect: a new pty at `path`, or on Windows the existing
// port `path`, whose other end is the program's (a pair of virtual ports, or a cable). Windows does not show whether a
// program has the other end open, so there the stream is open from the beginning. Throws LinkError.
std::unique_ptr<SerialStream> open_adapter_stream(const std::string& path, boost::asio::io_context& io,
                                                  SerialStream::Owner& owner);

}  // namespace servodrome::links
