#include "catalogue.hpp"

#include <charconv>
#include <stdexcept>
#include <string_view>

#include "drive/drive.hpp"
#include "line/line.hpp"
#include "line/model_plant.hpp"

namespace servodrome::motion {
namespace {

Variant variant_of(const line::Product& product, std::string_view model) {
  Sequence alone;
  alone.axes.emplace_back();
  alone.axes.back().product = product.name;
  alone.axes.back().model = model;
  line::Line line(line_settings(alone));
  const drive::Drive& drive = line.axes().front()->device().drive();
  Variant variant;
  variant.product = &product;
  variant.model = model;
  variant.units = drive.axis().units;
  variant.max_speed_rpm = static_cast<double>(drive.configuration().motor.max_speed_rpm);
  variant.modes = drive.policy().modes.supported;
  variant.records = drive.policy().interpolation.source != drive::Interpolation::target;
  for (const drive::Method& method : drive.policy().homing.methods) {
    variant.homing_methods.push_back(static_cast<std::uint16_t>(method.number));
  }
  dictionary::Dictionary& objects = line.axes().front()->device().bus_dictionary();
  for (const std::uint16_t index :
       std::to_array<std::uint16_t>({0x1016, 0x6007, 0x607B, 0x607C, 0x607E, 0x6082, 0x60B8, 0x60F2})) {
    const bool array = index == 0x1016 || index == 0x607B;
    if (objects.find(index, array ? 1 : 0) != nullptr) variant.objects.push_back(index);
  }
  return variant;
}

// In place of a size, a product without sizes may have an encoder: "encoder-10000" has 10000 counts per revolution.
constexpr std::string_view encoder_size = "encoder-";

std::int32_t encoder_of(std::string_view size) {
  std::int32_t counts = 0;
  if (size.starts_with(encoder_size)) {
    const std::string_view digits = size.substr(encoder_size.size());
    std::from_chars(digits.data(), digits.data() + digits.size(), counts);
  }
  if (counts <= 0) throw std::invalid_argument("there is no size \"" + std::string(size) + "\"");
  return counts;
}

line::AxisSettings axis_settings(const AxisSetup& setup, std::size_t number) {
  line::AxisSettings axis;
  axis.name = "a" + std::to_string(number);
  axis.product = line::find_product(line::all_products(), setup.product);
  if (axis.product == nullptr) throw std::invalid_argument("there is no product \"" + setup.product + "\"");
  axis.model = setup.model.empty() ? axis.product->default_model : setup.model;
  if (!axis.product->models.empty()) {
    const products::Model* model = products::find_model(axis.product->models, axis.model);
    if (model == nullptr) throw std::invalid_argument(setup.product + " has no model \"" + axis.model + "\"");
    line::fit_model(*model, axis.plant);
  } else if (!setup.model.empty()) {
    axis.model = {};
    axis.plant.encoder.counts_per_revolution = encoder_of(setup.model);
  }
  plant::Parameters& plant = axis.plant;
  plant.supply.charged_at_start = true;
  plant.load.inertia_kgm2 *= static_cast<double>(setup.inertia_percent) / 100.0;
  // Friction in the same proportion to the rated torque as that of the default load to the default motor.
  const double rated = plant.motor.rated_torque_nm;
  plant.load.coulomb_friction_nm = 0.008 * rated * static_cast<double>(setup.friction_percent) / 100.0;
  plant.load.static_friction_nm = 1.5 * plant.load.coulomb_friction_nm;
  plant.load.viscous_friction_nms = 1e-5 * rated;
  plant.encoder.start_position_counts = setup.start_counts;
  if (setup.travel_counts > 0) {
    const line::SwitchWiring& wiring = axis.product->wiring;
    plant.switches[0].wire = wiring.negative_limit;
    plant.switches[0].to_counts = -setup.travel_counts;
    plant.switches[1].wire = wiring.positive_limit;
    plant.switches[1].from_counts = setup.travel_counts;
    plant.switches[2].wire = wiring.home;
    plant.switches[2].from_counts = -setup.travel_counts / 16;
    plant.switches[2].to_counts = setup.travel_counts / 16;
    plant.switch_count = 3;
  }
  if (setup.stop_counts > 0) {
    plant.load.low_stop_counts = -setup.stop_counts;
    plant.load.high_stop_counts = setup.stop_counts;
  }
  axis.motor_data = line::motor_data_of(plant);
  axis.serial_number = static_cast<std::uint32_t>(number + 1);
  if (axis.product->fieldbus == line::Fieldbus::ethercat) {
    axis.ethercat = line::AxisEthercatSettings{};
  } else {
    axis.bus = 0;
    axis.node_id = static_cast<std::uint8_t>(number + 1);
  }
  return axis;
}

}  // namespace

std::vector<Variant> variants(std::string_view only) {
  std::vector<Variant> all;
  for (const line::Product& product : line::all_products()) {
    if (!only.empty() && product.name != only) continue;
    if (product.models.empty()) all.push_back(variant_of(product, {}));
    // A variant with the incremental encoder, which starts at 0 after each power-on and has an index.
    if (product.name == "pronet") all.push_back(variant_of(product, "encoder-10000"));
    for (const products::Model& model : product.models) all.push_back(variant_of(product, model.name));
  }
  return all;
}

line::LineSettings line_settings(const Sequence& sequence) {
  line::LineSettings settings;
  settings.clock = line::ClockMode::virtual_time;
  for (std::size_t i = 0; i < sequence.axes.size(); ++i) settings.axes.push_back(axis_settings(sequence.axes[i], i));
  bool can = false;
  bool ethercat = false;
  for (const line::AxisSettings& axis : settings.axes) (axis.bus ? can : ethercat) = true;
  if (can) settings.buses.push_back({.name = "can0", .links = {}});
  if (ethercat) settings.ethercat_buses.push_back({.name = "ecat", .links = {}});
  return settings;
}

}  // namespace servodrome::motion
