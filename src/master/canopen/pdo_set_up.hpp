#pragma once

#include <vector>

#include "master/object_client.hpp"

namespace servodrome::master {

struct PdoObject {
  ObjectAddress object;
  std::uint8_t bits = 0;
};

// Configuration of one PDO of a node: objects 1400h and 1600h, or 1800h and 1A00h, plus `number` (0: the first).
struct PdoParameters {
  bool transmit = false;  // true: TPDO, from the node to the master
  std::uint8_t number = 0;
  std::uint32_t cob_id = 0;  // bit 31 set: PDO not in use
  std::uint8_t transmission_type = 255;
  std::vector<std::uint32_t> mapping{};  // each: index, sub-index, length in bits (CiA 301 7.5.2.36)
  // Values of the sub-indices beyond the mapping's count. They have no effect on the PDO, but a comparison of all
  // objects includes them.
  std::vector<std::uint32_t> unused{};

  std::uint16_t communication_index() const {
    return static_cast<std::uint16_t>((transmit ? 0x1800 : 0x1400) + number);
  }
  std::uint16_t mapping_index() const { return static_cast<std::uint16_t>((transmit ? 0x1A00 : 0x1600) + number); }
  bool in_use() const { return (cob_id & 0x80000000U) == 0; }
  std::uint32_t can_id() const { return cob_id & 0x7FFU; }
  unsigned bytes() const;
};

// nullopt: the node does not have this PDO. `entries`: the last sub-index of the mapping to read, which may be beyond
// the mapping's count. Reading stops at the first sub-index that the node refuses. Throws ObjectError.
std::optional<PdoParameters> read_pdo(ObjectClient& objects, bool transmit, std::uint8_t number,
                                      std::size_t entries = 0);
// Writes in the order of CiA 301 7.5.2.36: PDO off, mapping, transmission type, PDO on. The node must be
// pre-operational. Throws ObjectError; the PDO may then be off.
void write_pdo(ObjectClient& objects, const PdoParameters& pdo);

}  // namespace servodrome::master
