#pragma once

#include "app/command_tree.hpp"

// Scripts with which shells complete the commands, their options and the values that are words.
namespace servodrome::app {

std::string bash_completion(const CommandNode& root);
std::string zsh_completion(const CommandNode& root);
std::string fish_completion(const CommandNode& root);

}  // namespace servodrome::app
