#pragma once

#include <string>

namespace servodrome::app {

// Writes the file atomically: if the disk is full, the old content remains. A device or a pipe is written directly. A
// symbolic link is followed. Throws Failure.
void write_whole_file(const std::string& path, const std::string& text);

// Writes the file completely, then renames it; only the user can read it. Throws Failure.
void write_private_file(const std::string& path, const std::string& text);

// Reads a text file of at most 8 MiB that the user named; "-" is standard input if permitted. Throws Failure that
// begins with `what`, e.g. "run: FILE", for a folder and for a file that cannot be read, is too long or is no text.
std::string read_text_file(const std::string& path, const std::string& what, bool may_be_standard_input = false);

// may_write: returns true if the file may be written. may_create_in: returns true if a file may be created in the
// folder.
bool may_write(const std::string& file);
bool may_create_in(const std::string& folder);

// Throws Failure if the file cannot be written now. For files that are written at the end of a long operation.
void require_writable(const std::string& path);

}  // namespace servodrome::app
