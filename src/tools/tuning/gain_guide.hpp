#pragma once

#include <span>
#include <string_view>

#include "master/object_address.hpp"

// Guide to manual tuning: the objects of a drive's loops, with an explanation. Names, units, ranges and defaults come
// from the dictionary.
namespace servodrome::master::tuning {

struct GainLine {
  ObjectAddress object;
  std::string_view set;   // "Gain set 1", "Filters": heading of a group of lines
  std::string_view does;  // effect of a greater number
};

// By the product's name. Empty if the manual has no gains (ISMC, ProNet), and for unknown products.
std::span<const GainLine> gain_guide_of(std::string_view product);

}  // namespace servodrome::master::tuning
