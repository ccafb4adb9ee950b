#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "master/object_address.hpp"

namespace servodrome::master {

struct EthercatIdentity {
  std::uint32_t vendor_id = 0;
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  friend bool operator==(const EthercatIdentity&, const EthercatIdentity&) = default;
};

struct MailboxArea {
  std::uint16_t start = 0;
  std::uint16_t length = 0;
  friend bool operator==(const MailboxArea&, const MailboxArea&) = default;
};
// Areas of sync managers 0 (master to slave) and 1 (slave to master).
struct MailboxAreas {
  MailboxArea out;
  MailboxArea in;
  friend bool operator==(const MailboxAreas&, const MailboxAreas&) = default;
};

// Bits of the mailbox protocols in the SII, word 1Ch.
namespace mailbox_protocol {
inline constexpr std::uint16_t aoe = 0x0001;
inline constexpr std::uint16_t eoe = 0x0002;
inline constexpr std::uint16_t coe = 0x0004;
inline constexpr std::uint16_t foe = 0x0008;
inline constexpr std::uint16_t soe = 0x0010;
inline constexpr std::uint16_t voe = 0x0020;
}  // namespace mailbox_protocol

struct SiiSyncManager {
  std::uint16_t start = 0;
  std::uint16_t length = 0;
  std::uint8_t control = 0;
  std::uint8_t activate = 0;
  std::uint8_t type = 0;  // 1, 2: mailbox out and in; 3, 4: outputs and inputs
};

// An object in a PDO; index 0: a gap.
struct PdoEntry {
  ObjectAddress object;
  std::uint8_t bits = 0;
  std::string name{};
  friend bool operator==(const PdoEntry& a, const PdoEntry& b) { return a.object == b.object && a.bits == b.bits; }
};

struct Pdo {
  std::uint16_t index = 0;
  std::vector<PdoEntry> entries{};
  std::string name{};
  std::optional<std::uint8_t> sync_manager{};  // default assignment

  unsigned bits() const {
    unsigned sum = 0;
    for (const PdoEntry& entry : entries) sum += entry.bits;
    return sum;
  }
};

// A mode of the distributed clock (ETG.1000.6 table 25).
struct SiiDcMode {
  std::string name;
  std::uint32_t sync0_cycle_ns = 0;  // 0: the master's cycle with `sync0_factor`
  std::int32_t sync0_shift_ns = 0;
  std::int32_t sync1_shift_ns = 0;
  std::int16_t sync1_factor = 0;
  std::uint16_t assign_activate = 0;  // for 0980h and 0981h
  std::int16_t sync0_factor = 0;      // below 0: the master's cycle divided by it
};

// Parsed content of the slave information memory (ETG.1000.6 clause 5.4, ETG.2010).
struct SiiContent {
  bool checksum_right = false;
  std::uint16_t alias = 0;
  EthercatIdentity identity;
  MailboxAreas bootstrap;
  MailboxAreas mailbox;  // lengths 0: no mailbox
  std::uint16_t protocols = 0;
  std::string group;
  std::string order;
  std::string name;
  std::uint8_t coe_details = 0;
  std::vector<std::uint8_t> fmmus;  // use of each FMMU: 1 outputs, 2 inputs, 3 mailbox state
  std::vector<SiiSyncManager> sync_managers;
  std::vector<Pdo> rx_pdos;
  std::vector<Pdo> tx_pdos;
  std::vector<SiiDcMode> dc_modes;

  bool has(std::uint16_t protocol) const { return (protocols & protocol) != 0; }
  bool complete_access() const { return (coe_details & 0x20) != 0; }
};

// Parts that cannot be read are left out, such as a category that is cut off at the end of the memory.
SiiContent parse_sii(std::span<const std::uint8_t> image);

}  // namespace servodrome::master
