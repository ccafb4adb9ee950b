#pragma once

#include <array>

#include "catalogue/parameter_rules.hpp"
#include "dictionary/store.hpp"

namespace servodrome::catalogue::cia402 {

// CiA 301 7.5.2.13: all parameters.
inline constexpr std::array store{StoreCommand{{0x1010, 1}, dictionary::save_signature}};

}  // namespace servodrome::catalogue::cia402
