#pragma once

#include <span>
#include <string>
#include <vector>

#include "describe/esi_reader.hpp"
#include "line/registry.hpp"
#include "master/modbus/client.hpp"
#include "master/object_client.hpp"

// Recognises the product of a drive: by its identity, by description files, or by its objects.
namespace servodrome::app {

// The description files given to a scan: --eds and --esi.
class Descriptions {
 public:
  // Throws Failure for an unreadable file.
  Descriptions(const std::vector<std::string>& eds, const std::vector<std::string>& esi);

  // "AX-402 (drive.eds)" for the device with this vendor and product code; "": no file describes it.
  std::string name_of(std::uint32_t vendor_id, std::uint32_t product_code) const;

 private:
  std::vector<describe::DeviceFile> sheets_;
  std::vector<std::pair<std::string, std::string>> slave_files_;  // path and text: a file may have many devices
};

// Objects of the manufacturer area (2000h to 5FFFh) that only this product has on its bus, by address and size: a few,
// spread over its table.
std::vector<const dictionary::Entry*> signature_of(const line::Product& product);

// The product whose signature the drive has; nullptr: none, or more than one. Reads some objects, writes none.
const line::Product* product_by_objects(master::ObjectClient& objects, line::Fieldbus bus);

// Reads some registers of each product, and returns the product of which the station has all of them; nullptr: none, or
// more than one, as for a station that answers at any address. Variants of one product have the same registers: returns
// the first variant.
const line::Product* product_by_registers(master::ModbusClient& client, std::uint8_t unit);

}  // namespace servodrome::app
