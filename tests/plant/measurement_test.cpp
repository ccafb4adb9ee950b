#include "plant/measurement.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "rig.hpp"

// The measured currents and position, with each error alone.
namespace servodrome::plant {
namespace measurement_test {
namespace {

constexpr double range_a = 20.0;
constexpr std::int32_t turn = 1 << 20;
constexpr double counts_per_arcsec = turn / (360.0 * 3600.0);

Sensors perfect() {
  Sensors sensors;
  sensors.ideal = false;
  sensors.current_bits = 0;
  sensors.current_noise = sensors.current_offset = sensors.current_gain_error = 0.0;
  sensors.encoder_noise_arcsec = sensors.encoder_latency_us = sensors.eccentricity_arcsec = 0.0;
  sensors.interpolation_arcsec = sensors.interpolation_second_arcsec = 0.0;
  return sensors;
}

drive::Feedback truth(double current_a, double position) {
  drive::Feedback feedback;
  feedback.phase_current_a = {static_cast<float>(current_a), static_cast<float>(-current_a), 0.0F};
  feedback.position_counts = static_cast<std::int64_t>(std::floor(position));
  const std::int64_t single = feedback.position_counts % turn;
  feedback.single_turn_counts = static_cast<std::uint32_t>(single < 0 ? single + turn : single);
  return feedback;
}

ShaftPlace place_of(double position) {
  return {static_cast<std::int64_t>(std::floor(position)), position - std::floor(position)};
}

struct Statistics {
  double mean = 0.0;
  double deviation = 0.0;
};
Statistics statistics(const std::vector<double>& values) {
  Statistics result;
  for (const double value : values) result.mean += value / static_cast<double>(values.size());
  for (const double value : values) result.deviation += (value - result.mean) * (value - result.mean);
  result.deviation = std::sqrt(result.deviation / static_cast<double>(values.size()));
  return result;
}

// Measured minus true position, in counts, over one turn.
std::vector<double> errors_in_a_turn(const Sensors& sensors) {
  Measurement measurement(sensors, turn, range_a);
  std::vector<double> errors;
  constexpr int steps = 4096;
  for (int i = 0; i < steps; ++i) {
    const double position = (i + 0.5) * turn / steps;
    drive::Feedback feedback = truth(0.0, position);
    measurement.place(place_of(position));
    measurement.measure(place_of(position), false, feedback);
    errors.push_back(static_cast<double>(feedback.position_counts) + 0.5 - position);
  }
  return errors;
}

// The amplitude of `periods` per turn in these errors.
double amplitude(const std::vector<double>& errors, int periods) {
  double sine = 0.0;
  double cosine = 0.0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double angle =
        2.0 * std::numbers::pi * periods * (static_cast<double>(i) + 0.5) / static_cast<double>(errors.size());
    sine += errors[i] * std::sin(angle);
    cosine += errors[i] * std::cos(angle);
  }
  return 2.0 * std::hypot(sine, cosine) / static_cast<double>(errors.size());
}

TEST(Measurement, WithoutErrorsIsTheTruth) {
  Measurement measurement(perfect(), turn, range_a);
  for (const double position : {-3.25 * turn, -0.5, 0.0, 0.75, 5.5 * turn}) {
    drive::Feedback feedback = truth(3.5, position);
    const drive::Feedback true_feedback = feedback;
    measurement.measure(place_of(position), false, feedback);
    EXPECT_EQ(feedback.position_counts, true_feedback.position_counts);
    EXPECT_EQ(feedback.single_turn_counts, true_feedback.single_turn_counts);
    EXPECT_EQ(feedback.phase_current_a, true_feedback.phase_current_a);
  }
}

TEST(Measurement, CurrentNoiseHasItsDeviationAndNoMean) {
  Sensors sensors = perfect();
  sensors.current_noise = 0.002;
  Measurement measurement(sensors, turn, range_a);
  std::vector<double> values;
  for (int i = 0; i < 20000; ++i) {
    drive::Feedback feedback = truth(5.0, 0.0);
    measurement.measure({}, false, feedback);
    values.push_back(static_cast<double>(feedback.phase_current_a[0]));
  }
  const Statistics result = statistics(values);
  EXPECT_NEAR(result.mean, 5.0, 0.001);
  EXPECT_NEAR(result.deviation, 0.04, 0.001);
}

TEST(Measurement, OffsetsAndGainsAreDrawnFromTheSeedWithinTheirBounds) {
  double greatest_offset = 0.0;
  double greatest_gain = 0.0;
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    Sensors sensors = perfect();
    sensors.seed = seed;
    sensors.current_offset = 0.01;
    sensors.current_gain_error = 0.03;
    Measurement measurement(sensors, turn, range_a);
    drive::Feedback zero = truth(0.0, 0.0);
    measurement.measure({}, false, zero);
    drive::Feedback ten = truth(10.0, 0.0);
    measurement.measure({}, false, ten);
    const double offset = static_cast<double>(zero.phase_current_a[0]);
    const double gain = (static_cast<double>(ten.phase_current_a[0]) - offset) / 10.0 - 1.0;
    greatest_offset = std::max(greatest_offset, std::abs(offset));
    greatest_gain = std::max(greatest_gain, std::abs(gain));
  }
  EXPECT_LE(greatest_offset, 0.2);
  EXPECT_GT(greatest_offset, 0.15);
  EXPECT_LE(greatest_gain, 0.0301);
  EXPECT_GT(greatest_gain, 0.025);
}

TEST(Measurement, CurrentsComeInStepsUpToTheRange) {
  Sensors sensors = perfect();
  sensors.current_bits = 8;
  sensors.current_range_a = 12.8;
  Measurement measurement(sensors, turn, range_a);  // 0.1 A a step
  for (const auto& [true_a, told_a] : {std::pair{0.04, 0.0}, {0.06, 0.1}, {-3.33, -3.3}, {14.0, 12.8}}) {
    drive::Feedback feedback = truth(true_a, 0.0);
    measurement.measure({}, false, feedback);
    EXPECT_NEAR(static_cast<double>(feedback.phase_current_a[0]), told_a, 1e-6);
    EXPECT_NEAR(static_cast<double>(feedback.phase_current_a[1]), -told_a, 1e-6);
  }
}

TEST(Measurement, ErrorsOfTheEncoderHaveTheirAmplitudesAndPeriods) {
  Sensors sensors = perfect();
  sensors.encoder_lines = 32;
  sensors.eccentricity_arcsec = 20.0;
  sensors.interpolation_arcsec = 5.0;
  sensors.interpolation_second_arcsec = 3.0;
  const std::vector<double> errors = errors_in_a_turn(sensors);
  EXPECT_NEAR(amplitude(errors, 1), 20.0 * counts_per_arcsec, 0.1);
  EXPECT_NEAR(amplitude(errors, 32), 5.0 * counts_per_arcsec, 0.1);
  EXPECT_NEAR(amplitude(errors, 64), 3.0 * counts_per_arcsec, 0.1);
  EXPECT_LT(amplitude(errors, 33), 0.1);
}

// The errors are predicted with the speed, and must still be those of the present position.
TEST(Measurement, ErrorsOfAMovingShaftAreThoseOfItsPlace) {
  Sensors sensors = perfect();
  sensors.encoder_lines = 32;
  sensors.eccentricity_arcsec = 3000.0;
  sensors.interpolation_arcsec = 1000.0;
  sensors.interpolation_second_arcsec = 500.0;
  Measurement at_rest(sensors, turn, range_a);
  for (const double per_tick : {1000.3, -3333.3}) {
    Measurement moving(sensors, turn, range_a);
    moving.place(place_of(-per_tick));
    for (int i = 0; i < 2000; ++i) {
      const double position = per_tick * i;
      drive::Feedback told = truth(0.0, position);
      moving.measure(place_of(position), false, told);
      if (i == 0) continue;  // the shaft has just begun to move
      drive::Feedback expected = truth(0.0, position);
      at_rest.place(place_of(position));
      at_rest.measure(place_of(position), false, expected);
      ASSERT_NEAR(static_cast<double>(told.position_counts - expected.position_counts), 0.0, 1.0) << i;
      ASSERT_NEAR(std::remainder(told.single_turn_counts - told.position_counts, turn), 0.0, 0.0);
    }
  }
}

TEST(Measurement, PositionNoiseHasItsDeviation) {
  Sensors sensors = perfect();
  sensors.encoder_noise_arcsec = 10.0;
  EXPECT_NEAR(statistics(errors_in_a_turn(sensors)).deviation, 10.0 * counts_per_arcsec, 0.3);
}

TEST(Measurement, PositionIsAsOldAsItsLatency) {
  for (const double latency_us : {0.0, 20.0, 62.5, 100.0, 250.0}) {
    Sensors sensors = perfect();
    sensors.encoder_latency_us = latency_us;
    Measurement measurement(sensors, turn, range_a);
    constexpr double per_tick = 1000.3;
    for (int i = 0; i < 20; ++i) {
      const double position = per_tick * i;
      drive::Feedback feedback = truth(0.0, position);
      measurement.measure(place_of(position), false, feedback);
      if (i < 5) continue;
      const double expected = position - per_tick * latency_us / 62.5;
      EXPECT_NEAR(static_cast<double>(feedback.position_counts) + 0.5, expected, 0.51) << latency_us;
    }
  }
}

TEST(Measurement, TheTurnHasNoSeam) {
  Sensors sensors = perfect();
  sensors.eccentricity_arcsec = 3000.0;
  Measurement measurement(sensors, turn, range_a);
  for (int i = -5000; i < 5000; ++i) {
    drive::Feedback feedback = truth(0.0, i);
    measurement.measure(place_of(i), false, feedback);
    const std::int64_t single = feedback.position_counts % turn;
    ASSERT_EQ(feedback.single_turn_counts, static_cast<std::uint32_t>(single < 0 ? single + turn : single));
  }
}

TEST(Measurement, ALostEncoderSaysNothingNew) {
  Parameters p = test::bare_motor();
  p.sensors.ideal = false;
  test::Rig rig(p);
  rig.run(10);
  rig.plant.inject(Injection::encoder_loss, true);
  rig.step();
  const std::int64_t told = rig.feedback.position_counts;
  for (int i = 0; i < 100; ++i) {
    rig.step_voltage(0.0, 20.0);
    ASSERT_EQ(rig.feedback.position_counts, told);
  }
  EXPECT_NE(rig.plant.position_counts(), told);
}

TEST(Measurement, TwoRunsAreEqualToTheLastBit) {
  Parameters p = test::bare_motor();
  p.sensors.ideal = p.stage.ideal = false;
  test::Rig one(p);
  test::Rig two(p);
  p.sensors.seed = 2;
  test::Rig other(p);
  bool differs = false;
  for (int i = 0; i < 2000; ++i) {
    one.step_voltage(0.0, 30.0);
    two.step_voltage(0.0, 30.0);
    other.step_voltage(0.0, 30.0);
    ASSERT_EQ(one.feedback.position_counts, two.feedback.position_counts);
    ASSERT_EQ(one.feedback.phase_current_a, two.feedback.phase_current_a);
    differs |= one.feedback.phase_current_a != other.feedback.phase_current_a;
  }
  EXPECT_TRUE(differs);
}

}  // namespace
}  // namespace measurement_test
}  // namespace servodrome::plant
