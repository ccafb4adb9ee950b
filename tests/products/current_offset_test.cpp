#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// Drives measure the offsets of their current sensors at power-on and subtract them.
namespace servodrome {
namespace current_offset_test {
namespace {

using drive::Cause;
using drive::PowerState;
using Rig = test::Rig<products::Generic402>;

// Only an offset, of several percent of the rated current.
plant::Parameters offset_sensors(double share = 0.02, plant::Parameters parameters = test::default_plant()) {
  parameters.sensors = {.ideal = false,
                        .current_bits = 0,
                        .current_noise = 0.0,
                        .current_offset = share,
                        .current_gain_error = 0.0,
                        .encoder_noise_arcsec = 0.0,
                        .encoder_latency_us = 0.0,
                        .eccentricity_arcsec = 0.0,
                        .encoder_lines = 0};
  return parameters;
}

plant::Parameters noisy_sensors() {
  plant::Parameters parameters = offset_sensors();
  parameters.sensors.current_noise = 0.0003;
  parameters.sensors.current_bits = 12;
  return parameters;
}

// Greatest difference between the drive's torque-producing current and the true one while the axis turns, in A.
template <typename RigType>
double greatest_error_a(RigType& rig) {
  double error = 0.0;
  for (int i = 0; i < 3200; ++i) {
    const double true_a = rig.plant.current_a();
    rig.tick();
    error = std::max(error, std::abs(static_cast<double>(rig.device.drive().loops().current_q_a) - true_a));
  }
  return error;
}

void turn(Rig& rig, double rpm) {
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, static_cast<std::int64_t>(rpm / 60.0 * 131072.0));
  ASSERT_TRUE(rig.enable());
  rig.run_ms(300);
}

double offset_a(Rig& rig) {
  const auto& all = rig.device.drive().current_offset().offset_a();
  return static_cast<double>(std::max({std::abs(all[0]), std::abs(all[1]), std::abs(all[2])}));
}

TEST(CurrentOffset, IsGoneAfterTheCalibration) {
  Rig rig(offset_sensors());
  turn(rig, 600.0);
  EXPECT_TRUE(rig.device.drive().current_offset().done());
  EXPECT_GT(offset_a(rig), 0.1);
  EXPECT_LT(greatest_error_a(rig), 1.0e-3);
}

TEST(CurrentOffset, NoiseLeavesALittle) {
  Rig rig(noisy_sensors());
  turn(rig, 600.0);
  Rig exact(offset_sensors());
  turn(exact, 600.0);
  const double deviation_a = 0.0003 * rig.plant.parameters().supply.overcurrent_a;
  for (std::size_t phase = 0; phase < 3; ++phase) {
    EXPECT_NEAR(rig.device.drive().current_offset().offset_a()[phase],
                exact.device.drive().current_offset().offset_a()[phase], 4.0 * deviation_a / std::sqrt(64.0) + 1e-3);
  }
}

// 38 ms: 2 ms until the shaft counts as standing, then 8 cycles of 0.5 ms of waiting and 64 cycles of measurement.
TEST(CurrentOffset, TakesItsTime) {
  Rig rig(offset_sensors());
  rig.run_ms(9.0);
  EXPECT_EQ(offset_a(rig), 0.0) << "7 samples are too few";
  rig.run_ms(2.0);
  EXPECT_GT(offset_a(rig), 0.1);
  rig.run_ms(25.0);
  EXPECT_FALSE(rig.device.drive().current_offset().done());
  rig.run_ms(3.0);
  EXPECT_TRUE(rig.device.drive().current_offset().done());
}

// The stage is switched on during the calibration: the present mean is used, and the calibration continues when the
// stage is off again. Currents in between do not count.
TEST(CurrentOffset, PowerInTheMiddleInterruptsIt) {
  Rig rig(offset_sensors());
  const auto& offset = rig.device.drive().current_offset();
  rig.run_ms(12.0);
  rig.set(0x6060, 0, 3);
  rig.set(0x6083, 0, 13107200);
  rig.set(0x60FF, 0, 1310720);
  for (const std::uint16_t word : std::initializer_list<std::uint16_t>{0x06, 0x07, 0x0F}) {
    rig.control(word);
    rig.run_ms(1.0);
  }
  ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  rig.run_ms(300.0);
  ASSERT_GT(rig.plant.velocity_rpm(), 500.0);
  EXPECT_FALSE(offset.done());
  EXPECT_LT(greatest_error_a(rig), 1.0e-3);
  rig.control(0x00);
  rig.run_ms(5.0);
  EXPECT_FALSE(offset.done()) << "the shaft still turns";
  rig.run_ms(5000.0);
  ASSERT_LT(std::abs(rig.plant.velocity_rpm()), 0.1);
  EXPECT_TRUE(offset.done());
  turn(rig, 600.0);
  EXPECT_LT(greatest_error_a(rig), 1.0e-3);
}

// A load turns the shaft while the DC link is empty: the motor charges the link through the diodes, with real currents.
TEST(CurrentOffset, ADrivenShaftDoesNotSpoilIt) {
  plant::Parameters parameters = offset_sensors(0.001);
  parameters.supply.charged_at_start = false;
  parameters.supply.volts = 0.0;
  Rig rig(parameters);
  const auto& offset = rig.device.drive().current_offset();
  rig.plant.set_external_torque_nm(-0.3);
  double most_a = 0.0;
  for (int i = 0; i < 16000; ++i) {
    rig.tick();
    most_a = std::max(most_a, std::abs(rig.plant.current_a()));
    EXPECT_FALSE(offset.done());
  }
  ASSERT_GT(most_a, 0.2) << "it has to be a test";
  ASSERT_GT(std::abs(rig.plant.velocity_rpm()), 20.0);
  EXPECT_EQ(offset_a(rig), 0.0);
  rig.plant.set_external_torque_nm(0.0);
  ASSERT_GE(rig.run_until([&] { return offset.done(); }, 20000.0), 0);
  const double range_a = parameters.supply.overcurrent_a;
  EXPECT_LT(offset_a(rig), 0.001 * range_a + 1.0e-3);
}

// Without an encoder the drive cannot detect that the shaft stands.
TEST(CurrentOffset, ALostEncoderStopsIt) {
  Rig rig(offset_sensors());
  rig.run_ms(20.0);
  rig.plant.inject(plant::Injection::encoder_loss, true);
  rig.run_ms(100.0);
  EXPECT_FALSE(rig.device.drive().current_offset().done());
  EXPECT_EQ(offset_a(rig), 0.0);
  rig.plant.inject(plant::Injection::encoder_loss, false);
  rig.run_ms(100.0);
  EXPECT_TRUE(rig.device.drive().current_offset().done());
}

TEST(CurrentOffset, ACutOfTheSupplyBeginsItAnew) {
  Rig rig(offset_sensors());
  for (const double before_ms : {5.0, 20.0, 200.0}) {
    rig.run_ms(before_ms);
    rig.plant.discharge_dc_link();
    rig.device.power_on(rig.feedback, rig.now());
    EXPECT_FALSE(rig.device.drive().current_offset().done());
    EXPECT_EQ(offset_a(rig), 0.0);
    rig.run_ms(50.0);
    EXPECT_TRUE(rig.device.drive().current_offset().done());
  }
}

// An offset of more than 5 % of the peak current is a failed sensor. The alarm comes before the motor has power, and is
// not cleared.
template <typename RigType>
void expect_alarm(RigType&& rig, bool expected) {
  rig.run_ms(100.0);
  EXPECT_TRUE(rig.device.drive().current_offset().done());
  EXPECT_EQ(rig.device.drive().is_active(Cause::current_sensor), expected);
  EXPECT_EQ(rig.device.drive().state() == PowerState::fault, expected);
  rig.set(0x6040, 0, 0x80);
  rig.run_ms(10.0);
  EXPECT_EQ(rig.device.drive().state() == PowerState::fault, expected);
}

TEST(CurrentOffset, AFailedSensorIsAnAlarmWhereTheManualHasOne) {
  for (const bool failed : {false, true}) {
    const double share = failed ? 0.1 : 0.01;
    SCOPED_TRACE(share);
    expect_alarm(test::FactoryIsmkRig(offset_sensors(share, test::ismk_plant()), test::ismk_settings()), failed);
    expect_alarm(test::FactoryJmcRig(offset_sensors(share, test::jmc_plant()), test::jmc_settings()), failed);
    expect_alarm(Rig(offset_sensors(share)), false);
  }
}

TEST(CurrentOffset, IdealSensorsHaveNone) {
  Rig rig;
  turn(rig, 600.0);
  EXPECT_TRUE(rig.device.drive().current_offset().done());
  EXPECT_EQ(offset_a(rig), 0.0);
}

}  // namespace
}  // namespace current_offset_test
}  // namespace servodrome
