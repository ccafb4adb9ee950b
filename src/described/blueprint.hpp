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

// What a maker's description comes to: the tables of a drive that are constants of the other products.
namespace servodrome::described {

// A file beyond this describes no servo drive; each object takes memory in every axis of a line.
inline constexpr std::size_t most_entries = 32768;

// An object of a standard index whose number has another size than the reference drive's: its value goes to and from
// the drive's field by way of `reference`.
struct Adapted {
  std::uint32_t key = 0;
  dictionary::Entry reference;
};

// What a description says of a slave beyond its objects. Refers to its own strings: not to be moved.
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

  describe::DeviceFile device;             // its strings are the table's names
  std::string text;                        // of the file: what 1021h holds
  std::vector<dictionary::Entry> table;    // offsets into the device's objects struct and what comes behind it
  std::size_t object_bytes = 0;            // of both
  std::vector<dictionary::Entry> implied;  // objects of the reference drive that are not described; it works with them
  std::map<std::uint32_t, std::string> contents;  // defaults of strings and blocks of bytes, by key
  std::vector<Adapted> adapted;                   // by key
  std::vector<drive::Method> homing_methods;
  drive::Policy policy;
  canopen::Profile can;
  std::unique_ptr<EthercatBlueprint> ethercat;  // nullptr: it stands on CAN
  std::uint32_t encoder_counts = 0;             // per revolution of the motor, as 608Fh says; 0: it does not
  std::vector<std::string> notes;               // where the file was taken otherwise than it is written
  std::vector<std::string> not_simulated;       // what it describes and the reference drive does not do

  const dictionary::Entry* find(std::uint16_t index, std::uint8_t sub) const;
};

// Throws describe::DeviceFileError if the file describes no drive of CiA 402, or more than can be.
std::shared_ptr<const Blueprint> make_can_blueprint(describe::DeviceFile device, std::string text = {});

std::shared_ptr<const Blueprint> make_ethercat_blueprint(describe::EsiDevice device);

// The same of a file: an ESI file, which is XML, or an electronic data sheet or device configuration file. `device` is
// one of several that an ESI file has.
std::shared_ptr<const Blueprint> read_blueprint(const std::string& path, const std::string& device);

// The device's documents. Refers to the blueprint.
describe::Description description_of(const Blueprint& blueprint);

// Bytes of non-volatile memory that its stored objects need, with their two banks.
std::uint32_t store_bytes(const Blueprint& blueprint);

}  // namespace servodrome::described
