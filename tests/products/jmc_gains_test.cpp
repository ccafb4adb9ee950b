#include <algorithm>
#include <cmath>
#include <complex>
#include <gtest/gtest.h>
#include <numbers>

#include "jmc_rig.hpp"

// The effects of the panel parameters of the JMC EC drives on the axis, compared with theory (ch. 7 and 8.2.3, ch.
// 8.2.4 to 8.2.8).
namespace servodrome {
namespace jmc_gains_test {
namespace {

using test::FactoryJmcRig;

constexpr double pi = std::numbers::pi;

plant::Parameters frictionless() {
  plant::Parameters parameters = test::jmc_plant();
  parameters.load.coulomb_friction_nm = 0.0;
  parameters.load.static_friction_nm = 0.0;
  parameters.load.viscous_friction_nms = 0.0;
  parameters.motor.copper_temperature_coefficient = 0.0;
  return parameters;
}

// Manual gains; the load has the inertia of the rotor, the factory value of P01-04. The loops have the values of the
// list, the velocity loop has no integral.
struct GainsRig : FactoryJmcRig {
  explicit GainsRig(std::int8_t mode, const plant::Parameters& parameters = frictionless())
      : FactoryJmcRig(parameters, test::jmc_settings()) {
    set_panel(1, 2, 0);
    set_panel(2, 11, 10000);  // 1000 ms
    set(0x607F, 0, 1000000);
    set(0x60C5, 0, 10000000);
    set(0x60C6, 0, 10000000);
    set(0x6083, 0, 1000000);
    set(0x6084, 0, 1000000);
    set(0x6072, 0, 3000);
    set(0x6073, 0, 3000);
    set(0x6065, 0, 0xFFFFFFFF);
    set(0x6060, 0, mode);
    EXPECT_TRUE(enable());
    run_ms(120);
  }
  const drive::Configuration& configuration() { return device.drive().configuration(); }
  double rated_nm() { return static_cast<double>(configuration().motor.rated_torque_nm); }
  void move_to(std::int64_t target) {
    set(0x607A, 0, target);
    control(0x1F);
    run_ms(2);
    control(0x0F);
  }
  double deviation() { return static_cast<double>(device.drive().loops().following_error_counts); }
};

TEST(JmcGains, Units) {
  GainsRig rig(9);
  const drive::Gains& gains = rig.configuration().gains;
  const drive::MotorData& motor = rig.configuration().motor;
  rig.set_panel(2, 10, 270);
  rig.set_panel(2, 11, 100);
  rig.set_panel(1, 4, 0);
  const double kp = 2.0 * pi * 27.0 * static_cast<double>(motor.inertia_kgm2 / motor.torque_constant_nm_per_a);
  EXPECT_NEAR(static_cast<double>(gains.velocity_kp), kp, 1e-5 * kp);
  EXPECT_NEAR(static_cast<double>(gains.velocity_ki), kp / 10e-3, 1e-3 * kp / 10e-3);
  rig.set_panel(1, 4, 300);  // the load is three times the rotor: four times the gain
  EXPECT_NEAR(static_cast<double>(gains.velocity_kp), 4.0 * kp, 1e-4 * kp);
  rig.set_panel(2, 12, 250);
  EXPECT_FLOAT_EQ(gains.velocity_setpoint_weight, 0.25F);
  EXPECT_FLOAT_EQ(gains.position_kp, 48.0F);
  EXPECT_FLOAT_EQ(gains.velocity_feed_forward, 0.3F);
  EXPECT_NEAR(static_cast<double>(gains.velocity_feed_forward_filter_hz), 1.0 / (2.0 * pi * 0.5e-3), 0.01);
  rig.set_panel(2, 19, 80);
  EXPECT_FLOAT_EQ(gains.acceleration_feed_forward, 0.8F);
  EXPECT_NEAR(static_cast<double>(gains.acceleration_feed_forward_filter_hz), 1.0 / (2.0 * pi * 0.8e-3), 0.01);
  EXPECT_NEAR(static_cast<double>(gains.velocity_filter_hz), 1.0 / (2.0 * pi * 0.8e-3), 0.01);
  EXPECT_NEAR(static_cast<double>(gains.torque_filter_hz), 1.0 / (2.0 * pi * 0.84e-3), 0.01);
  EXPECT_FLOAT_EQ(gains.disturbance_share, 0.0F);
  rig.set_panel(8, 19, 0);
  rig.set_panel(8, 20, 0);
  EXPECT_EQ(gains.velocity_filter_hz, 0.0F);
  EXPECT_EQ(gains.torque_filter_hz, 0.0F);
}

// The open velocity loop at a frequency, measured in the closed loop: filtered velocity divided by error.
std::complex<double> open_loop(GainsRig& rig, double frequency_hz) {
  const int cycles = 20;
  const int samples = 4 * static_cast<int>(std::lround(cycles * 2000.0 / frequency_hz));  // 8000 a second
  const double w = 2.0 * pi * cycles / samples;
  std::complex<double> error = 0.0;
  std::complex<double> measured = 0.0;
  for (int k = -4000; k < samples; ++k) {
    if (k % 4 == 0) rig.set(0x60FF, 0, std::lround(20000.0 + 4000.0 * std::sin(w * k)));
    rig.tick();
    rig.tick();
    if (k < 0) continue;
    const drive::CascadeState& loops = rig.device.drive().loops();
    const auto turn = std::polar(1.0, -w * k);
    const auto velocity = static_cast<double>(loops.velocity_counts_per_s);
    error += turn * (static_cast<double>(loops.velocity_reference_counts_per_s) - velocity);
    measured += turn * velocity;
  }
  return measured / error;
}

// P02-10 is the frequency at which the loop's gain is 1, without integral and filters, which are in the formula (ch. 7,
// P02-11; Table 65, P08-19 and P08-20).
TEST(JmcGains, VelocityLoopIsTheFormula) {
  struct Case {
    int gain, integral, feedback_filter, torque_filter;  // in units of the parameters
  };
  for (const Case& c :
       {Case{270, 10000, 80, 84}, {270, 100, 80, 84}, {600, 10000, 20, 20}, {600, 200, 20, 20}, {150, 300, 200, 100}}) {
    GainsRig rig(9);
    rig.set_panel(2, 10, c.gain);
    rig.set_panel(2, 11, c.integral);
    rig.set_panel(8, 19, c.feedback_filter);
    rig.set_panel(8, 20, c.torque_filter);
    const double frequency_hz = 0.1 * c.gain;
    const std::complex<double> s{0.0, 2.0 * pi * frequency_hz};
    const double delay_s = 80e-6;  // current loop; the lead of the sampled filters cancels difference and hold
    const std::complex<double> theory =
        2.0 * pi * 0.1 * c.gain / s * (1.0 + 1.0 / (s * 1e-4 * double(c.integral))) /
        ((1.0 + s * 1e-5 * double(c.feedback_filter)) * (1.0 + s * 1e-5 * double(c.torque_filter))) *
        std::exp(-s * delay_s);
    const std::complex<double> measured = open_loop(rig, frequency_hz);
    EXPECT_NEAR(std::abs(measured), std::abs(theory), 0.03 * std::abs(theory)) << c.gain << " " << c.integral;
    EXPECT_NEAR(std::arg(measured / theory) * 180.0 / pi, 0.0, 4.0) << c.gain << " " << c.integral;
  }
}

// P02-12: 100 % is a PI controller, which overshoots; with 0 only the integral responds to a new speed (ch. 8.2.3).
TEST(JmcGains, PseudoDerivative) {
  const auto overshoot = [](int percent) {
    GainsRig rig(9);
    rig.set_panel(2, 11, 100);
    rig.set_panel(2, 12, 10 * percent);
    rig.set(0x60FF, 0, 40000);
    double most = 0.0;
    for (int i = 0; i < 4000; ++i) {
      rig.tick();
      most = std::max(most, rig.plant.velocity_rpm());
    }
    EXPECT_NEAR(rig.plant.velocity_rpm(), 600.0, 3.0);
    return most / 600.0 - 1.0;
  };
  EXPECT_GT(overshoot(100), 0.3);
  EXPECT_LT(overshoot(0), 0.12);
}

// P02-00 and P02-03: at constant speed the axis lags by v (1 - share) / gain.
TEST(JmcGains, DeviationAtConstantSpeed) {
  for (const int gain : {300, 480, 960}) {
    for (const int share : {0, 300, 1000}) {
      GainsRig rig(1);
      rig.set_panel(2, 0, gain);
      rig.set_panel(2, 3, share);
      rig.set(0x6081, 0, 40000);
      rig.move_to(100000);
      rig.run_ms(1000);
      const double expected = 40000.0 * (1.0 - 0.001 * share) / (0.1 * gain);
      EXPECT_NEAR(rig.deviation(), expected, 0.01 * expected + 3.0) << gain << " " << share;
    }
  }
}

// P02-19: without it a proportional velocity loop lags by a / (gain x crossover) during acceleration.
TEST(JmcGains, TorqueFeedForward) {
  const auto lag = [](int percent) {
    GainsRig rig(1);
    rig.set_panel(2, 3, 1000);
    rig.set_panel(2, 4, 0);
    rig.set_panel(2, 19, percent);
    rig.set_panel(2, 20, 0);
    rig.set(0x6081, 0, 200000);
    rig.move_to(200000);
    rig.run_ms(160);
    return rig.deviation();
  };
  // Minus the contribution of the integral of 1000 ms in 160 ms.
  const double expected = 1e6 / (2.0 * pi * 27.0 * 48.0) * std::exp(-0.16);
  const double full = lag(100);
  EXPECT_NEAR(full, 0.0, 0.15 * expected) << "half a cycle's way ahead";
  EXPECT_NEAR(lag(0) - full, expected, 0.05 * expected);
  EXPECT_NEAR(lag(50) - full, 0.5 * expected, 0.05 * expected);
}

// P02-50: the holding torque of a weight needs no deviation. It acts in position control only (ch. 8.2.3).
TEST(JmcGains, TorqueAdded) {
  const auto sag = [](int tenths, std::int8_t mode) {
    GainsRig rig(mode);
    rig.set_panel(2, 50, tenths);
    rig.plant.set_external_torque_nm(0.2 * rig.rated_nm());
    rig.run_ms(60);
    return static_cast<double>(rig.plant.position_counts());
  };
  const double bare = sag(0, 8);
  EXPECT_LT(bare, -50.0);
  EXPECT_NEAR(sag(100, 8), 0.5 * bare, 0.1 * std::abs(bare));
  EXPECT_NEAR(sag(200, 8), 0.0, 0.05 * std::abs(bare));
  EXPECT_NEAR(sag(200, 9), sag(0, 9), 1.0) << "not in speed control";
}

// P02-51 and P02-52, each in one direction (ch. 8.2.3).
TEST(JmcGains, FrictionCompensation) {
  plant::Parameters parameters = frictionless();
  parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.05;
  const auto lag = [&](int forward, int reverse, int direction) {
    GainsRig rig(1, parameters);
    rig.set_panel(2, 3, 1000);
    rig.set_panel(2, 51, forward);
    rig.set_panel(2, 52, reverse);
    rig.set(0x6081, 0, 20000);
    rig.move_to(direction * 100000);
    rig.run_ms(400);
    return rig.deviation();
  };
  const int friction = static_cast<int>(std::lround(1000.0 * 0.05 / GainsRig(1).rated_nm()));
  const double bare = lag(0, 0, 1);
  EXPECT_GT(bare, 10.0);
  EXPECT_NEAR(lag(friction, 0, 1), 0.0, 0.1 * bare);
  EXPECT_NEAR(lag(friction, 0, -1), -bare, 0.1 * bare) << "the other direction has its own";
  EXPECT_NEAR(lag(0, -friction, -1), 0.0, 0.1 * bare);
}

// P03-16: a lag of the position command, exact to the count at the end.
TEST(JmcGains, PositionSmoothing) {
  const auto ride = [](int tenths_of_ms) {
    GainsRig rig(1);
    rig.set_panel(3, 16, tenths_of_ms);
    rig.set_panel(2, 3, 1000);
    rig.set_panel(2, 4, 0);
    rig.set(0x6081, 0, 40000);
    rig.move_to(60000);
    rig.run_ms(1000);
    const drive::Axis& axis = rig.device.drive().axis();
    const auto behind = static_cast<double>(axis.generator.nearest_position() - axis.position());
    EXPECT_GE(rig.run_until([&] { return rig.device.panel().in_position(); }, 5000), 0);
    rig.run_ms(1500);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), 60000.0, 3.0);
    EXPECT_EQ(axis.demand.position, 60000);
    return behind;
  };
  const double bare = ride(0);
  const double half_cycle_s = 0.25e-3;
  EXPECT_NEAR(ride(200) - bare, 40000.0 * (20e-3 - half_cycle_s), 3.0);
  EXPECT_NEAR(ride(1000) - bare, 40000.0 * (100e-3 - half_cycle_s), 3.0);
}

// P08-25 and P08-26: this share of a load is compensated; the rest of T / kp remains as droop.
TEST(JmcGains, DisturbanceCompensation) {
  const auto droop = [](int tenths) {
    GainsRig rig(9);
    rig.set_panel(8, 25, tenths);
    rig.set(0x60FF, 0, 40000);
    rig.run_ms(400);
    const double before = rig.plant.velocity_rpm();
    rig.plant.set_external_torque_nm(0.1 * rig.rated_nm());
    rig.run_ms(40);
    return before - rig.plant.velocity_rpm();
  };
  GainsRig rig(9);
  const drive::Configuration& c = rig.configuration();
  const double kp_nms = static_cast<double>(c.gains.velocity_kp * c.motor.torque_constant_nm_per_a);
  const double bare = 0.1 * rig.rated_nm() / kp_nms * 30.0 / pi;
  EXPECT_NEAR(droop(0), bare, 0.06 * bare);  // the integral has begun to act
  EXPECT_NEAR(droop(500), 0.5 * bare, 0.06 * bare);
  EXPECT_NEAR(droop(900), 0.1 * bare, 0.06 * bare);
}

// P05-10, P05-11.
TEST(JmcGains, TorqueLimits) {
  for (const int direction : {1, -1}) {
    GainsRig rig(9);
    rig.set_panel(5, 10, 500);
    rig.set_panel(5, 11, 300);
    rig.plant.lock_rotor(true);
    rig.set(0x60FF, 0, direction * 40000);
    rig.run_ms(50);
    EXPECT_NEAR(static_cast<double>(rig.monitor(10)), direction > 0 ? 50.0 : -30.0, 1.0);
  }
}

// P04-06, P04-07 (ch. 8.2.5).
TEST(JmcGains, SpeedLimits) {
  for (const int direction : {1, -1}) {
    GainsRig rig(9);
    rig.set_panel(4, 6, 500);
    rig.set_panel(4, 7, -300);
    rig.set(0x60FF, 0, direction * 60000);
    rig.run_ms(400);
    EXPECT_NEAR(rig.plant.velocity_rpm(), direction > 0 ? 500.0 : -300.0, 5.0);
  }
}

// P04-05: AL.420 (ch. 8.2.5 and 9.2).
TEST(JmcGains, OverSpeed) {
  for (const int limit_rpm : {800, 1200}) {
    GainsRig rig(9);
    rig.set_panel(4, 5, limit_rpm);
    rig.set(0x60FF, 0, 1000 * 4000 / 60);
    rig.run_ms(600);
    EXPECT_STREQ(rig.device.alarm().data(), limit_rpm < 1000 ? "AL.420" : "");
  }
}

// P03-15: AL.501 at more than ten times this number of command units, unless 6065h has another value (ch. 8.2.4, C-26).
TEST(JmcGains, ExcessiveDeviation) {
  const auto alarm = [](int tens, std::int64_t window) {
    GainsRig rig(1);
    rig.set_panel(3, 15, tens);
    rig.set(0x6065, 0, window);
    rig.set(0x6081, 0, 40000);  // lags by 583 units
    rig.move_to(100000);
    rig.run_ms(1000);
    return std::string(rig.device.alarm().data());
  };
  EXPECT_EQ(alarm(0, 0), "") << "off";
  EXPECT_EQ(alarm(20, 0), "AL.501") << "above 200 units";
  EXPECT_EQ(alarm(80, 0), "");
  EXPECT_EQ(alarm(20, 5000), "") << "6065h has priority";
}

// P03-05: by the deviation alone, at the end of the command, or at the end of the smoothed command (ch. 8.2.4).
TEST(JmcGains, InPosition) {
  const auto at_criterion = [](int criterion) {
    GainsRig rig(1);
    rig.set_panel(2, 3, 1000);
    rig.set_panel(2, 4, 0);
    rig.set_panel(2, 19, 100);
    rig.set_panel(2, 20, 0);
    rig.set_panel(3, 5, criterion);
    rig.set_panel(3, 6, 60);
    rig.set_panel(3, 16, 1000);  // 100 ms
    rig.set(0x6081, 0, 8000);
    rig.move_to(8000);
    rig.run_ms(300);
    const bool moving = rig.device.panel().in_position();
    EXPECT_EQ((rig.actuation.outputs & 2U) != 0, moving) << "DO1";
    EXPECT_GE(rig.run_until([&] { return !rig.device.drive().in_motion(); }, 3000), 0);
    const std::int64_t ticks = rig.run_until([&] { return rig.device.panel().in_position(); }, 5000);
    return std::pair{moving, static_cast<double>(ticks) / 16.0};
  };
  EXPECT_TRUE(at_criterion(0).first);
  EXPECT_FALSE(at_criterion(1).first);
  EXPECT_LT(at_criterion(1).second, 2.0);
  EXPECT_FALSE(at_criterion(2).first);
  EXPECT_GT(at_criterion(2).second, 500.0) << "800 units are 52 million steps of the lag: 17 time constants";
}

// P06-20, P06-22: active low, from the next power-on.
TEST(JmcGains, OutputPolarity) {
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
  products::Settings settings = test::jmc_settings();
  settings.store = &medium;
  FactoryJmcRig rig(test::jmc_plant(), settings);
  rig.run_ms(5);
  EXPECT_EQ(rig.actuation.outputs & 3U, 0U);
  rig.set_panel(6, 20, 0);
  rig.run_ms(2);
  EXPECT_EQ(rig.actuation.outputs & 3U, 0U);
  rig.device.power_on(rig.feedback, rig.now());
  rig.run_ms(5);
  EXPECT_EQ(rig.actuation.outputs & 3U, 1U);
  rig.set_panel(6, 22, 0);
  rig.device.power_on(rig.feedback, rig.now());
  rig.run_ms(5);
  EXPECT_EQ(rig.actuation.outputs & 3U, 3U);
  EXPECT_EQ(rig.monitor(17), 3);
  rig.device.drive().inject(drive::Cause::internal_hardware, true);
  rig.run_ms(5);
  EXPECT_EQ(rig.actuation.outputs & 3U, 2U) << "an alarm: DO0 is active, low";
}

// Real-time adjustment: the axis is stable at rest and reaches its target, from the lowest level to the highest that
// the factory value of the feedback filter allows.
TEST(JmcGains, RigidityLevelsAreStable) {
  for (const int level : {0, 5, 10, 13, 16, 20, 24}) {
    FactoryJmcRig rig(test::jmc_plant(), test::jmc_settings());
    rig.set_panel(1, 3, level);
    rig.set(0x607F, 0, 400000);
    rig.set(0x6065, 0, 0xFFFFFFFF);
    rig.set(0x6081, 0, 40000);
    rig.set(0x6060, 0, 1);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(120);
    rig.set(0x607A, 0, 20000);
    rig.control(0x1F);
    rig.run_ms(level < 8 ? 8000 : 3000);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), 20000.0, 10.0) << level;
    double fastest = 0.0;
    for (int i = 0; i < 3200; ++i) {
      rig.tick();
      fastest = std::max(fastest, std::abs(rig.plant.velocity_rpm()));
    }
    EXPECT_LT(fastest, 1.0) << level;
  }
}

}  // namespace
}  // namespace jmc_gains_test
}  // namespace servodrome
