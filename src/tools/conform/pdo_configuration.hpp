#pragma once

#include <map>
#include <optional>
#include <vector>

#include "master/object_client.hpp"

namespace servodrome::master::conform {

inline constexpr std::uint32_t pdo_invalid = 1U << 31;  // bit of a COB-ID (CiA 301 7.5.2.35)

constexpr bool is_pdo_object(std::uint16_t index) { return index >= 0x1400 && index <= 0x1BFF; }

// Configuration of a PDO of a CANopen node: 1400h to 15FFh or 1800h to 19FFh, and the mapping object, whose index is
// 200h higher.
struct PdoConfiguration {
  std::uint16_t index = 0;  // of the communication parameter
  std::uint32_t cob_id = 0;
  std::map<std::uint8_t, std::vector<std::byte>> parameters{};  // sub-indices 2 and above
  std::vector<std::uint32_t> mapping{};

  std::uint16_t mapping_index() const { return static_cast<std::uint16_t>(index + 0x200); }
  bool is_valid() const { return (cob_id & pdo_invalid) == 0; }
  std::uint32_t can_id() const { return cob_id & 0x7FF; }
  unsigned bits() const;
  friend bool operator==(const PdoConfiguration&, const PdoConfiguration&) = default;
};

// nullopt: the node does not have it.
std::optional<PdoConfiguration> read_pdo(ObjectClient& objects, std::uint16_t index);
// Follows the procedure of CiA 301 7.5.2.36: PDO invalid, mapping empty, entries, their number, PDO valid. Throws
// ObjectError.
void write_pdo(ObjectClient& objects, const PdoConfiguration& pdo);

// Restores a PDO in its destructor.
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

}  // namespace servodrome::master::conform
