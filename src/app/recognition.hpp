#pragma once

#include <span>
#include <string>
#include <vector>

#include "describe/esi_reader.hpp"
#include "host/modbus/client.hpp"
#include "host/object_client.hpp"
#include "line/registry.hpp"

// What a drive is: by its identity, by makers' descriptions, or by the objects it has.
namespace servodrome::app {

// Makers' descriptions that a scan is given: --eds and --esi.
class Descriptions {
 public:
  // Throws Failure for a file that cannot be read.
  Descriptions(const std::vector<std::string>& eds, const std::vector<std::string>& esi);

  // "AX-402 (drive.eds)" for the device of this vendor and product code; "": none of the files has it.
  std::string name_of(std::uint32_t vendor_id, std::uint32_t product_code) const;

 private:
  std::vector<describe::DeviceFile> sheets_;
  std::vector<std::pair<std::string, std::string>> slave_files_;  // path and text: a file may have many devices
};

// Objects of the makers' own area (2000h to 5FFFh) that of all products of the bus this one alone has, by address and
// size: a few, from all over its table.
std::vector<const dictionary::Entry*> signature_of(const line::Product& product);

// The product whose signature the drive has; nullptr: none, or several. Some objects are read, none is written.
const line::Product* product_by_objects(host::ObjectClient& objects, line::Fieldbus bus);

// The product all of whose registers that are tried the station has; nullptr: none, or several (a station that answers
// at any address). Variants of one product have the same registers: the first of them.
const line::Product* product_by_registers(host::ModbusClient& client, std::uint8_t unit);

}  // namespace servodrome::app
