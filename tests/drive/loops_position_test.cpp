#include <gtest/gtest.h>

#include "loops_support.hpp"

namespace servodrome::drive::test {
namespace loops_position_test {
namespace {

// Sets the demand of each position cycle as integer and fraction, like a profile generator.
void demand_position(Axis& axis, double position_counts, double velocity, double acceleration) {
  const double whole = std::floor(position_counts);
  axis.demand.loop = Loop::position;
  axis.demand.position = static_cast<Counts>(whole);
  axis.demand.position_fraction = static_cast<float>(position_counts - whole);
  axis.demand.velocity = static_cast<float>(velocity);
  axis.demand.acceleration = static_cast<float>(acceleration);
}

// A position step decays as exp(-kp t) if kp is small compared with the velocity loop's crossover (here a twentieth).
TEST(PositionLoop, StepDecaysWithItsTimeConstant) {
  for (const float position_kp : {10.0F, 30.0F}) {
    Axis axis(frictionless(1 << 23));
    axis.gains.position_kp = position_kp;
    axis.configure();
    const double step = 100000.0;
    demand_position(axis, step, 0.0, 0.0);
    double time_s = 0.0;
    double crossed_s[3] = {};
    int crossed = 0;
    while (crossed < 3 && time_s < 1.0) {
      axis.tick();
      time_s += tick_seconds;
      if (static_cast<double>(axis.demand.position - axis.plant.position_counts()) < step * std::exp(-1.0 - crossed)) {
        crossed_s[crossed++] = time_s;
      }
    }
    const double constant_s = 1.0 / static_cast<double>(position_kp);
    EXPECT_NEAR(crossed_s[0], constant_s, 0.05 * constant_s);
    EXPECT_NEAR(crossed_s[1] - crossed_s[0], constant_s, 0.05 * constant_s);
    EXPECT_NEAR(crossed_s[2] - crossed_s[1], constant_s, 0.05 * constant_s);
  }
}

struct Following {
  double largest_counts = 0.0;  // during the acceleration
  double mean_counts = 0.0;     // at constant velocity
  double spread_counts = 0.0;   // about the mean
};

// Accelerates for 0.1 s, then moves at constant velocity.
Following follow(Axis& axis, double rpm) {
  const double cycle_s = tick_seconds * axis.rates.position_loop_ticks;
  const double speed = axis.counts_per_s(rpm);
  const double acceleration = speed / 0.1;
  const int cycles = static_cast<int>(std::lround(0.5 / cycle_s));
  Following result;
  double sum = 0.0;
  int count = 0;
  double least = 1.0e18;
  double most = -1.0e18;
  for (int k = 0; k < cycles; ++k) {
    const double t = k * cycle_s;
    const double ramp_s = std::min(t, 0.1);
    demand_position(axis, 0.5 * acceleration * ramp_s * ramp_s + speed * (t - ramp_s), acceleration * ramp_s,
                    t < 0.1 ? acceleration : 0.0);
    for (int i = 0; i < axis.rates.position_loop_ticks; ++i) axis.tick();
    const double error = static_cast<double>(axis.cascade.state().following_error_counts) +
                         static_cast<double>(axis.demand.position_fraction);
    if (t < 0.1) result.largest_counts = std::max(result.largest_counts, std::fabs(error));
    if (t < 0.3) continue;
    sum += error;
    ++count;
    least = std::min(least, error);
    most = std::max(most, error);
  }
  result.mean_counts = sum / count;
  result.spread_counts = most - least;
  return result;
}

TEST(PositionLoop, FeedForwardLeavesNoFollowingError) {
  for (const Rates rates : {Rates{2, 8}, Rates{4, 16}}) {
    for (const std::int32_t resolution : {10000, 131072, 1 << 23}) {
      plant::Parameters parameters = frictionless(resolution);
      parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.02;
      Axis with(parameters, rates);
      const Following small = follow(with, 600.0);
      // A thousandth of a turn during the acceleration, then zero.
      EXPECT_LT(small.largest_counts, 1.0 + 1.0e-3 * resolution);
      EXPECT_NEAR(small.mean_counts, 0.0, 0.1 + 2.0e-7 * resolution);
      EXPECT_LT(small.spread_counts, 2.0 + 2.0e-6 * resolution);

      // Without feed-forward: velocity / kp.
      Axis without(parameters, rates);
      without.gains.velocity_feed_forward = 0.0F;
      without.gains.acceleration_feed_forward = 0.0F;
      without.configure();
      const Following large = follow(without, 600.0);
      const double expected = 10.0 * resolution / static_cast<double>(without.gains.position_kp);
      EXPECT_NEAR(large.mean_counts, expected, 0.01 * expected);
    }
  }
}

// The velocity is limited on the way; the axis arrives without overshoot.
TEST(PositionLoop, VelocityReferenceIsClipped) {
  Axis axis(frictionless(131072));
  axis.demand.velocity_limit_positive = static_cast<float>(axis.counts_per_s(300.0));
  demand_position(axis, 5.0 * 131072, 0.0, 0.0);
  axis.run_seconds(0.5);
  EXPECT_TRUE(axis.cascade.state().velocity_limited);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 300.0, 1.0);
  Counts furthest = 0;
  for (int i = 0; i < 16000; ++i) {
    axis.tick();
    furthest = std::max(furthest, axis.plant.position_counts());
  }
  EXPECT_FALSE(axis.cascade.state().velocity_limited);
  EXPECT_LE(furthest, 5 * 131072 + 131072 / 500);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), 5.0 * 131072, 1.0);
}

// Positions beyond 2^53 and the largest errors: positions are whole counts and never floating-point numbers.
TEST(PositionLoop, ExactFarOut) {
  for (const std::int64_t start : {std::int64_t{1} << 60, -(std::int64_t{1} << 60) + 12345}) {
    plant::Parameters parameters;
    parameters.supply.charged_at_start = true;
    parameters.encoder.start_position_counts = start;
    Axis axis(parameters);
    axis.demand.loop = Loop::position;
    axis.demand.position = start + 1000;
    axis.run_seconds(1.0);
    EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - start), 1000.0, 1.0);
    EXPECT_EQ(axis.cascade.state().following_error_counts, start + 1000 - axis.plant.position_counts());
    axis.demand.velocity_limit_negative = static_cast<float>(axis.counts_per_s(1000.0));
    axis.demand.position = start - (std::int64_t{1} << 60);
    axis.run_seconds(0.3);
    EXPECT_NEAR(axis.plant.velocity_rpm(), -1000.0, 2.0);
  }
}

// --- Rest -----------------------------------------------------------------------------------------------------------

// A move with a trapezoidal profile, with feed-forward of velocity and acceleration.
void move(Axis& axis, double distance_rad) {
  const double cycle_s = tick_seconds * axis.rates.position_loop_ticks;
  const double acceleration = 200.0;
  const double top = std::min(50.0, std::sqrt(acceleration * distance_rad));
  const double ramp_s = top / acceleration;
  const double total_s = distance_rad / top + ramp_s;
  const auto start = static_cast<double>(axis.demand.position);
  const double scale = axis.counts_per_rad;
  for (double t = 0.0; t < total_s; t += cycle_s) {
    const double up_s = std::min(t, ramp_s);
    const double down_s = std::max(t - (total_s - ramp_s), 0.0);
    const double flat_s = t - up_s - down_s;
    const double place =
        0.5 * acceleration * up_s * up_s + top * flat_s + top * down_s - 0.5 * acceleration * down_s * down_s;
    demand_position(axis, start + scale * place, scale * acceleration * (up_s - down_s),
                    scale * (down_s > 0.0 ? -acceleration : (flat_s > 0.0 ? 0.0 : acceleration)));
    for (int i = 0; i < axis.rates.position_loop_ticks; ++i) axis.tick();
  }
  demand_position(axis, std::floor(start + scale * distance_rad), 0.0, 0.0);
}

struct Rest {
  Counts lowest = std::int64_t{1} << 62;
  Counts highest = -(std::int64_t{1} << 62);
  double least_torque = 1.0e9;
  double most_torque = -1.0e9;
};

Rest watch(Axis& axis, double seconds) {
  Rest rest;
  for (auto ticks = std::lround(seconds / tick_seconds); ticks > 0; --ticks) {
    axis.tick();
    const auto torque = static_cast<double>(axis.cascade.state().torque_reference);
    rest.lowest = std::min(rest.lowest, axis.plant.position_counts() - axis.demand.position);
    rest.highest = std::max(rest.highest, axis.plant.position_counts() - axis.demand.position);
    rest.least_torque = std::min(rest.least_torque, torque);
    rest.most_torque = std::max(rest.most_torque, torque);
  }
  return rest;
}

struct RestCase {
  std::int32_t resolution;
  double inertia_ratio;  // of load to rotor
  double told_inertia;   // the inertia that the drive assumes, relative to the true one
  double static_nm;      // breakaway torque; the sliding friction is two thirds of it
  double gravity_nm;
};

Axis rested(const RestCase& of, double distance_rad) {
  plant::Parameters parameters = frictionless(of.resolution);
  parameters.load.inertia_kgm2 = of.inertia_ratio * parameters.motor.rotor_inertia_kgm2;
  parameters.load.static_friction_nm = of.static_nm;
  parameters.load.coulomb_friction_nm = of.static_nm / 1.5;
  parameters.load.gravity_torque_nm = of.gravity_nm;
  Axis axis(parameters);
  axis.motor.inertia_kgm2 *= static_cast<float>(of.told_inertia);
  axis.gains = default_gains(axis.motor, axis.rates, {});
  axis.configure();
  axis.demand.loop = Loop::position;
  axis.run_seconds(0.2);
  move(axis, distance_rad);
  axis.run_seconds(3.0);
  return axis;
}

// For two seconds, three seconds after a move: neither position nor torque may change. Friction from two thousandths to
// a twentieth of the rated torque; load inertia from a fifth of the rotor's to twenty times it. The deviation is within
// one count, or within 0.018 degrees if friction prevents a fine encoder from coming closer.
TEST(PositionLoop, RestsAfterAMove) {
  for (const std::int32_t resolution : {2500, 10000, 131072, 1 << 20, 1 << 23}) {
    for (const double inertia_ratio : {0.2, 1.0, 5.0, 20.0}) {
      for (const double static_nm : {0.002, 0.015, 0.06}) {
        for (const double distance_rad : {0.1, 9.0}) {
          Axis axis = rested({resolution, inertia_ratio, 1.0, static_nm, 0.0}, distance_rad);
          const Rest rest = watch(axis, 2.0);
          const auto where = ::testing::Message() << resolution << " counts, inertia ratio " << inertia_ratio << ", "
                                                  << static_nm << " Nm, moved " << distance_rad;
          EXPECT_EQ(rest.highest, rest.lowest) << where;
          EXPECT_EQ(rest.most_torque, rest.least_torque) << where;
          EXPECT_LE(std::abs(rest.lowest), std::max(1, resolution / 20000)) << where;
        }
      }
    }
  }
}

// With a hanging load, and with an assumed inertia that is wrong by factors of a half and two.
TEST(PositionLoop, RestsUnderGravityAndWithAWrongInertia) {
  for (const std::int32_t resolution : {2500, 131072, 1 << 23}) {
    for (const double told_inertia : {0.5, 1.0, 2.0}) {
      for (const double gravity_nm : {-0.4, 0.0, 0.4}) {
        Axis axis = rested({resolution, 2.0, told_inertia, 0.03, gravity_nm}, 2.0);
        const Rest rest = watch(axis, 2.0);
        const auto where = ::testing::Message()
                           << resolution << " counts, told " << told_inertia << ", gravity " << gravity_nm;
        EXPECT_EQ(rest.highest, rest.lowest) << where;
        EXPECT_EQ(rest.most_torque, rest.least_torque) << where;
        EXPECT_NEAR(rest.most_torque, gravity_nm / 1.27, 1.01 * 0.03 / 1.27) << where;
      }
    }
  }
}

// Without friction an axis has no hold between two edges of its encoder. It oscillates within one count, with less
// torque than one count may cause by design (a tenth of the rated torque). With a fine encoder it first oscillates by
// about 20 counts (0.001 degrees), for a time that depends on rounding errors.
TEST(PositionLoop, WandersWithinOneCountWithoutFriction) {
  for (const std::int32_t resolution : {2500, 131072, 1 << 23}) {
    Axis axis = rested({resolution, 1.0, 1.0, 0.0, 0.0}, 2.0);
    const Rest rest = watch(axis, 2.0);
    const Counts most = std::max(1, resolution / 250000);
    EXPECT_LE(rest.highest, most) << resolution;
    EXPECT_GE(rest.lowest, -most) << resolution;
    EXPECT_LT(rest.most_torque, 0.05) << resolution;
    EXPECT_GT(rest.least_torque, -0.05) << resolution;
  }
}

// An axis at rest that is pushed away comes back. When the demand moves again, the axis follows immediately.
TEST(PositionLoop, LeavesRestWhenPushed) {
  Axis axis = rested({131072, 1.0, 1.0, 0.015, 0.0}, 2.0);
  axis.plant.set_external_torque_nm(0.6);
  axis.run_seconds(0.005);
  EXPECT_LT(axis.plant.position_counts(), axis.demand.position - 10);
  axis.run_seconds(2.0);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - axis.demand.position), 0.0, 3.0);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.6, 0.016);
  move(axis, 2.0);
  axis.run_seconds(0.05);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - axis.demand.position), 0.0, 131072 / 1000.0);
}

}  // namespace
}  // namespace loops_position_test
}  // namespace servodrome::drive::test
