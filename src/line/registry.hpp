#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "describe/description.hpp"
#include "products/device.hpp"
#include "products/model.hpp"

namespace servodrome::described {
struct Blueprint;
}

// The products that a line can have.
namespace servodrome::line {

// The input wires to which a product's manual connects the switches of a travel.
struct SwitchWiring {
  std::uint8_t negative_limit = 0;
  std::uint8_t positive_limit = 1;
  std::uint8_t home = 2;
};

// The RS485 port of a product.
struct SerialInterface {
  std::span<const products::SerialProtocol> protocols;  // supported ones; the factory setting is first
  bool has_own_station = false;                         // its station may differ from the node-ID
  bool (*supports)(const modbus::CharacterFormat& format) = nullptr;
  const modbus::Profile* profile = nullptr;
  std::span<const modbus::Register> registers;
};

enum class Fieldbus : std::uint8_t { can, ethercat };

struct Product {
  std::string_view name;   // in line files and commands
  std::string_view title;  // for people, one line
  std::function<std::shared_ptr<products::Device>(const products::Settings& settings)> make;
  std::uint8_t factory_node_id = 1;
  std::uint8_t input_wires = 6;  // DI0 ..
  SwitchWiring wiring{};
  std::function<describe::Description()> describe{};  // for data sheets and reference pages
  const SerialInterface* serial = nullptr;            // nullptr: it has no RS485 port
  std::span<const products::Model> models{};          // sizes with their own motors; empty: any motor
  std::string_view default_model{};
  Fieldbus fieldbus = Fieldbus::can;
  std::uint8_t output_wires = 4;          // DO0 ..
  std::uint32_t store_bytes = 32 * 1024;  // of the store: two banks, each several times the size of the saved objects
  const described::Blueprint* blueprint = nullptr;  // if the product comes from a maker's description
};

std::span<const Product> all_products();

// The product's EDS as the device stores it (1021h), made at the first call. Thread-safe. Empty for a product that is
// not on CAN, has no `describe` or comes from a maker's description.
std::span<const std::byte> data_sheet(const Product& product);

// The protocol's name in line files and commands: "modbus", "serial10".
std::string_view name_of(products::SerialProtocol protocol);

// Returns nullptr if no product has this name.
const Product* find_product(std::span<const Product> products, std::string_view name);

}  // namespace servodrome::line
