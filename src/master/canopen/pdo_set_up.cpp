#include "master/canopen/pdo_set_up.hpp"

namespace servodrome::master {

namespace {

constexpr std::uint32_t not_in_use = 0x80000000U;
// Sub-indices of 1400h and 1800h: COB-ID and transmission type.
constexpr std::uint8_t cob_id_sub = 1;
constexpr std::uint8_t type_sub = 2;

}  // namespace

unsigned PdoParameters::bytes() const {
  unsigned bits = 0;
  for (const std::uint32_t word : mapping) bits += word & 0xFF;
  return (bits + 7) / 8;
}

std::optional<PdoParameters> read_pdo(ObjectClient& objects, bool transmit, std::uint8_t number, std::size_t entries) {
  PdoParameters pdo{.transmit = transmit, .number = number};
  const auto cob_id = objects.read_if_present<std::uint32_t>(pdo.communication_index(), cob_id_sub);
  if (!cob_id) return std::nullopt;
  pdo.cob_id = *cob_id;
  pdo.transmission_type = objects.read<std::uint8_t>(pdo.communication_index(), type_sub);
  const auto count = objects.read<std::uint8_t>(pdo.mapping_index(), 0);
  for (std::uint8_t sub = 1; sub <= count; ++sub) {
    pdo.mapping.push_back(objects.read<std::uint32_t>(pdo.mapping_index(), sub));
  }
  try {
    for (std::size_t sub = count + 1U; sub <= entries; ++sub) {
      pdo.unused.push_back(objects.read<std::uint32_t>(pdo.mapping_index(), static_cast<std::uint8_t>(sub)));
    }
  } catch (const ObjectError& error) {
    if (!error.answered()) throw;
  }
  return pdo;
}

void write_pdo(ObjectClient& objects, const PdoParameters& pdo) {
  const std::uint16_t communication = pdo.communication_index();
  const std::uint16_t mapping = pdo.mapping_index();
  objects.write<std::uint32_t>(communication, cob_id_sub, pdo.cob_id | not_in_use);
  objects.write<std::uint8_t>(mapping, 0, 0);
  std::uint8_t sub = 0;
  for (const std::uint32_t word : pdo.mapping) objects.write<std::uint32_t>(mapping, ++sub, word);
  const std::uint8_t count = sub;
  try {
    for (const std::uint32_t word : pdo.unused) objects.write<std::uint32_t>(mapping, ++sub, word);
  } catch (const ObjectError& error) {
    if (!error.answered()) throw;  // some drives refuse sub-indices beyond the mapping's count
  }
  objects.write<std::uint8_t>(mapping, 0, count);
  objects.write<std::uint8_t>(communication, type_sub, pdo.transmission_type);
  if (pdo.in_use()) objects.write<std::uint32_t>(communication, cob_id_sub, pdo.cob_id);
}

}  // namespace servodrome::master
