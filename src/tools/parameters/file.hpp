#pragma once

#include <istream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// The value of a parameter in a file.
struct ParameterValue {
  ObjectAddress address{};
  dictionary::Type type = dictionary::Type::unsigned32;
  std::vector<std::byte> bytes{};  // little endian, as on the bus
  bool adds_node_id = false;       // the value is `bytes` + the node-ID of the drive it is loaded into
  std::string unit{};              // unit and name are only for the reader
  std::string name{};
  unsigned line = 0;  // position in the file, from 1; 0: read from a drive
  unsigned column = 0;
};

// Identity of the drive that parameters belong to.
struct DriveIdentity {
  std::string product{};                        // name in the list of `servodrome products`; empty: unknown
  std::optional<std::uint32_t> vendor_id{};     // 1018h sub 1
  std::optional<std::uint32_t> product_code{};  // 1018h sub 2
  std::optional<std::uint32_t> revision{};      // 1018h sub 3
  std::string device_name{};                    // 1008h
  std::string software_version{};               // 100Ah

  // Reads the identity from the drive. Objects that it does not have are left empty. Throws MasterError if it does not
  // answer.
  static DriveIdentity read(ObjectClient& objects, std::string_view product);
  // Compares vendor and product code, or the product name if one side lacks the codes; nullopt if this is not possible.
  std::optional<bool> is_same_product(const DriveIdentity& other) const;
  std::string text() const;  // for example "ismc (vendor 0000029Ch, product 00000001h)"
};

// Parameters of a drive as text: one line for each, sorted by address, so that two files can be compared line by line.
//
//  # servodrome parameters 1
//  product: generic402
//  vendor: 53455256h
//  1800:01  u32  $NODEID+180h   TPDO 1 communication parameter.COB-ID used by PDO
//  6099:01  u32  262144  [vel]  Homing speeds.Speed during search for switch
//  end
//
// The first line is as above; other lines that begin with # are comments. `KEY: VALUE` lines come before the
// parameters. A parameter consists of index and sub-index in hexadecimal, type (i8 .. i64, u8 .. u64, bool, f32,
// string, bytes), value, and for the reader unit and name. Numbers are decimal, or hexadecimal with h. Text is in
// quotes, with \" and \\ and \xHH. Bytes are pairs of hexadecimal digits, or - if there are none. The last line marks
// the file as complete.
struct ParameterFile {
  DriveIdentity identity{};
  std::string date{};  // empty by default, so that the same parameters give the same file
  std::vector<ParameterValue> values{};

  const ParameterValue* find(ObjectAddress address) const;
  std::string text() const;
  // `name` appears in error messages. Throws MasterError, whose where() is "NAME:LINE:COLUMN". Rejects infinite numbers
  // and NaN.
  static ParameterFile read(std::istream& in, const std::string& name);
};

// The value in the format of a file.
std::string text_of(const ParameterValue& value);
// The bytes to write; adds the node-ID if the value is relative to it. Throws MasterError if it is needed and not
// given.
std::vector<std::byte> bytes_for(const ParameterValue& value, std::optional<std::uint8_t> node_id);

}  // namespace servodrome::master
