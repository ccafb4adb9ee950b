#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <string>

#include "draws.hpp"
#include "drive/drive.hpp"
#include "drive/velocity_margin.hpp"
#include "line/support.hpp"

// The loops of each product and size with its factory gains, on the machine of a line file: power stage with delay and
// dead time, noise, eccentric encoder.
namespace servodrome::line {
namespace product_margins_test {
namespace {

std::string line_of(const Product& product, std::string_view model, bool ideal) {
  const bool can = product.fieldbus == Fieldbus::can;
  return fmt::format(
      "clock=\"virtual\"\n[[bus]]\nname=\"b\"\n{}[[axis]]\nname=\"x\"\nproduct=\"{}\"\nbus=\"b\"\n{}{}{}",
      can ? "" : "type=\"ethercat\"\n", product.name, can ? "node=1\n" : "",
      model.empty() ? "" : fmt::format("model=\"{}\"\n", model), ideal ? "ideal=true\n" : "");
}

struct Case {
  const Product* product;
  std::string model;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Product& product : all_products()) {
    if (product.models.empty()) all.push_back({&product, ""});
    for (const products::Model& model : product.models) all.push_back({&product, std::string(model.name)});
  }
  return all;
}

// The cascade with the configuration of the drive on the plant of the axis, with a weight as the load. Friction would
// distort the sine, and so would the dead time at each zero crossing of the current.
drive::test::Axis cascade_of(Axis& axis) {
  plant::Parameters parameters = axis.plant().parameters();
  parameters.load.viscous_friction_nms = 0.0;
  parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.0;
  parameters.load.gravity_torque_nm = 0.5 * parameters.motor.rated_torque_nm;
  parameters.motor.cogging_torque_nm = 0.0;
  parameters.supply.charged_at_start = true;
  const drive::Configuration& its = axis.device().drive().configuration();
  drive::test::Axis cascade(parameters);
  cascade.motor = its.motor;
  cascade.gains = its.gains;
  cascade.rates = its.rates.velocity_loop_ticks == 0 ? drive::Rates{} : its.rates;
  cascade.configure();
  return cascade;
}

drive::test::Margin margin_of(const Case& each, bool ideal) {
  Line line(test::settings_of(line_of(*each.product, each.model, ideal)));
  line.run_until(std::chrono::milliseconds(200));
  Axis& axis = *line.axes().front();
  EXPECT_EQ(axis.plant().parameters().stage.ideal, ideal);
  drive::test::Axis cascade = cascade_of(axis);
  return drive::test::velocity_margin(cascade, 2.0, 700.0);
}

// The reference drive, ISMC and ProNet are tuned to 55 degrees with all delays (gains.hpp); sampling at 8 kHz reduces
// this by up to 2 degrees. The factory gains of iSMK and JMC are those of their manuals: a real machine must have the
// same margin as an ideal one.
TEST(ProductMargins, FactoryGainsKeepTheirPhaseMarginOnARealMachine) {
  const std::vector<Case> all = cases();
  for (std::size_t i = 0; i < all.size(); i += servodrome::test::stride) {
    const Case& each = all[i];
    SCOPED_TRACE(fmt::format("{} {}", each.product->name, each.model));
    const drive::test::Margin ideal = margin_of(each, true);
    const drive::test::Margin real = margin_of(each, false);
    EXPECT_NEAR(real.crossover_hz, ideal.crossover_hz, 0.05 * ideal.crossover_hz);
    if (each.model.empty()) {
      EXPECT_GT(real.degrees, 53.0);
    } else {
      EXPECT_GT(real.degrees, ideal.degrees - 2.0);
    }
  }
}

}  // namespace
}  // namespace product_margins_test
}  // namespace servodrome::line
