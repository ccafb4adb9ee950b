#pragma once

#include <string>

#include "canopen/frame.hpp"
#include "links/file_descriptor.hpp"

struct can_frame;

namespace servodrome::links {

// Opens a raw CAN socket (Linux SocketCAN) on an interface: nonblocking, classical frames, own frames are not received.
// Throws LinkError.
FileDescriptor open_socketcan(const std::string& interface_name);

// Returns false if `wire` is no frame of the bus (an error message of the driver).
bool from_socketcan(const can_frame& wire, canopen::Frame& frame);
can_frame to_socketcan(const canopen::Frame& frame);

}  // namespace servodrome::links
