#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// The steppers of the series: two phases in drive and plant.
namespace servodrome::test {
namespace jmc_stepper_test {
namespace {

constexpr std::array steppers{"2hss458-ec", "2dm542-ec"};

TEST(JmcStepper, TwoPhasesAreDataOfTheMotor) {
  for (const products::Model& model : products::jmc_ec::models) {
    const bool stepper = model.motor.pole_pairs == 50;
    EXPECT_EQ(model.motor.phases, stepper ? 2 : 3) << model.name;
    plant::Parameters parameters = jmc_plant(model.name);
    EXPECT_EQ(parameters.motor.phases, model.motor.phases);
    EXPECT_EQ(parameters.motor.cogging_torque_nm > 0.0, stepper);
    EXPECT_EQ(parameters.motor.cogging_periods_per_revolution, stepper ? 200 : 30);
    EXPECT_TRUE(plant::validate(parameters).empty());
  }
}

// The rated torque at rated speed is possible with the link's voltage, for which the windings were chosen; current by p
// flux.
TEST(JmcStepper, RatedTorqueUpToTheRatedSpeed) {
  for (const char* name : steppers) {
    JmcRig rig(name);
    const drive::MotorData motor = rig.device.rating().model.motor;
    rig.open_limits();
    rig.set(0x6060, 0, 3);
    ASSERT_TRUE(rig.enable()) << name;
    const double rpm = 0.95 * static_cast<double>(motor.rated_speed_rpm);
    rig.set(0x60FF, 0, static_cast<std::int64_t>(rpm / 60.0 * 4000.0));
    rig.run_ms(1000);
    const double load_nm = 0.95 * static_cast<double>(motor.rated_torque_nm);
    rig.plant.set_external_torque_nm(load_nm);
    rig.run_ms(1000);
    EXPECT_EQ(rig.get(0x603F), 0) << name;
    double current_a = 0.0;
    double speed_rpm = 0.0;
    for (int i = 0; i < 8000; ++i) {
      rig.tick();
      current_a += rig.plant.current_a() / 8000.0;
      speed_rpm += rig.plant.velocity_rpm() / 8000.0;
      ASSERT_EQ(rig.feedback.phase_current_a[2], 0.0F);
    }
    EXPECT_NEAR(speed_rpm, rpm, 0.01 * rpm) << name;
    const double friction_nm = 0.01 + 1.0e-5 * rpm * 0.1047;
    EXPECT_NEAR(current_a, (load_nm + friction_nm) / static_cast<double>(motor.torque_constant_nm_per_a),
                0.03 * current_a)
        << name;
  }
}

TEST(JmcStepper, CutWindingIsPhaseLoss) {
  for (const auto cut : {plant::Injection::open_phase_u, plant::Injection::open_phase_v}) {
    JmcRig rig("2hss458-ec");
    rig.open_limits();
    rig.set(0x6060, 0, 3);
    ASSERT_TRUE(rig.enable());
    rig.set(0x60FF, 0, 4000);
    rig.run_ms(500);
    rig.plant.set_external_torque_nm(0.5);
    rig.run_ms(200);
    rig.plant.inject(cut, true);
    ASSERT_GE(rig.run_until([&] { return rig.get(0x603F) != 0; }, 2000.0), 0);
    EXPECT_EQ(rig.get(0x603F), 0x5005);  // E105
  }
}

// An output shorted to the negative rail: the comparator of that winding, E101, which needs a power cycle.
TEST(JmcStepper, ShortedWindingIsOverCurrent) {
  for (const auto shorted : {plant::Injection::short_phase_u, plant::Injection::short_phase_v}) {
    JmcRig rig("2dm542-ec");
    ASSERT_TRUE(rig.enable());
    rig.plant.inject(shorted, true);
    ASSERT_GE(rig.run_until([&] { return rig.get(0x603F) != 0; }, 100.0), 0);
    EXPECT_EQ(rig.get(0x603F), 0x5001);
    EXPECT_FALSE(rig.actuation.pwm_enabled);
    const double current_a = std::hypot(rig.plant.current_a(), rig.plant.direct_current_a());
    EXPECT_LT(current_a, 2.0 * static_cast<double>(rig.device.rating().model.motor.peak_current_a));
  }
}

// Held against its torque limit, the axis is jammed (AL.410), like the servos.
TEST(JmcStepper, JammedIsOverload) {
  JmcRig rig("2hss458-ec");
  rig.open_limits();
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.plant.lock_rotor(true);
  rig.set(0x60FF, 0, 4000);
  ASSERT_GE(rig.run_until([&] { return rig.get(0x603F) != 0; }, 3000.0), 0);
  EXPECT_EQ(std::string_view(rig.device.alarm().data()).substr(0, 6), "AL.410");
}

}  // namespace
}  // namespace jmc_stepper_test
}  // namespace servodrome::test
