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

// A date and time for documents. The caller passes it, so that the same table always gives the same bytes.
struct Timestamp {
  unsigned year = 2000;
  unsigned month = 1;
  unsigned day = 1;
  unsigned hour = 0;
  unsigned minute = 0;
};

// Information of an EDS about the file itself (CiA 306-1, [FileInfo]).
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

// Data of a device on EtherCAT that no object contains: the same as its slave uses and its information memory holds.
struct EthercatDescription {
  const ethercat::Profile* profile = nullptr;
  ethercat::SiiDescription sii;
  std::size_t sii_bytes = 0;  // size of the memory
  // Other sizes of the product, each with its own product code: each is a device in the ESI file.
  std::vector<ethercat::SiiDescription> other_models = {};
};

// A device for its documents: the object table, and data that no object contains. Vendor, product and revision number
// come from 1018h; the numbers of PDOs come from 1400h and 1800h and following.
struct Description {
  std::string vendor_name;
  std::string product_name;
  std::string order_code;
  std::string url = {};                  // page of the product; may be empty
  std::vector<unsigned> bit_rates_kbit;  // only 10, 20, 50, 125, 250, 500, 800 and 1000 appear in an EDS
  std::uint8_t granularity_bits = 8;     // of PDO mapping, if the table allows changes of it
  bool simple_boot_up_master = false;
  bool simple_boot_up_slave = true;
  bool group_messaging = false;  // multiplexed PDOs
  bool lss_supported = false;
  std::array<bool, 7> dummy_usage{};                      // data types 0001h to 0007h as dummies in RPDO mappings
  std::span<const dictionary::Entry> table;               // objects of the fieldbus
  std::span<const dictionary::Entry> service_table = {};  // ... and of the service port: includes local objects
  std::optional<EthercatDescription> ethercat = {};       // nullopt: not on EtherCAT
  FileMetadata file;
};

// Writes an electronic data sheet, version 4.0 (CiA 306-1), ASCII with CR LF. Objects below 1000h (data types) are
// omitted.
std::string eds(const Description& description);

// Writes EtherCAT slave information (ETG.2000), XML in UTF-8, with the content of the SII image and the dictionary.
// Returns an empty text for a device that is not on EtherCAT.
std::string esi(const Description& device);

// Returns the factory content of the slave information memory; empty for a device that is not on EtherCAT.
std::vector<std::uint8_t> sii(const Description& device);

// One line for each entry, LF, with the columns index,sub,name,type,access,pdo,default,min,max,unit,saved. The limits
// are empty if the value has no limits besides those of its type.
std::string csv(std::span<const dictionary::Entry> table);

// The Modbus registers of a device in order of their addresses, LF, with the columns
// register,words,index,sub,name,type,access,min,max,unit; register, index and sub-index are hexadecimal.
std::string register_list(std::span<const modbus::Register> registers, std::span<const dictionary::Entry> table);

// A reference page: data of the device, then a table for each group of objects.
std::string markdown(const Description& description);

}  // namespace servodrome::describe
