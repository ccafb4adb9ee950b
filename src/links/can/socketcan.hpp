#pragma once

#include <string>

#include "canopen/frame.hpp"
#include "links/file_descriptor.hpp"

struct can_frame;

namespace servodrome::links {

// A raw CAN socket (Linux SocketCAN) bound to an interface: nonblocking, classical frames, own frames not received.
// Throws LinkError.
FileDescriptor open_socketcan(const std::string& interface_name);

// False for what is no frame of the bus (error messages of the driver).
bool from_socketcan(const can_frame& wire, canopen::Frame& frame);
can_frame to_socketcan(const canopen::Frame& frame);

}  // namespace servodrome::links
