#pragma once

#include <string>

namespace servodrome::app {

// As a whole or not at all: what was there before outlives a full disk. What is no ordinary file (a device, a pipe) is
// written to, and behind a symbolic link the file it leads to. Throws Failure.
void write_whole_file(const std::string& path, const std::string& text);

// The text of a file that was given by hand, of at most 8 MiB. "-", where that stands for it: standard input. Throws
// Failure about `what`, "run: FILE" say, for what is a folder, cannot be read, is longer or is no text.
std::string read_text_file(const std::string& path, const std::string& what, bool may_be_standard_input = false);

// For files that are written at the end of something long: throws Failure if one could not be put there now.
void require_writable(const std::string& path);

}  // namespace servodrome::app
