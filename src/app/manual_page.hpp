#pragma once

#include "app/command_tree.hpp"

namespace servodrome::app {

// The manual page servodrome(1), in the macros of man(7).
std::string manual_page(const CommandNode& root);

}  // namespace servodrome::app
