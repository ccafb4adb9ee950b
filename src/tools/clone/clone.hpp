#pragma once

#include <functional>

#include "describe/device_file.hpp"
#include "master/ethercat/coe_client.hpp"
#include "master/ethercat/sii_content.hpp"
#include "master/object_client.hpp"

namespace servodrome::describe {
struct Description;
}

// Copies the dictionary and the values of a real drive into a file from which another drive can be created.
namespace servodrome::master {

// Called before each step; may throw to cancel. `of` is 0 if the total is unknown.
using CloneProgress = std::function<void(const char* doing, std::size_t done, std::size_t of)>;

struct UnreadObject {
  ObjectAddress address;
  std::string why;
};

// Result: the objects read, and those that could not be read.
struct Clone {
  describe::DeviceFile device;
  std::vector<UnreadObject> unread;
  std::size_t values = 0;  // number of values read
};

// The objects without values, from a dictionary's table.
describe::DeviceFile objects_of_table(std::span<const dictionary::Entry> table);
// The objects without values, from a slave's SDO information.
describe::DeviceFile objects_of_slave(CoeClient& coe, const CloneProgress& progress);
// The objects without values, found by reading all addresses where drives have objects: CiA 301, manufacturer area, CiA
// 402 up to 67FFh. Types come from the standards; otherwise they are numbers of the size that is returned.
describe::DeviceFile objects_that_answer(ObjectClient& objects, const CloneProgress& progress);

// Reads the values of all parameters, but no measured values and no commands. COB-IDs are stored relative to `node_id`.
// Throws ObjectError if the drive does not answer.
Clone read_clone(ObjectClient& objects, describe::DeviceFile device, std::uint8_t node_id,
                 const CloneProgress& progress);

// A device configuration file (CiA 306-1) for `node_id`.
std::string configuration_file(const Clone& clone, const std::string& name, std::uint8_t node_id);
// An ESI file (ETG.2000), including the data of the slave's information memory.
std::string slave_information(const Clone& clone, const SiiContent& sii);

}  // namespace servodrome::master
