#pragma once

#include <functional>

#include "host/parameters/file.hpp"
#include "host/parameters/list.hpp"

namespace servodrome::host {

// How far something is; may throw to end it.
using ParameterProgress = std::function<void(const char* doing, std::size_t done, std::size_t of)>;

// The node-ID of a CANopen drive; nothing on other buses, where identifiers do not depend on it.
using NodeId = std::optional<std::uint8_t>;

struct ReadParameters {
  std::vector<ParameterValue> values;
  std::vector<ObjectAddress> absent;  // the drive does not have them, or not on this bus
};

// What the drive has of the list. Throws HostError if it does not answer.
ReadParameters read_parameters(ObjectClient& objects, const ParameterList& list, NodeId node_id,
                               const ParameterProgress& progress = {});

// The present value of one parameter, in the size of its type; nothing if the drive does not have it.
std::optional<std::vector<std::byte>> read_parameter(ObjectClient& objects, ObjectAddress address,
                                                     dictionary::Type type);

// As the drive leaves the factory, as far as the list knows.
std::vector<ParameterValue> factory_parameters(const ParameterList& list);

struct ParameterDifference {
  ObjectAddress address;
  const ParameterValue* left = nullptr;   // nullptr: it is not there
  const ParameterValue* right = nullptr;  // they point into what was compared
};

// In order of address. `only_common`: what one side does not have is no difference.
std::vector<ParameterDifference> compare(std::span<const ParameterValue> left, std::span<const ParameterValue> right,
                                         NodeId node_id, bool only_common = false);

}  // namespace servodrome::host
