#pragma once

#include <functional>

#include "describe/device_file.hpp"
#include "host/ethercat/coe_client.hpp"
#include "host/ethercat/sii_content.hpp"
#include "host/object_client.hpp"

namespace servodrome::describe {
struct Description;
}

// A live drive's dictionary and values, as a file that another drive can be made of.
namespace servodrome::host {

// Called before each step; throws to end the work. `of` 0: it is not known how many there are.
using CloneProgress = std::function<void(const char* doing, std::size_t done, std::size_t of)>;

struct UnreadObject {
  ObjectAddress address;
  std::string why;
};

// What was read, and what not.
struct Clone {
  describe::DeviceFile device;
  std::vector<UnreadObject> unread;
  std::size_t values = 0;  // that were read
};

// The objects, without values:
// ... that a dictionary's table has,
describe::DeviceFile objects_of_table(std::span<const dictionary::Entry> table);
// ... that a slave's SDO information lists,
describe::DeviceFile objects_of_slave(CoeClient& coe, const CloneProgress& progress);
// ... that answer, of the areas where a drive has its objects: CiA 301, manufacturer, CiA 402 up to 67FFh. Types are
// those of the standards, or numbers as long as what is answered.
describe::DeviceFile objects_that_answer(ObjectClient& objects, const CloneProgress& progress);

// Reads all values that are parameters: not measured ones, and no commands. COB-IDs are kept relative to `node_id`.
// Throws ObjectError when the drive keeps silent.
Clone read_clone(ObjectClient& objects, describe::DeviceFile device, std::uint8_t node_id,
                 const CloneProgress& progress);

// As a device configuration file (CiA 306-1) that says `node_id`.
std::string configuration_file(const Clone& clone, const std::string& name, std::uint8_t node_id);
// As an ESI file (ETG.2000), with what the slave's information memory says.
std::string slave_information(const Clone& clone, const SiiContent& sii);

}  // namespace servodrome::host
