#pragma once

#include <cstdint>
#include <span>

#include "dictionary/entry.hpp"
#include "ethercat/slave/profile.hpp"

// Description of an entry in CoE, used for SDO information on the bus and for the ESI file.
namespace servodrome::ethercat {

// Bytes of an entry within its object; for a string or block of bytes, its greatest length.
std::uint32_t size_in_object(const dictionary::Entry& entry);

// Length in an entry description: a BOOLEAN has one bit.
std::uint32_t bit_length(const dictionary::Entry& entry);

// Positions of an object's entries in complete access and in descriptions of the whole object: BOOLEANs are packed as
// bits, everything else starts at the next byte, and a pad byte follows sub-index 0 (ETG.1000.6 clause 5.6.2.1.3).
struct ObjectLayout {
  std::uint32_t bit = 0;

  // Returns the first bit of the entry, which has `bytes` bytes, and moves behind it.
  std::uint32_t place(const dictionary::Entry& entry, std::uint32_t bytes) {
    const bool single = entry.type == dictionary::Type::boolean;
    if (!single) bit = (bit + 7) / 8 * 8;
    const std::uint32_t at = bit;
    bit += single ? 1 : entry.sub == 0 ? 16 : bytes * 8;
    return at;
  }
  std::uint32_t bytes() const { return (bit + 7) / 8; }
};

// Returns true if the entry is a mapping, an assignment or a synchronisation type. These are fixed from
// Safe-Operational on (ETG.1020 clause 12).
bool written_only_in_pre_operational(const dictionary::Entry& entry);

// Returns true if the entry is one of the profile's start-up parameters.
bool is_start_up_parameter(const Profile& profile, const dictionary::Entry& entry);

// Object access bits of ETG.1000.6 table 49: readable in Pre-Operational, Safe-Operational, Operational; writable in
// the same states; RxPDO, TxPDO; backup (kept for a replacement device); settings (start-up parameter).
unsigned object_access(const Profile& profile, const dictionary::Entry& entry);

// Code of a unit (ETG.1004 and CiA 303-2): prefix, numerator, denominator in bits 31..8; 0 for an unknown unit.
std::uint32_t unit_code(const char* unit);

}  // namespace servodrome::ethercat
