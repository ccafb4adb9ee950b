#pragma once

#include <cstdio>
#include <string>

namespace servodrome::links {

// Opens a capture file for writing; nullptr, with errno set, if that fails. "/dev/stdout" is standard output on every
// system.
std::FILE* open_log_file(const std::string& path);

}  // namespace servodrome::links
