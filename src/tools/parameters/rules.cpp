#include "tools/parameters/rules.hpp"

#include <algorithm>
#include <array>

#include "dictionary/store.hpp"

namespace servodrome::master {
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

constexpr std::array store_1010{StoreCommand{{0x1010, 1}, dictionary::save_signature}};

// ISMC manual, ch. 6, Table 5-1: stored, and in force after a restart.
constexpr auto ismc_connection = std::to_array<ObjectRange>({{0x2004}, {0x2401}});

constexpr auto generic402_connection = std::to_array<ObjectRange>({{0x2F00}, {0x2F01}, {0x2F20}});

// Pn703 bit rate and Pn704 node-ID; Pn006, Pn201 and Pn202 also take effect at the next power-on. All Pn are stored as
// soon as they are written.
constexpr auto pronet_connection = std::to_array<ObjectRange>({{0x30FF}, {0x3100}});
constexpr auto pronet_restart = std::to_array<ObjectRange>({{0x3006}, {0x2F10}, {0x2F11}});

// Simulated inputs and outputs, copies of other objects in different units, and pointers to objects. 2FF0h sub 1 stores
// everything except the motor data, sub 3 stores these (iSMK manual, ch. 7.10).
constexpr auto ismk_commands = std::to_array<ObjectRange>({{0x2010, 0x02, 0x02},
                                                           {0x2010, 0x0E, 0x0E},
                                                           {0x2690},
                                                           {0x2FF0},
                                                           {0x2FF1},
                                                           {0x2FFF},
                                                           {0x60F6, 0x08, 0x08},
                                                           {0x60F9, 0x28, 0x28}});
constexpr auto ismk_connection = std::to_array<ObjectRange>({{0x100B}, {0x2F81}, {0x2FE2}, {0x6510, 0x0B, 0x0C}});
constexpr std::array ismk_store{StoreCommand{{0x2FF0, 1}, 1}, StoreCommand{{0x2FF0, 3}, 1}};

// Objects of the service port: P00-21 to P00-27 and the functions; P00, P03-09 to P03-11 and P06 take effect at
// power-on (JMC manual, ch. 9.2, AL.110). Objects of the bus cannot be stored; panel parameters are stored as soon as
// they are written.
constexpr auto jmc_commands = std::to_array<ObjectRange>({{0x200D}, {0x200E}});
constexpr auto jmc_connection = std::to_array<ObjectRange>({{0x2000, 0x16, 0x1C}});
constexpr auto jmc_restart = std::to_array<ObjectRange>({{0x2000}, {0x2003, 0x0A, 0x0C}, {0x2006}});

// Rated current and torque of the motor; P00, the motor data.
constexpr auto jmc_by_model = std::to_array<ObjectRange>({{0x2000}, {0x6075}, {0x6076}});

constexpr ParameterRules ismk(std::string_view product) {
  return {.product = product, .commands = ismk_commands, .connection = ismk_connection, .store = ismk_store};
}

constexpr ParameterRules other{.store = store_1010};

constexpr std::array rules{
    ParameterRules{.product = "ismc", .connection = ismc_connection, .store = store_1010},
    ParameterRules{.product = "generic402", .connection = generic402_connection, .store = store_1010},
    ParameterRules{.product = "generic402-ec", .connection = generic402_connection, .store = store_1010},
    ParameterRules{.product = "pronet", .connection = pronet_connection, .restart = pronet_restart},
    ismk("ismk"),
    ismk("ismk-ea"),
    ParameterRules{.product = "jmc_ec",
                   .commands = jmc_commands,
                   .connection = jmc_connection,
                   .restart = jmc_restart,
                   .by_model = jmc_by_model},
};

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

const ParameterRules& parameter_rules_of(std::string_view product) {
  const auto* const found =
      std::find_if(rules.begin(), rules.end(), [product](const ParameterRules& one) { return one.product == product; });
  return found != rules.end() ? *found : other;
}

}  // namespace servodrome::master
