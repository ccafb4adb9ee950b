#pragma once

#include <CLI/CLI.hpp>

// Commands that print information about the other commands; they use no bus.
namespace servodrome::app {

void add_completion(CLI::App& app);
void add_manual(CLI::App& app);

}  // namespace servodrome::app
