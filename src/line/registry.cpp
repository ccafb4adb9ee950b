#include "line/registry.hpp"

#include <array>
#include <map>
#include <string>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk.hpp"
#include "products/pronet/pronet.hpp"

namespace servodrome::line {
namespace {

template <typename Model>
std::shared_ptr<products::Device> make(const products::Settings& settings) {
  return std::make_shared<Model>(settings);
}

// The object table of a product is a constant of its code; the device that shows it is made for nothing else.
template <typename Model>
std::span<const dictionary::Entry> table_of() {
  Model model{products::Settings{}};
  return model.dictionary().table();
}

describe::Description describe_ismc() {
  describe::Description description;
  description.vendor_name = "ISMC";
  description.product_name = "Sapphire";  // ISMC manual L3001
  description.order_code = "ismc";        // not printed; the name on a line
  description.bit_rates_kbit = {20, 50, 125, 250, 500, 800, 1000};
  description.table = table_of<products::Ismc>();
  description.file.name = "ISMC.eds";  // ISMC manual L2871
  description.file.description = "ISMC servo drive, CANopen, as servodrome simulates it";
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

describe::Description describe_pronet() {
  describe::Description description;
  description.vendor_name = "ESTUN";
  description.product_name = "ProNet";
  description.order_code = "pronet";                       // not printed; the name on a line
  description.bit_rates_kbit = {50, 125, 250, 500, 1000};  // and 100, which CiA 306 does not know (L2042)
  description.dummy_usage = {false, true, true, true, true, true, true};  // 0002h to 0007h (L2375-2380)
  description.table = table_of<products::Pronet>();
  description.file.name = "ProNet.eds";
  description.file.description = "ESTUN ProNet servo drive, CANopen, as servodrome simulates it";
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

describe::Description describe_generic402() {
  describe::Description description;
  description.vendor_name = "Servodrome";
  description.product_name = "Generic CiA 402 drive";
  description.order_code = "generic402";
  description.bit_rates_kbit = {10, 20, 50, 125, 250, 500, 800, 1000};
  description.lss_supported = true;
  description.table = table_of<products::Generic402>();
  description.file.name = "generic402.eds";
  description.file.description = "Reference drive with everything CiA 402-2 has";
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

describe::Description describe_ismk() {
  describe::Description description;
  description.vendor_name = "Kinco";
  description.product_name = "iSMK";
  description.order_code = "ismk";
  description.bit_rates_kbit = {10, 50, 125, 250, 500, 1000};  // iSMK manual L3211
  description.table = table_of<products::Ismk>();
  description.file.name = "iSMK.eds";
  description.file.description = "Kinco iSMK integrated servo, variant AA, as servodrome simulates it";
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

constexpr std::array generic402_protocols{products::SerialProtocol::modbus_rtu};
constexpr SerialInterface generic402_serial{
    .protocols = generic402_protocols,
    .has_own_station = true,
    .supports = [](const modbus::CharacterFormat& format) { return format.data_bits == 8; },
    .profile = &products::Generic402::modbus_profile,
    .registers = products::Generic402::registers,
};

constexpr std::array ismk_protocols{products::SerialProtocol::serial10, products::SerialProtocol::modbus_rtu};
constexpr SerialInterface ismk_serial{
    .protocols = ismk_protocols,
    .has_own_station = false,
    .supports = products::Ismk::supports,
    .profile = &products::Ismk::modbus_profile,
    .registers = products::Ismk::registers,
};

const std::array products{
    // Wiring: ISMC manual L2680.
    Product{"ismc",
            "ISMC servo drive, CANopen",
            make<products::Ismc>,
            products::Ismc::factory_node_id,
            6,
            {0, 1, 2},
            describe_ismc},
    // Terminals CN1_14 to CN1_17 and CN1_39 to CN1_42; POT, NOT and the reference switch where Pn509 and Pn510 have
    // them
    // from the factory.
    Product{"pronet",
            "ESTUN ProNet servo drive, CANopen",
            make<products::Pronet>,
            products::Pronet::factory_node_id,
            8,
            {3, 2, 4},
            describe_pronet},
    Product{"generic402",
            "Reference drive with everything CiA 402-2 has",
            make<products::Generic402>,
            products::Generic402::factory_node_id,
            8,
            {0, 1, 2},
            describe_generic402,
            &generic402_serial},
    // Two terminals, iSMK manual L664-671; the home switch would be a third.
    Product{"ismk",
            "Kinco iSMK integrated servo, CANopen and RS485",
            make<products::Ismk>,
            products::Ismk::factory_node_id,
            4,
            {0, 1, 2},
            describe_ismk,
            &ismk_serial,
            products::ismk::ratings,
            products::ismk::default_rating},
};

}  // namespace

std::span<const Product> all_products() { return products; }

std::span<const std::byte> data_sheet(const Product& product) {
  static std::map<std::string_view, std::string> sheets;
  if (product.describe == nullptr) return {};
  std::string& sheet = sheets[product.name];
  if (sheet.empty()) sheet = describe::eds(product.describe());
  return std::as_bytes(std::span(sheet));
}

std::string_view name_of(products::SerialProtocol protocol) {
  switch (protocol) {
    case products::SerialProtocol::modbus_rtu: return "modbus";
    case products::SerialProtocol::serial10: return "serial10";
  }
  return "";
}

const Product* find_product(std::span<const Product> among, std::string_view name) {
  for (const Product& product : among) {
    if (product.name == name) return &product;
  }
  return nullptr;
}

}  // namespace servodrome::line
