#include "line/registry.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/jmc_ec/jmc_ec.hpp"
#include "products/pronet/pronet.hpp"

namespace servodrome::line {
namespace {

template <typename Model>
std::shared_ptr<products::Device> make(const products::Settings& settings) {
  return std::make_shared<Model>(settings);
}

template <typename Model>
void describe_objects(describe::Description& description) {
  description.service_table = Model::table;
  if constexpr (requires { Model::bus_table; }) {
    description.table = Model::bus_table;
  } else {
    description.table = Model::table;
  }
}

// `order_code` is not the code printed on the product but its name on a line.
template <typename Model>
describe::Description description_of(const char* vendor, const char* product, const char* order_code,
                                     std::vector<unsigned> bit_rates_kbit, const char* file, const char* text) {
  describe::Description description;
  description.vendor_name = vendor;
  description.product_name = product;
  description.order_code = order_code;
  description.bit_rates_kbit = std::move(bit_rates_kbit);
  describe_objects<Model>(description);
  if constexpr (requires { Model::ethercat_profile; }) {
    description.ethercat = {&Model::ethercat_profile, Model::sii_description({}), Model::sii_bytes};
  }
  description.file.name = file;
  description.file.description = text;
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

// Adds the models of an EtherCAT product that have a product code of their own, because masters tell them apart.
template <typename Model>
void add_models(describe::Description& description, std::span<const products::Model> models) {
  std::vector<ethercat::SiiDescription>& others = description.ethercat->other_models;
  for (const products::Model& model : models) {
    const ethercat::SiiDescription sii = Model::sii_description({.model = model.name});
    const auto same = [&sii](const ethercat::SiiDescription& one) { return one.product_code == sii.product_code; };
    if (!same(description.ethercat->sii) && std::none_of(others.begin(), others.end(), same)) others.push_back(sii);
  }
}

describe::Description describe_ismc() {  // ISMC manual, ch. 6
  return description_of<products::Ismc>("ISMC", "Sapphire", "ismc", {20, 50, 125, 250, 500, 800, 1000}, "ISMC.eds",
                                        "ISMC servo drive, CANopen, as servodrome simulates it");
}

describe::Description describe_pronet() {  // ProNet manual, ch. 8, Pn703
  auto description =
      description_of<products::Pronet>("ESTUN", "ProNet", "pronet", {50, 100, 125, 250, 500, 1000}, "ProNet.eds",
                                       "ESTUN ProNet servo drive, CANopen, as servodrome simulates it");
  description.dummy_usage = {false, true, true, true, true, true, true};  // 0002h to 0007h (appendix)
  return description;
}

describe::Description describe_generic402() {
  auto description = description_of<products::Generic402>("Servodrome", "Generic CiA 402 drive", "generic402",
                                                          {10, 20, 50, 125, 250, 500, 800, 1000}, "generic402.eds",
                                                          "Reference drive with everything CiA 402-2 has");
  description.lss_supported = true;
  return description;
}

describe::Description describe_generic402_ec() {
  return description_of<products::Generic402Ec>("Servodrome", "Generic CiA 402 drive", "generic402-ec", {},
                                                "generic402-ec",
                                                "Reference drive with everything CiA 402-2 has, EtherCAT");
}

describe::Description describe_ismk() {  // iSMK manual, Table 9-26, 2F81h
  return description_of<products::Ismk>("Kinco", "iSMK", "ismk", {10, 50, 125, 250, 500, 1000}, "iSMK.eds",
                                        "Kinco iSMK integrated servo, variant AA, as servodrome simulates it");
}

describe::Description describe_ismk_ea() {
  auto description = description_of<products::IsmkEa>(
      "Kinco", "iSMK", "ismk-ea", {}, "ismk-ea", "Kinco iSMK integrated servo, variant EA, as servodrome simulates it");
  add_models<products::IsmkEa>(description, products::ismk::ratings);
  return description;
}

describe::Description describe_jmc_ec() {  // vendor's name: JMC manual, routine for INovance, 'Add device'
  const char* name = products::jmc_ec::find_rating({}).device_name;
  auto description = description_of<products::JmcEc>("ShenZhen Just motion control", name, name, {}, "jmc_ec",
                                                     "JMC EC series servo, EtherCAT, as servodrome simulates it");
  add_models<products::JmcEc>(description, products::jmc_ec::models);
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

constexpr SerialInterface ismk_ea_serial = [] {
  SerialInterface serial = ismk_serial;
  serial.has_own_station = true;  // there is no node-ID to serve as the station
  return serial;
}();

constexpr std::array jmc_ec_protocols{products::SerialProtocol::modbus_rtu};
constexpr SerialInterface jmc_ec_serial{
    .protocols = jmc_ec_protocols,
    .has_own_station = true,
    .supports = products::JmcEc::supports,
    .profile = &products::JmcEc::modbus_profile,
    .registers = products::JmcEc::registers,
};

const std::array products{
    // Wiring: ISMC manual, ch. 4.8.2.1, 60FDh.
    Product{"ismc",
            "ISMC servo drive, CANopen",
            make<products::Ismc>,
            products::Ismc::factory_node_id,
            6,
            {0, 1, 2},
            describe_ismc},
    // Terminals CN1_14 to CN1_17 and CN1_39 to CN1_42. POT, NOT and the reference switch are at the factory settings of
    // Pn509 and Pn510.
    Product{"pronet",
            "ESTUN ProNet servo drive, CANopen",
            make<products::Pronet>,
            products::Pronet::factory_node_id,
            8,
            {3, 2, 4},
            describe_pronet,
            nullptr,
            {},
            {},
            Fieldbus::can,
            0},
    Product{"generic402",
            "Reference drive with everything CiA 402-2 has, CANopen and RS485",
            make<products::Generic402>,
            products::Generic402::factory_node_id,
            8,
            {0, 1, 2},
            describe_generic402,
            &generic402_serial},
    // The drive has two terminals (iSMK manual, Table 3-9) for limit switches; the home switch is on the next input.
    Product{"ismk",
            "Kinco iSMK integrated servo, CANopen and RS485",
            make<products::Ismk>,
            products::Ismk::factory_node_id,
            4,
            {0, 1, 2},
            describe_ismk,
            &ismk_serial,
            products::ismk::ratings,
            products::ismk::default_rating,
            Fieldbus::can,
            products::ismk::output_count},
    Product{.name = "generic402-ec",
            .title = "Reference drive with everything CiA 402-2 has, EtherCAT",
            .make = make<products::Generic402Ec>,
            .input_wires = 8,
            .wiring = {0, 1, 2},
            .describe = describe_generic402_ec,
            .fieldbus = Fieldbus::ethercat},
    Product{.name = "ismk-ea",
            .title = "Kinco iSMK integrated servo, EtherCAT and RS485",
            .make = make<products::IsmkEa>,
            .input_wires = 4,
            .wiring = {0, 1, 2},
            .describe = describe_ismk_ea,
            .serial = &ismk_ea_serial,
            .models = products::ismk::ratings,
            .default_model = products::ismk::default_rating,
            .fieldbus = Fieldbus::ethercat,
            .output_wires = products::ismk::output_count},
    // CW-, HW+, CCW+, DI3 and DI4, JMC manual, ch. 3.1.2; CW is positive.
    Product{.name = "jmc_ec",
            .title = "JMC EC series, integrated servos and stepper drives, EtherCAT",
            .make = make<products::JmcEc>,
            .input_wires = 5,
            .wiring = {2, 0, 1},
            .describe = describe_jmc_ec,
            .serial = &jmc_ec_serial,
            .models = products::jmc_ec::models,
            .default_model = products::jmc_ec::default_rating,
            .fieldbus = Fieldbus::ethercat,
            .output_wires = 2},  // alarm and in position (ch. 3.1.2)
};

}  // namespace

std::span<const Product> all_products() { return products; }

std::span<const std::byte> data_sheet(const Product& product) {
  static std::mutex mutex;  // several threads may build lines at the same time
  static std::map<std::string_view, std::string> sheets;
  if (product.describe == nullptr || product.fieldbus != Fieldbus::can || product.blueprint != nullptr) return {};
  const std::lock_guard lock(mutex);
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
