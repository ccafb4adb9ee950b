#pragma once

#include "master/ethercat/slave.hpp"
#include "master/process_image.hpp"

namespace servodrome::master {

// Process data of a slave in a cycle: the assigned PDOs, in their order.
struct ProcessData {
  std::vector<Pdo> outputs;  // from master to slave
  std::vector<Pdo> inputs;
};

unsigned bits_of(const std::vector<Pdo>& pdos);
inline unsigned bytes_of(const std::vector<Pdo>& pdos) { return (bits_of(pdos) + 7) / 8; }
// Position of an object among the bits of the PDOs; nullopt if it is not mapped.
std::optional<MappedBits> find_mapped(const std::vector<Pdo>& pdos, ObjectAddress object);

// Reads 1C12h, 1C13h and the mappings they list; without CoE or without these objects, uses the SII. The slave must be
// in PREOP or above.
ProcessData read_process_data(EthercatSlave& slave);

// ---- In PREOP; throw CoeError if the slave refuses ----

// Writes 1C12h (outputs) or 1C13h (inputs): clears the list first, then writes `pdos`.
void assign_pdos(CoeClient& coe, std::uint16_t assignment, std::span<const std::uint16_t> pdos);
// Writes the entries of 16xxh or 1Axxh: clears the list first.
void map_pdo(CoeClient& coe, const Pdo& pdo);

inline constexpr std::uint16_t rx_assignment = 0x1C12;
inline constexpr std::uint16_t tx_assignment = 0x1C13;

}  // namespace servodrome::master
