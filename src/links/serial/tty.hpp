#pragma once

#include <string>

#include "links/file_descriptor.hpp"
#include "modbus/character_format.hpp"

namespace servodrome::links {

// Opens a serial port, raw and nonblocking, with the format set and nothing left in its buffers. Throws LinkError.
FileDescriptor open_tty(const std::string& device, const modbus::CharacterFormat& format);

}  // namespace servodrome::links
