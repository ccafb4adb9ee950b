#pragma once

#include <string>
#include <vector>

#include "line/config.hpp"

namespace servodrome::app {

// Loads the line of a file, or the built-in line for an empty name. Throws Failure with all errors in the file.
line::LineSettings load_line(const std::string& file);

// Device description files from which drives are created.
struct DescriptionFiles {
  std::vector<std::string> data_sheets;  // EDS and DCF files: drives on CAN
  std::vector<std::string> slaves;       // ESI files: drives on EtherCAT
  std::string device;                    // name of one device in an ESI file that has several

  bool empty() const { return data_sheets.empty() && slaves.empty(); }
};

// A line with one axis for each description, with a travel of 20 revolutions and with limit and home switches. Throws
// Failure if a description cannot be used.
line::LineSettings line_of_descriptions(const DescriptionFiles& descriptions);

}  // namespace servodrome::app
