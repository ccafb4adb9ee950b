#pragma once

#include <istream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"
#include "host/object_client.hpp"

namespace servodrome::host {

// A value of a parameter, as a file has it.
struct ParameterValue {
  ObjectAddress address{};
  dictionary::Type type = dictionary::Type::unsigned32;
  std::vector<std::byte> bytes{};  // little endian, as it travels
  bool adds_node_id = false;       // the value is `bytes` + the node-ID of whatever drive takes it
  std::string unit{};              // for people, as `name` is
  std::string name{};
  unsigned line = 0;  // where it stands in its file, from 1; 0: it came from a drive
  unsigned column = 0;
};

// Whose parameters they are.
struct DriveIdentity {
  std::string product{};                        // as `servodrome products` lists it; empty: not known
  std::optional<std::uint32_t> vendor_id{};     // 1018h sub 1
  std::optional<std::uint32_t> product_code{};  // 1018h sub 2
  std::optional<std::uint32_t> revision{};      // 1018h sub 3
  std::string device_name{};                    // 1008h
  std::string software_version{};               // 100Ah

  // Asks the drive. What it does not tell is left empty. Throws HostError if it does not answer.
  static DriveIdentity read(ObjectClient& objects, std::string_view product);
  // By vendor and product code, or by name where one of them does not know these; nothing if that cannot be told.
  std::optional<bool> is_same_product(const DriveIdentity& other) const;
  std::string text() const;  // "ismc (vendor 0000029Ch, product 00000001h)"
};

// Parameters of a drive as text: one line each, in order of address, so that two files can be compared line by line.
//
//     # servodrome parameters 1
//     product: generic402
//     vendor: 53455256h
//     6099:01  u32  262144  [vel]  Homing speeds.Speed during search for switch
//     1800:01  u32  $NODEID+180h   TPDO 1 communication parameter.COB-ID used by PDO
//     end
//
// The first line is as above; other lines that begin with # are comments. `KEY: VALUE` lines come before the
// parameters. A parameter is index and sub-index in hexadecimal, its type (i8 .. i64, u8 .. u64, bool, f32, string,
// bytes), its value, and for people its unit and name. Numbers are decimal, or hexadecimal with h; text stands in
// quotes, with \" and \\ and \xHH; bytes are pairs of hexadecimal digits, or - if there are none. The last line says
// that the file is complete.
struct ParameterFile {
  DriveIdentity identity{};
  std::string date{};  // empty: the same parameters give the same file
  std::vector<ParameterValue> values{};

  const ParameterValue* find(ObjectAddress address) const;
  std::string text() const;
  // `name` stands in messages. Throws HostError, whose where() is "NAME:LINE:COLUMN"; nothing that is no finite number
  // passes.
  static ParameterFile read(std::istream& in, const std::string& name);
};

// The value as a file has it.
std::string text_of(const ParameterValue& value);
// Resolves what is relative to the node-ID. Throws HostError if there is none.
std::vector<std::byte> bytes_for(const ParameterValue& value, std::optional<std::uint8_t> node_id);

}  // namespace servodrome::host
