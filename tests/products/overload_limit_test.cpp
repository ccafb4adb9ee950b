#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// The reference drive at its limits: overload and heat as a fault or as a limit of the torque (2041h), and field
// weakening (2013h).
namespace servodrome {
namespace overload_limit_test {
namespace {

using drive::Cause;
using drive::PowerState;
using Rig = test::Rig<products::Generic402>;

constexpr std::int64_t counts_per_turn = 131072;

plant::Parameters cold(double link_v = 310.0) {
  plant::Parameters parameters = test::default_plant();
  parameters.supply.volts = link_v;
  parameters.motor.copper_temperature_coefficient = 0.0;
  return parameters;
}

void enable_at(Rig& rig, double rpm) {
  rig.set(0x2040, 2, 50);
  rig.set(0x6060, 0, 3);
  rig.set(0x6072, 0, 3000);
  rig.set(0x6073, 0, 3000);
  rig.set(0x60E0, 0, 3000);
  rig.set(0x60E1, 0, 3000);
  rig.set(0x6083, 0, 100 * counts_per_turn);
  rig.set(0x6084, 0, 100 * counts_per_turn);
  rig.set(0x60FF, 0, static_cast<std::int64_t>(rpm / 60.0 * counts_per_turn));
  ASSERT_TRUE(rig.enable());
}

double torque(Rig& rig) { return static_cast<double>(rig.device.drive().loops().mean_torque); }
bool bit_11(Rig& rig) { return (rig.status() & drive::statusword::internal_limit_active) != 0; }

TEST(Overload, IsAFaultFromTheFactory) {
  Rig rig(cold());
  rig.plant.lock_rotor(true);
  enable_at(rig, 600.0);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == PowerState::fault; }, 10000.0), 0);
  EXPECT_EQ(rig.get(0x603F), 0x2350);
}

TEST(Overload, LimitsTheTorqueToWhatLasts) {
  Rig rig(cold());
  ASSERT_EQ(rig.set(0x2041, 0, 1), dictionary::AbortCode::none);
  rig.set(0x2040, 3, 0);  // ignores the winding's temperature here
  rig.plant.lock_rotor(true);
  enable_at(rig, 600.0);
  rig.run_ms(500.0);
  const double peak = torque(rig);
  EXPECT_GT(peak, 2.8) << "at first the peak current flows";
  rig.run_ms(30000.0);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  EXPECT_NEAR(static_cast<double>(rig.get(0x2060)), 98.0, 1.0);
  EXPECT_NEAR(torque(rig), 1.0, 0.02);
  EXPECT_TRUE(bit_11(rig));
  // After a rest the peak current is available again, for some time.
  rig.control(0x07);
  rig.run_ms(60000.0);
  rig.control(0x0F);
  rig.run_ms(500.0);
  EXPECT_NEAR(torque(rig), peak, 0.05);
  // If the limitation is switched off while it acts, a fault follows.
  rig.run_ms(30000.0);
  rig.set(0x2041, 0, 0);
  rig.run_ms(3000.0);
  EXPECT_EQ(rig.get(0x603F), 0x2350);
}

TEST(Overload, LimitsTheTorqueByTheWindingsTemperature) {
  for (const bool limits : {false, true}) {
    Rig rig(cold());
    rig.set(0x2041, 0, limits ? 1 : 0);
    rig.set(0x2040, 3, 45);
    rig.plant.lock_rotor(true);
    enable_at(rig, 600.0);
    rig.set(0x6072, 0, 950);  // below the I2t limit
    double hottest_c = 0.0;
    for (int i = 0; i < 600 && rig.device.drive().state() == PowerState::operation_enabled; ++i) {
      rig.run_ms(1000.0);
      hottest_c = std::max(hottest_c, rig.plant.winding_temperature_c());
    }
    if (!limits) {
      EXPECT_EQ(rig.get(0x603F), 0x4310);
      continue;
    }
    EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
    EXPECT_LT(hottest_c, 45.0);
    EXPECT_GT(hottest_c, 36.0);
    EXPECT_LT(torque(rig), 0.9);
    EXPECT_GT(torque(rig), 0.2);
    EXPECT_TRUE(bit_11(rig));
  }
}

// Heat from outside the drive still causes a fault.
TEST(Overload, AFailedCoolingIsAFault) {
  Rig rig(cold());
  rig.set(0x2041, 0, 1);
  enable_at(rig, 600.0);
  rig.plant.inject(plant::Injection::stage_overheat, true);
  rig.run_ms(50.0);
  EXPECT_EQ(rig.get(0x603F), 0x4210);
}

// 120 V are enough for about 2900 rpm.
TEST(FieldWeakening, ReachesMoreThanTheVoltageAllows) {
  for (const double direction : {1.0, -1.0}) {
    Rig without(cold(120.0));
    enable_at(without, direction * 3600.0);
    without.run_ms(2000.0);
    EXPECT_LT(std::abs(without.plant.velocity_rpm()), 3000.0);
    EXPECT_NEAR(without.plant.direct_current_a(), 0.0, 0.5);

    Rig rig(cold(120.0));
    ASSERT_EQ(rig.set(0x2013, 0, 1500), dictionary::AbortCode::none);
    enable_at(rig, direction * 3600.0);
    double most_a = 0.0;
    for (int i = 0; i < 32000; ++i) {
      rig.tick();
      most_a = std::max(most_a, std::hypot(rig.plant.current_a(), rig.plant.direct_current_a()));
    }
    const drive::MotorData& motor = rig.device.drive().configuration().motor;
    EXPECT_NEAR(rig.plant.velocity_rpm(), direction * 3600.0, 5.0);
    EXPECT_LT(rig.plant.direct_current_a(), -0.5 * static_cast<double>(motor.rated_current_a));
    EXPECT_GT(rig.plant.direct_current_a(), -1.5 * static_cast<double>(motor.rated_current_a) - 0.1);
    EXPECT_LT(most_a, 1.1 * static_cast<double>(motor.peak_current_a));

    // Slow again, without the field-weakening current; then to rest with a quick stop from full speed.
    rig.set(0x60FF, 0, static_cast<std::int64_t>(direction * 10.0) * counts_per_turn);
    rig.run_ms(1500.0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), direction * 600.0, 5.0);
    EXPECT_NEAR(rig.plant.direct_current_a(), 0.0, 0.1);
    rig.set(0x60FF, 0, static_cast<std::int64_t>(direction * 60.0) * counts_per_turn);
    rig.run_ms(2000.0);
    ASSERT_NEAR(rig.plant.velocity_rpm(), direction * 3600.0, 5.0);
    rig.control(0x02);
    rig.run_ms(3000.0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
    EXPECT_FALSE(rig.device.drive().any_fault());
  }
}

// Power is removed at full speed and returns while the motor still turns; the field-weakening current is off meanwhile.
TEST(FieldWeakening, EndsAndBeginsWithThePower) {
  Rig rig(cold(120.0));
  rig.set(0x2013, 0, 1500);
  enable_at(rig, 3600.0);
  rig.run_ms(2000.0);
  rig.control(0x00);
  rig.run_ms(5.0);
  rig.control(0x06);
  rig.run_ms(1.0);
  rig.control(0x0F);
  rig.run_ms(2000.0);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 3600.0, 5.0);
  rig.set(0x2013, 0, 0);  // disabled while it acts: the speed falls to the value that the voltage allows
  rig.run_ms(2000.0);
  EXPECT_LT(rig.plant.velocity_rpm(), 3000.0);
  EXPECT_FALSE(rig.device.drive().any_fault());
}

}  // namespace
}  // namespace overload_limit_test
}  // namespace servodrome
