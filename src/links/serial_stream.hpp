#pragma once

#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/serial_port.hpp>
#include <type_traits>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A serial port or a pty, served by Asio.
#ifdef _WIN32
using SerialStream = boost::asio::serial_port;
#else
using SerialStream = boost::asio::posix::stream_descriptor;
#endif

// Asio uses edge-triggered epoll, which can miss that a pty has become readable, because the kernel moves the bytes
// through a work queue.
inline constexpr bool stream_may_miss_input = !std::is_same_v<SerialStream, boost::asio::serial_port>;

// The stream takes ownership of `descriptor`.
inline SerialStream serial_stream(boost::asio::io_context& io, Descriptor descriptor) {
  return {io, reinterpret_cast<SerialStream::native_handle_type>(descriptor)};
}
inline Descriptor descriptor_of(SerialStream& stream) { return reinterpret_cast<Descriptor>(stream.native_handle()); }

}  // namespace servodrome::links
