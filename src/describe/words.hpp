#pragma once

#include <span>
#include <string>
#include <string_view>

#include "dictionary/entry.hpp"

// Common text forms of values and properties of an entry, for all documents.
namespace servodrome::describe {

// "UNSIGNED32" and so on (CiA 301 table 44).
std::string_view word(dictionary::Type type);
// "const", "ro", "wo", "rw"
std::string_view word(dictionary::Access access);
// "none", "rx", "tx", "both", seen from the device
std::string_view word(dictionary::Pdo pdo);

// Formats a value: identifiers, mappings and similar values of the communication area in hexadecimal, all others in
// decimal, REAL32 (`value` holds its bits) as the shortest decimal number that reads back unchanged.
std::string number_text(const dictionary::Entry& entry, std::int64_t value);

// The factory value without the node-ID that is added to it; empty for strings and domains without constant content.
std::string default_text(const dictionary::Entry& entry);

// Number of sub-indices of the object that begins at `position` of `table`.
std::size_t entries_of_object(std::span<const dictionary::Entry> table, std::size_t position);

// Factory value of a sub-index of the identity object; 0 if the table does not have it.
std::uint32_t identity(std::span<const dictionary::Entry> table, std::uint8_t sub);

// Number of objects with sub-index 0 from `first` to `last`.
unsigned count_objects(std::span<const dictionary::Entry> table, std::uint16_t first, std::uint16_t last);
inline unsigned count_rpdos(std::span<const dictionary::Entry> table) { return count_objects(table, 0x1400, 0x15FF); }
inline unsigned count_tpdos(std::span<const dictionary::Entry> table) { return count_objects(table, 0x1800, 0x19FF); }

}  // namespace servodrome::describe
