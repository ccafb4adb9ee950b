#include <array>

#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/cia402/store.hpp"
#include "catalogue/generic402/fault_texts.hpp"
#include "catalogue/generic402/gains.hpp"
#include "catalogue/generic402/object_texts.hpp"
#include "catalogue/generic402/terminals.hpp"
#include "catalogue/list.hpp"

namespace servodrome::catalogue::generic402 {
namespace {

constexpr auto connection = std::to_array<ObjectRange>({{0x2F00}, {0x2F01}, {0x2F20}});

constexpr Product of_bus(std::string_view name, std::string_view foe_file) {
  return {
      .name = name,
      .dialect = {.brake_delay = ObjectAddress{0x2020, 2}, .foe_file = foe_file},
      .rules = {.connection = connection, .store = cia402::store},
      .tuning = tuning,
      .gain_guide = gain_guide,
      .fault_texts = fault_texts,
      .object_texts = object_texts,
      .status_words = cia402::status_words,
      .mode_names = cia402::mode_names,
      .terminal_words = terminal_words,
  };
}

}  // namespace

constinit const Product product = of_bus("generic402", {});
constinit const Product ethercat_product = of_bus("generic402-ec", "parameters.txt");

}  // namespace servodrome::catalogue::generic402
