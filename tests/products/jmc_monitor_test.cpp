#include <cmath>
#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// The monitoring items d00 to d31 of the JMC EC drives (ch. 8.3), compared with the true shaft.
namespace servodrome {
namespace jmc_monitor_test {
namespace {

using dictionary::AbortCode;
using test::JmcRig;

struct MonitorRig : JmcRig {
  explicit MonitorRig(std::int8_t mode, const plant::Parameters& parameters = test::jmc_plant())
      : JmcRig(parameters, test::jmc_settings()) {
    set(0x607F, 0, 400000);
    set(0x60C5, 0, 4000000);
    set(0x60C6, 0, 4000000);
    set(0x6065, 0, 0xFFFFFFFF);
    set(0x6060, 0, mode);
    EXPECT_TRUE(enable());
    run_ms(120);
  }
  double item(std::uint8_t number) { return static_cast<double>(monitor(number)); }
};

TEST(JmcMonitor, Positions) {
  JmcRig idle;
  idle.run_ms(5);
  EXPECT_EQ(idle.set(0x6092, 1, 8000), AbortCode::none);  // two units per count
  idle.set(0x607F, 0, 400000);
  idle.set(0x6060, 0, 1);
  idle.set_panel(2, 3, 300);
  ASSERT_TRUE(idle.enable());
  idle.run_ms(120);
  idle.set(0x6081, 0, 40000);
  idle.set(0x607A, 0, 80000);
  idle.control(0x1F);
  idle.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(idle.monitor(2)), 40000.0 * 0.7 / 100.0, 10.0) << "deviation, user units";
  EXPECT_NEAR(static_cast<double>(idle.monitor(5)), 20000.0 * 0.7 / 100.0, 5.0) << "deviation, counts";
  EXPECT_EQ(idle.monitor(1), idle.get(0x6064));
  EXPECT_NEAR(static_cast<double>(idle.monitor(4)), static_cast<double>(idle.plant.position_counts()), 12.0);
  EXPECT_NEAR(static_cast<double>(idle.monitor(0) - idle.monitor(1)), static_cast<double>(idle.monitor(2)), 42.0);
  EXPECT_NEAR(static_cast<double>(idle.monitor(3) - idle.monitor(4)), static_cast<double>(idle.monitor(5)), 21.0);
  EXPECT_EQ(idle.monitor(6), 40) << "thousand units per second";
  EXPECT_NEAR(static_cast<double>(idle.monitor(7)), 300.0, 8.0);
  EXPECT_NEAR(static_cast<double>(idle.monitor(8)), 300.0, 8.0);
  idle.run_ms(3000);
  EXPECT_EQ(idle.monitor(0), 80000);
  EXPECT_EQ(idle.monitor(6), 0);
}

TEST(JmcMonitor, Torques) {
  MonitorRig rig(8);
  rig.plant.lock_rotor(true);
  rig.set(0x6060, 0, 10);
  rig.set(0x6071, 0, 500);
  rig.run_ms(2000);
  EXPECT_EQ(rig.item(9), 50.0);
  EXPECT_NEAR(rig.item(10), 50.0, 1.0);
  rig.set(0x6071, 0, -1000);
  rig.run_ms(4000);
  EXPECT_NEAR(rig.item(10), -100.0, 1.0);
  EXPECT_NEAR(rig.item(12), 100.0, 3.0);
  // The mean over the measured time: 2 s at 50 %, 4 s at 100 %, before that little more than the 0.4 s of enabling.
  const double all_s = 6.0 + 0.33;
  EXPECT_NEAR(rig.item(11), 100.0 * (2.0 * 0.5 + 4.0) / all_s, 3.0);
  EXPECT_NEAR(rig.item(13), 100.0 * std::sqrt((2.0 * 0.25 + 4.0) / all_s), 3.0);
  rig.set(0x6071, 0, 0);
  rig.run_ms(10200);
  EXPECT_EQ(rig.item(11), 0.0) << "the last 10 s";
  EXPECT_EQ(rig.item(13), 0.0);
  EXPECT_NEAR(rig.item(12), 100.0, 3.0) << "since power-on";
  EXPECT_NEAR(rig.item(25), 16.0, 1.0) << "run time";
  rig.device.power_off();
  rig.device.power_on(rig.feedback, rig.now());
  rig.run_ms(10);
  EXPECT_EQ(rig.item(12), 0.0);
  EXPECT_NEAR(rig.item(25), 16.0, 1.0) << "goes on";
}

TEST(JmcMonitor, InputsAngleSupply) {
  plant::Parameters parameters = test::jmc_plant();
  parameters.encoder.start_position_counts = 1000;
  JmcRig rig(parameters, test::jmc_settings());
  rig.run_ms(5);
  EXPECT_EQ(rig.monitor(16), 0x1F) << "high: every opto-coupler is off";
  rig.plant.force_input(1, true);
  rig.run_ms(2);
  EXPECT_EQ(rig.monitor(16), 0x1D);
  EXPECT_EQ(rig.monitor(18), 900) << "0.1 degrees";
  EXPECT_EQ(rig.monitor(23), 36);
  EXPECT_NEAR(static_cast<double>(rig.monitor(24)), 25.0, 3.0);
  EXPECT_EQ(rig.monitor(14), 0);
  for (const auto without : std::to_array<std::uint8_t>({20, 21, 30, 31})) EXPECT_EQ(rig.monitor(without), 0);
}

// d19: one of six states in the order of a rotating field, six per pole pair.
TEST(JmcMonitor, PhaseSequence) {
  MonitorRig rig(9);
  rig.set(0x60FF, 0, 4000);
  rig.run_ms(300);
  std::vector<std::int64_t> seen;
  for (int i = 0; i < 16000; i += 16) {
    rig.run_ms(1);
    if (seen.empty() || seen.back() != rig.monitor(19)) seen.push_back(rig.monitor(19));
  }
  EXPECT_NEAR(static_cast<double>(seen.size()), 6.0 * 5.0, 2.0) << "a turn in a second, five pole pairs";
  const std::vector<std::int64_t> order{1, 3, 2, 6, 4, 5};
  for (std::size_t i = 1; i < seen.size(); ++i) {
    const auto at = static_cast<std::size_t>(std::find(order.begin(), order.end(), seen[i - 1]) - order.begin());
    ASSERT_EQ(seen[i], order[(at + 1) % 6]);
  }
}

// d22 works with any motion (ch. 8.3), and AF-J-L makes its own motion (ch. 8.2.2, P01-04).
// Disabled during the identification of the load: it fails, reports it, and the axis rests.
TEST(JmcMonitor, DisableEndsTheRecognitionOfInertia) {
  plant::Parameters parameters = test::jmc_plant();
  parameters.load.inertia_kgm2 = 2.0 * parameters.motor.rotor_inertia_kgm2;
  for (const int word : {0x07, 0x06, 0x00, 0x02}) {
    SCOPED_TRACE(word);
    MonitorRig rig(1, parameters);
    ASSERT_EQ(rig.set(0x200E, 1, 1), AbortCode::none);
    rig.run_until([&] { return std::fabs(rig.plant.velocity_rpm()) > 50.0; }, 8000);
    rig.control(static_cast<std::uint16_t>(word));
    rig.run_ms(1500);
    EXPECT_EQ(rig.get(0x200E, 1), 3) << "failed";
    EXPECT_LT(std::fabs(rig.plant.velocity_rpm()), 1.0);
    EXPECT_NEAR(rig.item(22), 100.0, 1.0) << "P01-04 until something is known";
  }
}

TEST(JmcMonitor, InertiaRatio) {
  for (const double loads : {1.0, 3.0}) {
    plant::Parameters parameters = test::jmc_plant();
    parameters.load.inertia_kgm2 = loads * parameters.motor.rotor_inertia_kgm2;
    MonitorRig rig(1, parameters);
    EXPECT_NEAR(rig.item(22), 100.0, 1.0) << "P01-04 until something is known";
    rig.set(0x6081, 0, 100000);
    rig.set(0x6083, 0, 1000000);
    rig.set(0x6084, 0, 1000000);
    for (int i = 0; i < 6; ++i) {
      rig.set(0x607A, 0, i % 2 == 0 ? 20000 : 0);
      rig.control(0x1F);
      rig.run_ms(5);
      rig.control(0x0F);
      rig.run_ms(500);
    }
    EXPECT_NEAR(rig.item(22), 100.0 * loads, 8.0 * (1.0 + loads));

    MonitorRig own(1, parameters);
    EXPECT_EQ(own.set(0x200E, 1, 1), AbortCode::none);
    EXPECT_EQ(own.get(0x200E, 1), 1) << "running";
    ASSERT_GE(own.run_until([&] { return own.get(0x200E, 1) != 1; }, 8000), 0);
    EXPECT_EQ(own.get(0x200E, 1), 2) << "done";
    EXPECT_NEAR(own.item(22), 100.0 * loads, 8.0 * (1.0 + loads));
  }
  JmcRig off;
  off.run_ms(5);
  EXPECT_EQ(off.set(0x200E, 1, 1), AbortCode::device_state);
}

// d26: the search finds the resonance of a two-mass axis (ch. 8.3).
TEST(JmcMonitor, Resonance) {
  plant::Parameters parameters = test::jmc_plant();
  const double rotor = parameters.motor.rotor_inertia_kgm2;
  const double hz = 400.0;
  parameters.load.inertia_kgm2 = rotor;
  parameters.load.elastic = true;
  parameters.load.damping_nms = 0.001;
  parameters.load.stiffness_nm_per_rad = 0.5 * rotor * std::pow(2.0 * 3.14159265358979 * hz, 2.0);
  MonitorRig rig(8, parameters);
  rig.set_panel(2, 10, 150);
  rig.set_panel(2, 0, 200);
  rig.run_ms(200);
  EXPECT_EQ(rig.item(26), 0.0);
  EXPECT_EQ(rig.set(0x200E, 2, 1), AbortCode::none);
  ASSERT_GE(rig.run_until([&] { return rig.get(0x200E, 2) != 1; }, 20000), 0);
  EXPECT_EQ(rig.get(0x200E, 2), 2);
  EXPECT_NEAR(rig.item(26), hz, 25.0);
}

}  // namespace
}  // namespace jmc_monitor_test
}  // namespace servodrome
