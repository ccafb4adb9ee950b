#include "master/ethercat/process_data.hpp"

namespace servodrome::master {

namespace {

// A mapping entry: index, sub-index, length in bits (ETG.1000.6 clause 5.6.7.4.7).
std::uint32_t word_of(const PdoEntry& entry) {
  return static_cast<std::uint32_t>(entry.object.index) << 16 | static_cast<std::uint32_t>(entry.object.sub) << 8 |
         entry.bits;
}
PdoEntry entry_of(std::uint32_t word) {
  return {.object = {static_cast<std::uint16_t>(word >> 16), static_cast<std::uint8_t>(word >> 8)},
          .bits = static_cast<std::uint8_t>(word)};
}

// nullopt: the slave does not have the object.
std::optional<std::vector<Pdo>> read_assigned(CoeClient& coe, std::uint16_t assignment) {
  std::vector<Pdo> pdos;
  try {
    const auto count = coe.read<std::uint8_t>(assignment, 0);
    for (unsigned sub = 1; sub <= count; ++sub) {
      Pdo pdo{.index = coe.read<std::uint16_t>(assignment, static_cast<std::uint8_t>(sub))};
      if (pdo.index == 0) continue;  // an unused entry
      const auto entries = coe.read<std::uint8_t>(pdo.index, 0);
      for (unsigned i = 1; i <= entries; ++i) {
        pdo.entries.push_back(entry_of(coe.read<std::uint32_t>(pdo.index, static_cast<std::uint8_t>(i))));
      }
      pdos.push_back(std::move(pdo));
    }
  } catch (const CoeError& error) {
    if (error.object_is_absent()) return std::nullopt;
    throw;
  }
  return pdos;
}

std::vector<Pdo> assigned_by_sii(const std::vector<Pdo>& all) {
  std::vector<Pdo> pdos;
  for (const Pdo& pdo : all) {
    if (pdo.sync_manager) pdos.push_back(pdo);
  }
  return pdos;
}

}  // namespace

unsigned bits_of(const std::vector<Pdo>& pdos) {
  unsigned bits = 0;
  for (const Pdo& pdo : pdos) bits += pdo.bits();
  return bits;
}

std::optional<MappedBits> find_mapped(const std::vector<Pdo>& pdos, ObjectAddress object) {
  unsigned at = 0;
  for (const Pdo& pdo : pdos) {
    for (const PdoEntry& entry : pdo.entries) {
      if (entry.object == object && entry.object.index != 0) return MappedBits{at, entry.bits};
      at += entry.bits;
    }
  }
  return std::nullopt;
}

ProcessData read_process_data(EthercatSlave& slave) {
  std::optional<std::vector<Pdo>> outputs;
  std::optional<std::vector<Pdo>> inputs;
  if (slave.has_coe()) {
    outputs = read_assigned(slave.coe(), rx_assignment);
    inputs = read_assigned(slave.coe(), tx_assignment);
  }
  return {.outputs = outputs ? std::move(*outputs) : assigned_by_sii(slave.found().sii.rx_pdos),
          .inputs = inputs ? std::move(*inputs) : assigned_by_sii(slave.found().sii.tx_pdos)};
}

void assign_pdos(CoeClient& coe, std::uint16_t assignment, std::span<const std::uint16_t> pdos) {
  coe.write<std::uint8_t>(assignment, 0, 0);
  for (std::size_t i = 0; i < pdos.size(); ++i) {
    coe.write<std::uint16_t>(assignment, static_cast<std::uint8_t>(i + 1), pdos[i]);
  }
  coe.write<std::uint8_t>(assignment, 0, static_cast<std::uint8_t>(pdos.size()));
}

void map_pdo(CoeClient& coe, const Pdo& pdo) {
  coe.write<std::uint8_t>(pdo.index, 0, 0);
  for (std::size_t i = 0; i < pdo.entries.size(); ++i) {
    coe.write<std::uint32_t>(pdo.index, static_cast<std::uint8_t>(i + 1), word_of(pdo.entries[i]));
  }
  coe.write<std::uint8_t>(pdo.index, 0, static_cast<std::uint8_t>(pdo.entries.size()));
}

}  // namespace servodrome::master
