#pragma once

#include <string>
#include <string_view>

#include "describe/description.hpp"
#include "describe/xml.hpp"
#include "ethercat/sii/defaults.hpp"

// Parts of an ESI file for esi.cpp, and the number formats of ETG.2000.
namespace servodrome::describe::etg2000 {

inline constexpr std::string_view english_lcid = "1033";  // LcId

std::string hex(std::uint32_t value, int digits);  // "#x001A"
std::string index_text(std::uint16_t index);
std::string decimal(std::int64_t value);
std::string flag(bool value);
std::string hex_bytes(std::span<const std::uint8_t> bytes);  // xs:hexBinary
// A number in the byte order of the bus.
std::string data_of(const dictionary::Entry& entry, std::int64_t value);
// Name of an entry's type (table of base data types).
std::string type_name(const dictionary::Entry& entry);
void put_name(Xml& xml, std::string_view name);

// Writes the element Profile: profile number, data types and objects of the dictionary.
void put_profile(Xml& xml, const Description& device, const ethercat::Profile& profile,
                 const ethercat::Defaults& defaults);

}  // namespace servodrome::describe::etg2000
