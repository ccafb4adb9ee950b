#include <cmath>
#include <fstream>
#include <gtest/gtest.h>
#include <sstream>

#include "line/config.hpp"
#include "line/support.hpp"
#include "source_dir.hpp"

// docs/motors.md, the program and the drive's own data of the default motor are the same.
namespace servodrome::line {
namespace motors_test {
namespace {

TEST(Motors, TheDefaultMotorIsTheSameForDriveAndPlant) {
  const drive::MotorData told{};
  const drive::MotorData real = motor_data_of(plant::Parameters{});
  EXPECT_EQ(told.counts_per_revolution, real.counts_per_revolution);
  EXPECT_EQ(told.phases, real.phases);
  EXPECT_EQ(told.pole_pairs, real.pole_pairs);
  for (const auto member :
       {&drive::MotorData::rated_current_a, &drive::MotorData::peak_current_a, &drive::MotorData::rated_torque_nm,
        &drive::MotorData::rated_speed_rpm, &drive::MotorData::max_speed_rpm,
        &drive::MotorData::torque_constant_nm_per_a, &drive::MotorData::resistance_ohm,
        &drive::MotorData::inductance_d_h, &drive::MotorData::inductance_q_h, &drive::MotorData::inertia_kgm2}) {
    EXPECT_NEAR(told.*member, real.*member, 2e-3F * real.*member);
  }
}

TEST(Motors, TheTableOfSizesIsThatOfTheProgram) {
  std::ifstream file(std::string(SERVODROME_SOURCE_DIR) + "/docs/motors.md");
  std::stringstream text;
  text << file.rdbuf();
  const std::string page = text.str();
  for (const Product& product : all_products()) {
    for (const products::Model& model : product.models) {
      SCOPED_TRACE(model.name);
      const std::size_t at = page.find(fmt::format("\n| `{}` |", model.name));
      ASSERT_NE(at, std::string::npos);
      std::istringstream row(page.substr(at, page.find('\n', at + 1) - at));
      std::string cell;
      for (int skipped = 0; skipped < 2; ++skipped) std::getline(row, cell, '|');
      const drive::MotorData& motor = model.motor;
      const float copper_w = 0.5F * static_cast<float>(motor.phases) * motor.resistance_ohm * motor.rated_current_a *
                             motor.rated_current_a;
      for (const float figure :
           {motor.rated_torque_nm, motor.rated_current_a, motor.peak_current_a, motor.torque_constant_nm_per_a,
            motor.resistance_ohm, 1e3F * motor.inductance_q_h, motor.inertia_kgm2, copper_w}) {
        std::getline(row, cell, '|');
        EXPECT_NEAR(std::stof(cell), figure, 5e-3F * figure) << cell;
      }
    }
  }
}

}  // namespace
}  // namespace motors_test
}  // namespace servodrome::line
