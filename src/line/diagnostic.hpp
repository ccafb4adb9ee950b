#pragma once

#include <cstdint>
#include <string>

namespace servodrome::line {

// An error or a warning about a line file: what is wrong, where, and how to correct it.
struct Diagnostic {
  std::string file;
  std::uint32_t line = 0;  // from 1; 0: the file as a whole
  std::uint32_t column = 0;
  std::string what;
  std::string hint;
};

// "FILE:LINE:COLUMN: what; hint", as compilers write it.
std::string to_string(const Diagnostic& diagnostic);

}  // namespace servodrome::line
