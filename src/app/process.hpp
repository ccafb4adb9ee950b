#pragma once

#include <filesystem>
#include <vector>

// The program as a process of its system.
namespace servodrome::app {

// Must be called once, before the program does anything else.
void begin_process();

// Returns the path of the program's file; empty if the system does not provide it.
std::filesystem::path program_file();

// The signals that end a server orderly: Ctrl-C, SIGTERM, and the loss of the terminal, unless nohup has disabled it.
std::vector<int> ending_signals();

// From now on a write fails if the reader of the output has ended; the process is not killed.
void ignore_broken_pipes();

}  // namespace servodrome::app
