#include "catalogue/parameter_rules.hpp"

#include <algorithm>
#include <array>

namespace servodrome::catalogue {
namespace {

// Objects of CiA 301, CiA 402-2 and ETG.1000.6 that can be read and written but are no parameters.
constexpr auto standard_commands = std::to_array<ObjectRange>({
    {0x1003},                                // error history: 0 clears it
    {0x1010}, {0x1011}, {0x1021},            // the EDS itself
    {0x1023},                                // OS command and debugger
    {0x1024}, {0x1025}, {0x1026}, {0x1C32},  // synchronisation: set by the master at every start
    {0x1C33}, {0x1F50},                      // program download
    {0x1F51}, {0x6040}, {0x6042}, {0x6060}, {0x6064}, {0x6069}, {0x6071}, {0x607A},       {0x60B0},       {0x60B1},
    {0x60B2}, {0x60B8}, {0x60BA}, {0x60BB}, {0x60BC}, {0x60BD}, {0x60C1}, {0x60C4, 4, 6}, {0x60FE, 1, 1}, {0x60FF},
});

bool any_contains(std::span<const ObjectRange> ranges, ObjectAddress object) {
  return std::any_of(ranges.begin(), ranges.end(), [object](const ObjectRange& one) { return one.contains(object); });
}

}  // namespace

bool ParameterRules::is_connection(ObjectAddress object) const { return any_contains(connection, object); }

bool ParameterRules::is_command(ObjectAddress object) const {
  constexpr std::uint16_t first_object = 0x1000;  // lower indices: data types, also dummy entries of PDOs
  return object.index < first_object || any_contains(standard_commands, object) || any_contains(commands, object);
}

bool ParameterRules::acts_after_restart(ObjectAddress object) const {
  return is_connection(object) || any_contains(restart, object);
}

bool ParameterRules::differs_by_model(ObjectAddress object) const { return any_contains(by_model, object); }

}  // namespace servodrome::catalogue
