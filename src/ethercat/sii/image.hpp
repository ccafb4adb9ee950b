#pragma once

#include <span>

#include "dictionary/entry.hpp"
#include "ethercat/slave/profile.hpp"

namespace servodrome::ethercat {

// Positions in the information memory (ETG.1000.6 table 16).
inline constexpr std::size_t sii_config_bytes = 14;  // bytes covered by the checksum
inline constexpr std::size_t sii_bootstrap_byte = 0x14 * 2;
inline constexpr std::size_t sii_bootstrap_bytes = 8;  // out: start, length; in: start, length

// A mode of the distributed clock that a master may offer its user (ETG.1000.6 table 25).
struct DcMode {
  const char* name = "";
  const char* description = "";
  std::uint32_t sync0_cycle_ns = 0;  // 0: the master's cycle with `sync0_factor`
  std::uint32_t sync0_shift_ns = 0;
  std::uint32_t sync1_shift_ns = 0;
  std::int16_t sync1_factor = 0;
  std::uint16_t assign_activate = 0x0000;  // value for 0980h and 0981h
  std::int16_t sync0_factor = 0;           // below 0: the master's cycle divided by it
};

// Content of the information memory that comes from neither the profile nor the dictionary.
struct SiiDescription {
  std::uint32_t vendor_id = 0;
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  std::uint16_t station_alias = 0;
  std::uint16_t pdi_control = 0x0E08;  // 16-bit microcontroller interface
  std::uint16_t pdi_configuration = 0;
  std::uint16_t sync_pulse_length = 0;  // in 10 ns
  const char* group = "";
  const char* order = "";
  const char* name = "";
  std::int16_t current_ma = 0;  // current drawn from E-Bus
  std::span<const DcMode> dc_modes;
};

// Writes the slave information memory (ETG.1000.6 clause 5.4, ETG.2010): configuration area, identity, mailbox,
// strings, general, FMMUs, sync managers, the PDOs of the table with their default mappings, DC. Returns the number of
// bytes used; the rest is FFh. Returns 0 if the image is too small or there are too many strings. The size of `image`
// is a multiple of 128 bytes.
std::size_t write_sii_image(const SiiDescription& description, const Profile& profile,
                            std::span<const dictionary::Entry> table, std::span<std::uint8_t> image);

}  // namespace servodrome::ethercat
