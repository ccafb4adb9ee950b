#include "describe/status_words.hpp"

#include <algorithm>

namespace servodrome::describe {
namespace {

// ---- Rows that products share

// CiA 402-2 table 27.
constexpr std::array state_bits{
    StatusWord{0, "ready to switch on"}, StatusWord{1, "switched on"},
    StatusWord{2, "operation enabled"},  StatusWord{3, "fault"},
    StatusWord{4, "voltage enabled"},    StatusWord{5, "no quick stop"},
    StatusWord{6, "switch on disabled"}, StatusWord{7, "warning"},
};
constexpr std::array remote{StatusWord{9, "remote"}};
constexpr std::array common{StatusWord{10, "target reached"}, StatusWord{11, "internal limit active"}};
constexpr std::array cyclic{StatusWord{12, "drive follows the command value", 8},
                            StatusWord{12, "drive follows the command value", 9},
                            StatusWord{12, "drive follows the command value", 10}};
constexpr std::array homing{StatusWord{12, "homing attained", 6}, StatusWord{13, "homing error", 6}};
constexpr std::array profiles{StatusWord{12, "set-point acknowledge", 1}, StatusWord{12, "speed is zero", 3},
                              StatusWord{12, "interpolation active", 7},  StatusWord{13, "following error", 1},
                              StatusWord{13, "max slippage error", 3},    StatusWord{13, "following error", 8}};

template <std::size_t... Sizes>
constexpr auto joined(const std::array<StatusWord, Sizes>&... parts) {
  std::array<StatusWord, (Sizes + ...)> all{};
  auto* end = all.data();
  ((end = std::copy(parts.begin(), parts.end(), end)), ...);
  return all;
}

// ---- The products

constexpr auto cia402 = joined(state_bits, remote, common, cyclic, homing, profiles);

// ProNet manual, ch. 6.2.2: bits 8 and 9 are not used.
constexpr auto pronet = joined(state_bits, common, cyclic, homing, profiles);

// iSMK manual, Table 5-5.
constexpr auto ismk = joined(state_bits, std::array{StatusWord{10, "", 6}}, remote, common, cyclic,
                             std::array{StatusWord{12, "homing error", 6}, StatusWord{12, "set-point acknowledge", 1},
                                        StatusWord{12, "speed is zero", 3}, StatusWord{12, "speed is zero", -3},
                                        StatusWord{12, "interpolation active", 7}, StatusWord{13, "following error"},
                                        StatusWord{14, "commutation found"}, StatusWord{15, "home found"}});

// JMC manual, Tables 156, 222, 239, 250 and 264, and Chart 273.
constexpr auto jmc_ec =
    joined(state_bits, cyclic, homing,
           std::array{StatusWord{8, "halt", 3}, StatusWord{9, "remote"}, StatusWord{10, "target reached"},
                      StatusWord{11, "software limit active", 1}, StatusWord{11, "software limit active", 8},
                      StatusWord{12, "set-point acknowledge", 1}, StatusWord{12, "command is being executed", 3},
                      StatusWord{13, "following error", 1}, StatusWord{13, "following error", 3},
                      StatusWord{13, "following error", 8}, StatusWord{13, "following error", 9}});

struct ProductWords {
  std::string_view product;
  std::span<const StatusWord> words;
};
constexpr std::array products{ProductWords{"pronet", pronet}, ProductWords{"ismk", ismk}, ProductWords{"ismk-ea", ismk},
                              ProductWords{"jmc_ec", jmc_ec}};

// CiA 402-2, object 6060h.
constexpr std::array cia402_modes{
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
// iSMK manual, object 6060h.
constexpr auto ismk_modes = [] {
  std::array<ModeName, cia402_modes.size() + 2> all{ModeName{-4, "pulse"}, ModeName{-3, "immediate velocity"}};
  std::copy(cia402_modes.begin(), cia402_modes.end(), all.begin() + 2);
  return all;
}();

}  // namespace

std::span<const StatusWord> status_words(std::string_view product) {
  const auto* const found =
      std::find_if(products.begin(), products.end(), [product](const auto& row) { return row.product == product; });
  return found != products.end() ? found->words : std::span<const StatusWord>(cia402);
}

std::string_view status_bit_name(std::string_view product, unsigned bit, std::int8_t mode) {
  for (const StatusWord& row : status_words(product)) {
    if (row.bit == bit && (row.mode == mode || row.mode == every_mode)) return row.name;
  }
  return {};
}

std::span<const ModeName> mode_names(std::string_view product) {
  if (product.starts_with("ismk")) return ismk_modes;
  return cia402_modes;
}

std::string_view mode_name(std::string_view product, std::int8_t mode) {
  for (const ModeName& row : mode_names(product)) {
    if (row.mode == mode) return row.name;
  }
  return mode < 0 ? "manufacturer-specific mode" : "reserved mode";
}

}  // namespace servodrome::describe
