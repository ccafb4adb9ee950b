#pragma once

#include <cstdio>
#include <string>

namespace servodrome::links {

// Opens a capture file for writing; nullptr, with errno set, if that fails. "/dev/stdout" is standard output on every
// system.
std::FILE* open_log_file(const std::string& path);

inline constexpr std::size_t log_buffer_bytes = 64 * 1024;  // of such a file

}  // namespace servodrome::links
