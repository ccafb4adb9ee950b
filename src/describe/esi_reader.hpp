#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "describe/device_file.hpp"

namespace servodrome::describe {

// A sync manager in an ESI file; lengths in bytes, 0: not given.
struct EsiChannel {
  std::uint16_t start = 0;
  std::uint16_t least_length = 0;
  std::uint16_t greatest_length = 0;
  std::uint16_t default_length = 0;
};

// A mode of the distributed clock.
struct EsiOpMode {
  std::string name;
  std::string description;
  std::uint16_t assign_activate = 0;
  std::uint32_t sync0_cycle_ns = 0;
  std::int16_t sync0_factor = 0;
  std::int32_t sync0_shift_ns = 0;
  std::int16_t sync1_factor = 0;
  std::int32_t sync1_shift_ns = 0;
};

// A device of an EtherCAT slave information file (ETG.2000).
struct EsiDevice {
  DeviceFile device;  // includes the PDOs of the file as objects 16xxh, 1Axxh, 1C12h and 1C13h
  bool has_dictionary = false;
  std::string group;
  std::string type;
  std::string name;
  std::array<std::optional<EsiChannel>, 4> channels;  // mailbox out, mailbox in, outputs, inputs
  bool complete_access = false;
  std::vector<EsiOpMode> op_modes;
};

// `which` selects the device by type, name or product code if the file has several; reads its newest revision. Throws
// DeviceFileError.
EsiDevice read_esi(const std::string& text, const std::string& file, const std::string& which);

}  // namespace servodrome::describe
