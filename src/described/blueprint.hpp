#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "canopen/profile.hpp"
#include "describe/description.hpp"
#include "describe/device_file.hpp"
#include "describe/esi_reader.hpp"
#include "drive/policy.hpp"
#include "products/device.hpp"

// Tables generated from a device description. For the other products these tables are constants.
namespace servodrome::described {

// Limits: a larger file describes no servo drive, and each object takes memory in every axis of a line.
inline constexpr std::size_t most_entries = 32768;
inline constexpr std::size_t most_object_bytes = std::size_t{16} << 20;

// An object with a standard index whose size differs from the reference drive's: `reference` is used to copy its value
// to and from the drive's field.
struct Adapted {
  std::uint32_t key = 0;
  dictionary::Entry reference;
};

// Data of a slave description besides its objects. Contains pointers to its own strings, so it must not be moved.
struct EthercatBlueprint {
  describe::EsiDevice described;
  std::vector<ethercat::DcMode> dc_modes;
  ethercat::Profile profile;
  ethercat::SiiDescription sii;
};

inline constexpr std::size_t ethercat_sii_bytes = 16384;

struct Blueprint {
  Blueprint() = default;
  Blueprint(const Blueprint&) = delete;
  Blueprint& operator=(const Blueprint&) = delete;

  describe::DeviceFile device;             // its strings are used as names in the table
  std::string text;                        // text of the file, the content of 1021h
  std::vector<dictionary::Entry> table;    // offsets into the device's objects struct and the memory behind it
  std::size_t object_bytes = 0;            // size of both
  std::vector<dictionary::Entry> implied;  // objects of the reference drive without a description, which it still uses
  std::map<std::uint32_t, std::string> contents;  // defaults of strings and blocks of bytes, by key
  std::vector<Adapted> adapted;                   // by key
  std::vector<drive::Method> homing_methods;
  drive::Policy policy;
  canopen::Profile can;
  std::unique_ptr<EthercatBlueprint> ethercat;  // nullptr: a drive on CAN
  std::uint32_t encoder_counts = 0;             // per revolution of the motor, from 608Fh; 0: not given
  std::vector<std::string> notes;               // where the interpretation deviates from the file
  std::vector<std::string> not_simulated;       // described features that the reference drive does not simulate

  const dictionary::Entry* find(std::uint16_t index, std::uint8_t sub) const;
};

// Throws describe::DeviceFileError if the file describes no CiA 402 drive, or exceeds the limits.
std::shared_ptr<const Blueprint> make_can_blueprint(describe::DeviceFile device, std::string text = {});

std::shared_ptr<const Blueprint> make_ethercat_blueprint(describe::EsiDevice device);

// The same for a file: an ESI file, which is XML, or an electronic data sheet or device configuration file. `device`
// selects a device of an ESI file with several.
std::shared_ptr<const Blueprint> read_blueprint(const std::string& path, const std::string& device);

// Content for the device's documents. The result refers to the blueprint.
describe::Description description_of(const Blueprint& blueprint);

// Bytes of non-volatile memory for its stored objects, in two banks.
std::uint32_t store_bytes(const Blueprint& blueprint);

}  // namespace servodrome::described
