#pragma once

#include <algorithm>

#include "drive/homing/cia402_methods.hpp"

// The homing methods of the iSMK: those of Table 5-15 (1 to 4, 9 to 12, 19 to 22), 33, which every homing example uses,
// and the others of CiA 402-2, whose rows are missing in this project's edition of the manual. All of them follow the
// figures of CiA 402-2, because the drawings are missing too. Hard-stop methods are not printed and are refused with
// 0609 0030h.
namespace servodrome::products::ismk {

inline constexpr auto homing_methods = [] {
  constexpr auto is_standard = [](const drive::Method& method) { return method.number > 0; };
  constexpr std::size_t count =
      static_cast<std::size_t>(std::count_if(drive::cia402_methods.begin(), drive::cia402_methods.end(), is_standard));
  std::array<drive::Method, count> methods{};
  std::copy_if(drive::cia402_methods.begin(), drive::cia402_methods.end(), methods.begin(), is_standard);
  return methods;
}();
static_assert(drive::are_well_formed(homing_methods));

}  // namespace servodrome::products::ismk
