#pragma once

#include <cstdint>
#include <span>

#include "dictionary/entry.hpp"
#include "ethercat/slave/profile.hpp"

// What CoE says of an entry, on the bus (SDO information) and in the ESI file alike.
namespace servodrome::ethercat {

// Bytes an entry takes within its object: of a string or block of bytes the most it can have.
std::uint32_t size_in_object(const dictionary::Entry& entry);

// As an entry description counts it: a BOOLEAN is one bit.
std::uint32_t bit_length(const dictionary::Entry& entry);

// Where the entries of an object lie when they are transferred or described as a whole: BOOLEANs packed as bits,
// everything else at the next byte; sub-index 0 is followed by a pad byte (ETG.1000.6 clause 5.6.2.1.3).
struct ObjectLayout {
  std::uint32_t bit = 0;

  // First bit of the entry, which takes `bytes`.
  std::uint32_t place(const dictionary::Entry& entry, std::uint32_t bytes) {
    const bool single = entry.type == dictionary::Type::boolean;
    if (!single) bit = (bit + 7) / 8 * 8;
    const std::uint32_t at = bit;
    bit += single ? 1 : entry.sub == 0 ? 16 : bytes * 8;
    return at;
  }
  std::uint32_t bytes() const { return (bit + 7) / 8; }
};

// Mappings, assignments and kinds of synchronisation: what the process data are made of is settled before
// Safe-Operational (ETG.1020 clause 12).
bool written_only_in_pre_operational(const dictionary::Entry& entry);

// Is it one of the profile's start-up parameters?
bool is_start_up_parameter(const Profile& profile, const dictionary::Entry& entry);

// Object access of ETG.1000.6 table 49: read in Pre-Operational, Safe-Operational, Operational; the same for writing;
// RxPDO, TxPDO; kept for a replacement (backup); start-up parameter (settings).
unsigned object_access(const Profile& profile, const dictionary::Entry& entry);

// A unit as ETG.1004 (and CiA 303-2) codes it: prefix, numerator, denominator in bits 31..8; 0 if it has no code here.
std::uint32_t unit_code(const char* unit);

}  // namespace servodrome::ethercat
