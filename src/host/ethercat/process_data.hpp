#pragma once

#include "host/cyclic/process_image.hpp"
#include "host/ethercat/slave.hpp"

namespace servodrome::host {

// What a slave exchanges in a cycle: the PDOs that are assigned, in their order.
struct ProcessData {
  std::vector<Pdo> outputs;  // master to slave
  std::vector<Pdo> inputs;
};

unsigned bits_of(const std::vector<Pdo>& pdos);
inline unsigned bytes_of(const std::vector<Pdo>& pdos) { return (bits_of(pdos) + 7) / 8; }
// Where an object begins among the bits of the PDOs; nothing if it is not mapped.
std::optional<MappedBits> find_mapped(const std::vector<Pdo>& pdos, ObjectAddress object);

// From 1C12h, 1C13h and the mappings they name; of a slave without CoE, or without these objects, from its SII. The
// slave is in PREOP or above.
ProcessData read_process_data(EthercatSlave& slave);

// ---- In PREOP; throw CoeError when the slave does not allow it ----

// 1C12h (outputs) or 1C13h: first none, then these.
void assign_pdos(CoeClient& coe, std::uint16_t assignment, std::span<const std::uint16_t> pdos);
// The entries of 16xxh or 1Axxh: first none, then these.
void map_pdo(CoeClient& coe, const Pdo& pdo);

inline constexpr std::uint16_t rx_assignment = 0x1C12;
inline constexpr std::uint16_t tx_assignment = 0x1C13;

}  // namespace servodrome::host
