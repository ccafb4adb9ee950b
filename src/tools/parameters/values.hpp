#pragma once

#include <functional>

#include "tools/parameters/file.hpp"
#include "tools/parameters/list.hpp"

namespace servodrome::master {

// Progress callback; it may throw to cancel.
using ParameterProgress = std::function<void(const char* doing, std::size_t done, std::size_t of)>;

// Node-ID of a CANopen drive; nullopt on other buses, whose identifiers do not depend on it.
using NodeId = std::optional<std::uint8_t>;

// The number in the size of its type.
std::vector<std::byte> bytes_of(std::int64_t number, dictionary::Type type);

struct ReadParameters {
  std::vector<ParameterValue> values;
  std::vector<ObjectAddress> absent;  // the drive does not have them, or not on this bus
};

// Reads all parameters of the list that the drive has. Throws MasterError if it does not answer.
ReadParameters read_parameters(ObjectClient& objects, const ParameterList& list, NodeId node_id,
                               const ParameterProgress& progress = {});

// Present value of a parameter, in the size of its type; nullopt if the drive does not have it.
std::optional<std::vector<std::byte>> read_parameter(ObjectClient& objects, ObjectAddress address,
                                                     dictionary::Type type);

// The factory values that the list contains.
std::vector<ParameterValue> factory_parameters(const ParameterList& list);

struct ParameterDifference {
  ObjectAddress address;
  const ParameterValue* left = nullptr;   // nullptr: absent; points into the compared values
  const ParameterValue* right = nullptr;  // nullptr: absent
};

// Sorted by address. `only_common`: ignores values that exist on one side only.
std::vector<ParameterDifference> compare(std::span<const ParameterValue> left, std::span<const ParameterValue> right,
                                         NodeId node_id, bool only_common = false);

}  // namespace servodrome::master
