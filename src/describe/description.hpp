#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dictionary/entry.hpp"
#include "ethercat/sii/image.hpp"
#include "modbus/register_map.hpp"

namespace servodrome::describe {

// A moment as documents print it; handed in, so that the same table always gives the same bytes.
struct Timestamp {
  unsigned year = 2000;
  unsigned month = 1;
  unsigned day = 1;
  unsigned hour = 0;
  unsigned minute = 0;
};

// What an EDS says about itself (CiA 306-1, [FileInfo]).
struct FileMetadata {
  std::string name;  // "drive.eds"
  std::uint8_t version = 1;
  std::uint8_t revision = 0;
  std::string description;
  std::string created_by;
  Timestamp created;
  std::string modified_by;
  Timestamp modified;
  std::vector<std::string> comments;
};

// What no object says of a device on EtherCAT: the same that its slave runs with and its information memory holds.
struct EthercatDescription {
  const ethercat::Profile* profile = nullptr;
  ethercat::SiiDescription sii;
  std::size_t sii_bytes = 0;  // of the memory
  // Other sizes of the product with a product code of their own: each is a device of the ESI file.
  std::vector<ethercat::SiiDescription> other_models = {};
};

// A device as its documents describe it: the object table, and what no object says. Vendor, product and revision number
// come from 1018h, the numbers of PDOs from 1400h and 1800h and following.
struct Description {
  std::string vendor_name;
  std::string product_name;
  std::string order_code;
  std::string url = {};                  // where the product is described; may be empty
  std::vector<unsigned> bit_rates_kbit;  // an EDS tells 10, 20, 50, 125, 250, 500, 800 and 1000
  std::uint8_t granularity_bits = 8;     // of PDO mapping, where the table lets it be changed
  bool simple_boot_up_master = false;
  bool simple_boot_up_slave = true;
  bool group_messaging = false;  // multiplexed PDOs
  bool lss_supported = false;
  std::array<bool, 7> dummy_usage{};                      // data types 0001h to 0007h as fillers in RPDO mappings
  std::span<const dictionary::Entry> table;               // what the fieldbus sees
  std::span<const dictionary::Entry> service_table = {};  // ... and the service port: local objects as well
  std::optional<EthercatDescription> ethercat = {};       // nullopt: it is not on EtherCAT
  FileMetadata file;
};

// Electronic data sheet, version 4.0 (CiA 306-1), ASCII with CR LF. Objects below 1000h (data types) do not appear.
std::string eds(const Description& description);

// EtherCAT slave information (ETG.2000), XML in UTF-8: what the SII image holds, and the dictionary. Empty for a device
// that is not on EtherCAT.
std::string esi(const Description& device);

// The slave information memory as it leaves the factory. Empty for a device that is not on EtherCAT.
std::vector<std::uint8_t> sii(const Description& device);

// One line per entry, LF, with the columns index,sub,name,type,access,pdo,default,min,max,unit,saved. Limits are empty
// where the type is the only limit.
std::string csv(std::span<const dictionary::Entry> table);

// The Modbus registers of a device in the order of their addresses, LF, with the columns
// register,words,index,sub,name,type,access,min,max,unit; register, index and sub-index in hexadecimal.
std::string register_list(std::span<const modbus::Register> registers, std::span<const dictionary::Entry> table);

// A reference page: the device, then a table for each group of objects.
std::string markdown(const Description& description);

}  // namespace servodrome::describe
