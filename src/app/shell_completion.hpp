#pragma once

#include "app/command_tree.hpp"

// Shell scripts that complete commands, options and those values that are words.
namespace servodrome::app {

std::string bash_completion(const CommandNode& root);
std::string zsh_completion(const CommandNode& root);
std::string fish_completion(const CommandNode& root);

}  // namespace servodrome::app
