#pragma once

#include <cstdint>
#include <span>

#include "catalogue/object_address.hpp"

// Rules that no object dictionary contains: which objects are parameters, how they are stored, and when they take
// effect.
namespace servodrome::catalogue {

// A range of sub-indices of one index.
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
  std::span<const ObjectRange> commands{};    // writing these triggers an action; in addition to the standards'
                                              // commands
  std::span<const ObjectRange> connection{};  // connection settings: node-ID, bit rate etc.
  std::span<const ObjectRange> restart{};     // take effect at the next power-on; in addition to `connection`
  std::span<const StoreCommand> store{};      // empty: values that can be stored are stored as soon as they are written
  std::span<const ObjectRange> by_model{};    // the factory value depends on the drive's size

  bool is_connection(ObjectAddress object) const;
  // True for a command, a target, a measured value, or an object that a master sets at every start.
  bool is_command(ObjectAddress object) const;
  bool acts_after_restart(ObjectAddress object) const;
  bool differs_by_model(ObjectAddress object) const;
};

}  // namespace servodrome::catalogue
