#pragma once

#include <algorithm>
#include <array>

#include "catalogue/status_words.hpp"

// The rows of CiA 402-2, in parts that products combine.
namespace servodrome::catalogue::cia402 {

// CiA 402-2 table 27.
inline constexpr std::array state_bits{
    StatusWord{0, "ready to switch on"}, StatusWord{1, "switched on"},
    StatusWord{2, "operation enabled"},  StatusWord{3, "fault"},
    StatusWord{4, "voltage enabled"},    StatusWord{5, "no quick stop"},
    StatusWord{6, "switch on disabled"}, StatusWord{7, "warning"},
};
inline constexpr std::array remote{StatusWord{9, "remote"}};
inline constexpr std::array common{StatusWord{10, "target reached"}, StatusWord{11, "internal limit active"}};
inline constexpr std::array cyclic{StatusWord{12, "drive follows the command value", 8},
                                   StatusWord{12, "drive follows the command value", 9},
                                   StatusWord{12, "drive follows the command value", 10}};
inline constexpr std::array homing{StatusWord{12, "homing attained", 6}, StatusWord{13, "homing error", 6}};
inline constexpr std::array profiles{StatusWord{12, "set-point acknowledge", 1}, StatusWord{12, "speed is zero", 3},
                                     StatusWord{12, "interpolation active", 7},  StatusWord{13, "following error", 1},
                                     StatusWord{13, "max slippage error", 3},    StatusWord{13, "following error", 8}};

template <typename Row, std::size_t... Sizes>
constexpr auto joined(const std::array<Row, Sizes>&... parts) {
  std::array<Row, (Sizes + ...)> all{};
  auto* end = all.data();
  ((end = std::copy(parts.begin(), parts.end(), end)), ...);
  return all;
}

inline constexpr auto status_words = joined(state_bits, remote, common, cyclic, homing, profiles);

// CiA 402-2, object 6060h.
inline constexpr std::array mode_names{
    ModeName{0, "no mode"},
    ModeName{1, "profile position"},
    ModeName{2, "velocity"},
    ModeName{3, "profile velocity"},
    ModeName{4, "profile torque"},
    ModeName{6, "homing"},
    ModeName{7, "interpolated position"},
    ModeName{8, "cyclic synchronous position"},
    ModeName{9, "cyclic synchronous velocity"},
    ModeName{10, "cyclic synchronous torque"},
};

}  // namespace servodrome::catalogue::cia402
