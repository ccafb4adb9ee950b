#include "line/described_product.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>

#include "described/can_drive.hpp"
#include "described/ethercat_drive.hpp"

namespace servodrome::line {
namespace {

// Owns the strings that a Product refers to.
struct DescribedProduct {
  std::shared_ptr<const described::Blueprint> blueprint;
  std::string name;
  std::string title;
  Product product;
};

std::shared_ptr<Product> described_product_of(std::shared_ptr<const described::Blueprint> blueprint, const char* kind,
                                              const std::string& path) {
  const auto made = std::make_shared<DescribedProduct>();
  made->blueprint = std::move(blueprint);
  const describe::DeviceFile& device = made->blueprint->device;
  made->name = fmt::format("{}:{}", kind, std::filesystem::path(path).filename().string());
  made->title = fmt::format("{} {}, as its description has it", device.vendor_name, device.product_name);
  Product& product = made->product;
  product.name = made->name;
  product.title = made->title;
  product.input_wires = 8;
  product.store_bytes = std::max(product.store_bytes, described::store_bytes(*made->blueprint));
  product.blueprint = made->blueprint.get();
  product.describe = [its = made->blueprint.get()] { return described::description_of(*its); };
  return {made, &made->product};
}

template <typename Drive>
auto maker_of(std::shared_ptr<const described::Blueprint> blueprint) {
  return [blueprint = std::move(blueprint)](const products::Settings& settings) -> std::shared_ptr<products::Device> {
    return std::make_shared<Drive>(blueprint, settings);
  };
}

}  // namespace

std::shared_ptr<const Product> describe_product(const std::string& path, const std::string& device) {
  auto blueprint = described::read_blueprint(path, device);
  const bool on_ethercat = blueprint->ethercat != nullptr;
  const auto made = described_product_of(blueprint, on_ethercat ? "esi" : "eds", path);
  if (on_ethercat) {
    made->fieldbus = Fieldbus::ethercat;
    made->make = maker_of<described::EthercatDrive>(blueprint);
  } else {
    made->factory_node_id = described::CanDrive::factory_node_id;
    made->make = maker_of<described::CanDrive>(blueprint);
  }
  return made;
}

void fit_encoder(const Product& product, plant::Parameters& plant) {
  if (product.blueprint == nullptr || product.blueprint->encoder_counts == 0) return;
  plant.encoder.counts_per_revolution = static_cast<std::int32_t>(product.blueprint->encoder_counts);
}

}  // namespace servodrome::line
