#pragma once

#include <string>
#include <vector>

#include "line/config.hpp"

namespace servodrome::app {

// The line of a file, or the built-in one for an empty name. Throws Failure with all that is wrong with it.
line::LineSettings load_line(const std::string& file);

// Makers' descriptions that drives are made of.
struct DescriptionFiles {
  std::vector<std::string> data_sheets;  // EDS and DCF files: drives on CAN
  std::vector<std::string> slaves;       // ESI files: drives on EtherCAT
  std::string device;                    // of an ESI file that has several

  bool empty() const { return data_sheets.empty() && slaves.empty(); }
};

// A line with one axis for each of these descriptions, on a travel of 20 revolutions with limit and home switches.
// Throws Failure likewise.
line::LineSettings line_of_descriptions(const DescriptionFiles& descriptions);

}  // namespace servodrome::app
