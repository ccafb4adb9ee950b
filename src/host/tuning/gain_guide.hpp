#pragma once

#include <span>
#include <string_view>

#include "host/object_address.hpp"

// What a person turns to tune a drive: objects of its loops, in words. Names, units, ranges and defaults are the
// dictionary's.
namespace servodrome::host::tuning {

struct GainLine {
  ObjectAddress object;
  std::string_view set;   // "Gain set 1", "Filters": lines of one set stand together
  std::string_view does;  // what a greater number does
};

// By the product's name. Empty where the manual prints no gains (ISMC, ProNet), and for products that are not known.
std::span<const GainLine> gain_guide_of(std::string_view product);

}  // namespace servodrome::host::tuning
