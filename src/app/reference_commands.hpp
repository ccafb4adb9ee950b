#pragma once

#include <CLI/CLI.hpp>

// The commands that print what the others are; they talk to no bus.
namespace servodrome::app {

void add_completion(CLI::App& app);
void add_manual(CLI::App& app);

}  // namespace servodrome::app
