#pragma once

#include <map>
#include <optional>
#include <vector>

#include "host/object_client.hpp"

namespace servodrome::host::conform {

inline constexpr std::uint32_t pdo_invalid = 1U << 31;  // of a COB-ID (CiA 301 7.5.2.35)

constexpr bool is_pdo_object(std::uint16_t index) { return index >= 0x1400 && index <= 0x1BFF; }

// A PDO of a CANopen node: 1400h to 15FFh or 1800h to 19FFh, and the mapping 200h behind.
struct PdoConfiguration {
  std::uint16_t index = 0;  // of its communication parameter
  std::uint32_t cob_id = 0;
  std::map<std::uint8_t, std::vector<std::byte>> parameters{};  // sub-indices 2 and up
  std::vector<std::uint32_t> mapping{};

  std::uint16_t mapping_index() const { return static_cast<std::uint16_t>(index + 0x200); }
  bool is_valid() const { return (cob_id & pdo_invalid) == 0; }
  std::uint32_t can_id() const { return cob_id & 0x7FF; }
  unsigned bits() const;
  friend bool operator==(const PdoConfiguration&, const PdoConfiguration&) = default;
};

// Nothing: the node does not have it.
std::optional<PdoConfiguration> read_pdo(ObjectClient& objects, std::uint16_t index);
// By the procedure of CiA 301 7.5.2.36: invalid, mapping empty, entries, their number, valid. Throws ObjectError.
void write_pdo(ObjectClient& objects, const PdoConfiguration& pdo);

// Puts a PDO back as it was when this goes.
class PdoGuard {
 public:
  PdoGuard(ObjectClient& objects, const PdoConfiguration& pdo) : objects_(objects), pdo_(pdo) {}
  ~PdoGuard();
  PdoGuard(const PdoGuard&) = delete;
  PdoGuard& operator=(const PdoGuard&) = delete;

 private:
  ObjectClient& objects_;
  PdoConfiguration pdo_;
};

}  // namespace servodrome::host::conform
