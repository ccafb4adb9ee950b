#include "host/conform/pdo_configuration.hpp"

namespace servodrome::host::conform {

unsigned PdoConfiguration::bits() const {
  unsigned sum = 0;
  for (const std::uint32_t entry : mapping) sum += entry & 0xFF;
  return sum;
}

std::optional<PdoConfiguration> read_pdo(ObjectClient& objects, std::uint16_t index) {
  PdoConfiguration pdo{.index = index};
  const auto cob_id = objects.read_if_present<std::uint32_t>(index, 1);
  if (!cob_id) return std::nullopt;
  pdo.cob_id = *cob_id;
  for (std::uint8_t sub = 2; sub <= 6; ++sub) {
    try {
      pdo.parameters[sub] = objects.upload({index, sub});
    } catch (const ObjectError& error) {
      if (!error.object_is_absent()) throw;
    }
  }
  const auto count = objects.read_if_present<std::uint8_t>(pdo.mapping_index(), 0).value_or(0);
  for (unsigned sub = 1; sub <= count; ++sub) {
    pdo.mapping.push_back(objects.read<std::uint32_t>(pdo.mapping_index(), static_cast<std::uint8_t>(sub)));
  }
  return pdo;
}

void write_pdo(ObjectClient& objects, const PdoConfiguration& pdo) {
  objects.write<std::uint32_t>(pdo.index, 1, pdo.cob_id | pdo_invalid);
  const auto present = read_pdo(objects, pdo.index);
  if (present && present->mapping != pdo.mapping) {
    objects.write<std::uint8_t>(pdo.mapping_index(), 0, 0);
    std::uint8_t sub = 0;
    for (const std::uint32_t entry : pdo.mapping) objects.write<std::uint32_t>(pdo.mapping_index(), ++sub, entry);
    objects.write<std::uint8_t>(pdo.mapping_index(), 0, sub);
  }
  for (const auto& [sub, value] : pdo.parameters) {
    if (objects.upload({pdo.index, sub}) != value) objects.download({pdo.index, sub}, value);
  }
  if (pdo.is_valid()) objects.write<std::uint32_t>(pdo.index, 1, pdo.cob_id);
}

PdoGuard::~PdoGuard() {
  try {
    write_pdo(objects_, pdo_);
  } catch (const HostError&) {
    // What is left different is found, and told, when all checks are over.
  }
}

}  // namespace servodrome::host::conform
