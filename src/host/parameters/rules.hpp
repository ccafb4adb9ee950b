#pragma once

#include <span>
#include <string_view>

#include "host/object_address.hpp"

// Which objects of a drive are parameters, what stores them, and when they act: what no dictionary says.
namespace servodrome::host {

// Objects of one index, from one sub-index to another.
struct ObjectRange {
  std::uint16_t index;
  std::uint8_t first_sub = 0;
  std::uint8_t last_sub = 0xFF;

  constexpr bool contains(ObjectAddress object) const {
    return object.index == index && object.sub >= first_sub && object.sub <= last_sub;
  }
};

struct StoreCommand {
  ObjectAddress object;
  std::uint32_t value;
};

struct ParameterRules {
  std::string_view product{};                 // as `servodrome products` lists it; empty: any other drive
  std::span<const ObjectRange> commands{};    // besides those of the standard: writing them does something
  std::span<const ObjectRange> connection{};  // node-ID, bit rate and the like: how the drive is reached
  std::span<const ObjectRange> restart{};     // besides `connection`: act after the next power-on
  std::span<const StoreCommand> store{};      // empty: what is kept at all is kept as soon as it is written
  std::span<const ObjectRange> by_model{};    // the factory value is that of the size the drive is sold in

  bool is_connection(ObjectAddress object) const;
  // A command, a target, a measured value, or what a master sets anew at every start.
  bool is_command(ObjectAddress object) const;
  bool acts_after_restart(ObjectAddress object) const;
  bool differs_by_model(ObjectAddress object) const;
};

// Those of the product; 1010h sub 1 stores, and nothing else is known, for a name that is not in the table.
const ParameterRules& parameter_rules_of(std::string_view product);

}  // namespace servodrome::host
