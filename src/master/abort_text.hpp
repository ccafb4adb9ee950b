#pragma once

#include <string>

#include "dictionary/abort_code.hpp"

// Texts for an SDO access that failed, on any bus.
namespace servodrome::master {

// For example "read refused: object does not exist (0602 0000h)" or "no answer to the write". `upload`: true for a
// read. `from_drive`: true if the drive sent the abort code, false if the client aborted the transfer.
std::string text_of_failed_access(bool upload, dictionary::AbortCode code, bool from_drive);
// The remedy for the user. nullptr for a timeout: its remedy depends on the bus, so the caller provides it.
const char* remedy_of_failed_access(dictionary::AbortCode code, bool from_drive);
// True if the code means that the drive does not have the object or the sub-index.
bool is_absent(dictionary::AbortCode code);

}  // namespace servodrome::master
