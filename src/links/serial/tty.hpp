#pragma once

#include <string>

#include "links/file_descriptor.hpp"
#include "modbus/character_format.hpp"

namespace servodrome::links {

// Opens a serial port, raw and nonblocking, sets the format and empties its buffers. Throws LinkError.
FileDescriptor open_tty(const std::string& device, const modbus::CharacterFormat& format);

}  // namespace servodrome::links
