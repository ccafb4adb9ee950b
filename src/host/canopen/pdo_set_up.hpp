#pragma once

#include <vector>

#include "host/object_client.hpp"

namespace servodrome::host {

struct PdoObject {
  ObjectAddress object;
  std::uint8_t bits = 0;
};

// A PDO of a node as it is configured: 1400h and 1600h, or 1800h and 1A00h, plus `number` (0: the first).
struct PdoParameters {
  bool transmit = false;  // seen from the node
  std::uint8_t number = 0;
  std::uint32_t cob_id = 0;  // bit 31: not in use
  std::uint8_t transmission_type = 255;
  std::vector<std::uint32_t> mapping{};  // index, sub-index, length in bits (CiA 301 7.5.2.36)
  // What is in the sub-indices behind the mapping's count: without effect, but a comparison may see it.
  std::vector<std::uint32_t> unused{};

  std::uint16_t communication_index() const {
    return static_cast<std::uint16_t>((transmit ? 0x1800 : 0x1400) + number);
  }
  std::uint16_t mapping_index() const { return static_cast<std::uint16_t>((transmit ? 0x1A00 : 0x1600) + number); }
  bool in_use() const { return (cob_id & 0x80000000U) == 0; }
  std::uint32_t can_id() const { return cob_id & 0x7FFU; }
  unsigned bytes() const;
};

// Nothing: the node does not have this PDO. `entries`: unused sub-indices are read up to this one, as far as there are.
// Throws ObjectError.
std::optional<PdoParameters> read_pdo(ObjectClient& objects, bool transmit, std::uint8_t number,
                                      std::size_t entries = 0);
// Off, mapping, transmission type, on, as CiA 301 7.5.2.36 wants it. The node is pre-operational. Throws ObjectError;
// the PDO may then be off.
void write_pdo(ObjectClient& objects, const PdoParameters& pdo);

}  // namespace servodrome::host
