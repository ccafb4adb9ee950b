#pragma once

#include <string>

#include "dictionary/abort_code.hpp"

// What a failed SDO access says to a person, on any bus.
namespace servodrome::host {

// "read refused: object does not exist (0602 0000h)", "no answer to the write"
std::string text_of_failed_access(bool upload, dictionary::AbortCode code, bool from_drive);
// What to do; nullptr for an access without answer, whose remedy is the bus's.
const char* remedy_of_failed_access(dictionary::AbortCode code, bool from_drive);
// The drive does not have the object.
bool is_absent(dictionary::AbortCode code);

}  // namespace servodrome::host
