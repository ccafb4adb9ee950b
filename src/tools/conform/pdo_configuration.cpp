#include "tools/conform/pdo_configuration.hpp"

#include "master/canopen/sdo_client.hpp"

namespace servodrome::master::conform {

unsigned PdoConfiguration::bits() const {
  unsigned sum = 0;
  for (const std::uint32_t entry : mapping) sum += entry & 0xFF;
  return sum;
}

namespace {

// nullopt: the drive refused the access, with any abort code. A missing answer throws, because it does not show that
// the object is absent.
template <typename Access>
auto if_not_refused(const Access& access) -> std::optional<decltype(access())> {
  try {
    return access();
  } catch (const SdoError& error) {
    if (!error.from_node()) throw;
    return std::nullopt;
  }
}

}  // namespace

std::optional<PdoConfiguration> read_pdo(ObjectClient& objects, std::uint16_t index) {
  PdoConfiguration pdo{.index = index};
  const auto cob_id = if_not_refused([&] { return objects.read<std::uint32_t>(index, 1); });
  if (!cob_id) return std::nullopt;
  pdo.cob_id = *cob_id;
  for (std::uint8_t sub = 2; sub <= 6; ++sub) {
    if (auto value = if_not_refused([&] { return objects.upload({index, sub}); }))
      pdo.parameters[sub] = std::move(*value);
  }
  const auto count = if_not_refused([&] { return objects.read<std::uint8_t>(pdo.mapping_index(), 0); }).value_or(0);
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
  } catch (const MasterError&) {
    // Remaining differences are found and reported after all checks, by Subject::restore().
  }
}

}  // namespace servodrome::master::conform
