#include <gtest/gtest.h>

#include "drive/tuning/inertia_identification.hpp"

// The conditions under which an identification starts and gives up, cycle by cycle. The test sets the axis to any
// position.
namespace servodrome::drive {
namespace tuning_inertia_test {
namespace {

using Outcome = InertiaIdentification::Outcome;
using Request = InertiaIdentification::Request;

struct Identified : testing::Test {
  Identified() {
    axis.loops = &loops;
    axis.units.counts_per_revolution = 6000.0;
    axis.configuration.motor.counts_per_revolution = 6000;
  }
  bool begin(const Request& request) {
    identification = {};
    return identification.begin(axis, request);
  }
  // Runs one cycle with the shaft at this position.
  Outcome at(Counts position, float velocity) {
    axis.encoder_position = position;
    loops.velocity_counts_per_s = velocity;
    identification.step(axis);
    return identification.outcome();
  }
  int cycles_until_it_ends(int most = 100000) {
    int cycles = 0;
    while (identification.running() && cycles < most) {
      at(0, 0.0F);
      ++cycles;
    }
    return cycles;
  }

  Objects objects{};
  Policy policy{};
  CascadeState loops{};
  Axis axis{objects, policy};
  InertiaIdentification identification;
  Request usual{.travel_counts = 6000.0, .speed_counts_per_s = 10000.0};
};

TEST_F(Identified, RequestsThatMakeSense) {
  EXPECT_TRUE(begin(usual));
  EXPECT_FALSE(identification.begin(axis, usual)) << "it runs";
  EXPECT_FALSE(begin({.travel_counts = 32.0, .speed_counts_per_s = 1.0}));
  EXPECT_TRUE(begin({.travel_counts = 33.0, .speed_counts_per_s = 1.0}));
  EXPECT_FALSE(begin({.travel_counts = 33.0, .speed_counts_per_s = 0.0}));
  EXPECT_FALSE(begin({.travel_counts = 33.0, .speed_counts_per_s = 1.0, .torque_limit = 0.0F}));
  EXPECT_TRUE(begin({.travel_counts = 33.0, .speed_counts_per_s = 1.0, .torque_limit = 0.01F}));
}

TEST_F(Identified, TravelIsToEitherSide) {
  for (const int sign : {1, -1}) {
    axis.encoder_position = 500;
    ASSERT_TRUE(begin(usual));
    EXPECT_EQ(at(500 + sign * 6000, 0.0F), Outcome::running);
    EXPECT_EQ(at(500 + sign * 6001, 0.0F), Outcome::travel_exceeded);
  }
  // The software limits are nearer.
  objects.min_position_limit = -100;
  objects.max_position_limit = 300;
  for (const int sign : {1, -1}) {
    axis.encoder_position = 0;
    ASSERT_TRUE(begin(usual));
    EXPECT_EQ(at(sign * 100, 0.0F), Outcome::running);
    EXPECT_EQ(at(sign * 101, 0.0F), Outcome::travel_exceeded);
  }
}

TEST_F(Identified, LimitSwitchesEndIt) {
  struct Row {
    Signal signal;
    float velocity;
    Outcome outcome;
  };
  for (const auto& [signal, velocity, outcome] :
       std::initializer_list<Row>{{Signal::negative_limit, -1.0F, Outcome::limit_switch},
                                  {Signal::negative_limit, 0.0F, Outcome::running},
                                  {Signal::negative_limit, 1.0F, Outcome::running},
                                  {Signal::positive_limit, 1.0F, Outcome::limit_switch},
                                  {Signal::positive_limit, 0.0F, Outcome::running},
                                  {Signal::positive_limit, -1.0F, Outcome::running}}) {
    axis.signals = 0;
    axis.encoder_position = 0;
    ASSERT_TRUE(begin(usual));
    axis.signals = bit(signal);
    EXPECT_EQ(at(0, velocity), outcome) << velocity;
  }
}

// 0.4 rated torques per second, in addition to the holding torque, up to the limit.
TEST_F(Identified, TheTorqueRisesUntilTheAxisMoves) {
  loops.torque_reference = 0.2F;
  Request request = usual;
  request.torque_limit = 0.5F;
  ASSERT_TRUE(begin(request));
  EXPECT_NEAR(cycles_until_it_ends(), 2500, 3);
  EXPECT_EQ(identification.outcome(), Outcome::no_motion);
  ASSERT_TRUE(begin(request));
  for (int i = 1; i <= 2000; ++i) {
    at(0, 0.0F);
    EXPECT_NEAR(axis.demand.torque, 0.2F + 0.2e-3F * static_cast<float>(i), 0.5e-3F);
  }
  EXPECT_EQ(axis.demand.loop, Loop::torque);
  // After a motion of more than eight counts, the torque limit no longer ends the identification.
  at(9, 0.0F);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(at(9, 0.0F), Outcome::running);
  EXPECT_NEAR(axis.demand.torque, 0.7F, 1e-4F);
  axis.encoder_position = 0;
  ASSERT_TRUE(begin(request));
  at(8, 0.0F);
  EXPECT_NEAR(cycles_until_it_ends(), 2499, 3) << "eight are none";
  EXPECT_EQ(identification.outcome(), Outcome::no_motion);
}

TEST_F(Identified, GivesUpAfterItsTime) {
  Request request = usual;
  request.timeout_s = 0.5;
  ASSERT_TRUE(begin(request));
  EXPECT_NEAR(cycles_until_it_ends(), 1001, 1);
  EXPECT_EQ(identification.outcome(), Outcome::not_converged);
}

// A swing ends at its target speed, or at 35 % of the travel if it still continues in that direction; then the torque
// is reversed.
TEST_F(Identified, SwingsEndAtTheirSpeedOrPlace) {
  struct Row {
    Counts position;
    float velocity;
    bool ends;
  };
  for (const auto& [position, velocity, ends] : std::initializer_list<Row>{{100, 9999.0F, false},
                                                                           {100, 10000.0F, true},
                                                                           {2099, 1.0F, false},
                                                                           {2100, 1.0F, true},
                                                                           {2100, 0.0F, false},
                                                                           {2100, -1.0F, false},
                                                                           {-2100, -1.0F, false},
                                                                           {100, -10000.0F, false}}) {
    axis.encoder_position = 0;
    ASSERT_TRUE(begin(usual));
    for (int i = 0; i < 500; ++i) at(0, 0.0F);
    at(position, velocity);
    for (int i = 0; i < 20; ++i) at(100, 0.0F);
    EXPECT_EQ(axis.demand.torque < 0.0F, ends) << position << " " << velocity;
  }
  // Never faster than half the greatest speed: 300000 counts/s.
  Request request = usual;
  request.travel_counts = 1.0e6;
  request.speed_counts_per_s = 1.0e6;
  for (const float velocity : {299999.0F, 300000.0F}) {
    axis.encoder_position = 0;
    ASSERT_TRUE(begin(request));
    for (int i = 0; i < 500; ++i) at(0, 0.0F);
    at(100, velocity);
    for (int i = 0; i < 20; ++i) at(100, 0.0F);
    EXPECT_EQ(axis.demand.torque < 0.0F, velocity == 300000.0F);
  }
}

// The torque changes from one side to the other within 5 ms, in equal steps.
TEST_F(Identified, AReversalTakesItsTime) {
  axis.encoder_position = 0;
  ASSERT_TRUE(begin(usual));
  for (int i = 0; i < 500; ++i) at(0, 0.0F);
  const float amplitude = axis.demand.torque;
  EXPECT_NEAR(amplitude, 0.1F, 1e-3F);
  at(9, 10000.0F);  // moves, and immediately has its speed: the minimum torque is 1.5 times the breakaway
  const float step = 0.2F * 1.5F * amplitude;
  EXPECT_NEAR(axis.demand.torque, amplitude - step, 1e-3F);
  int cycles = 1;
  for (float before = axis.demand.torque; axis.demand.torque > -1.5F * amplitude + 1e-3F && cycles < 100; ++cycles) {
    at(100, 0.0F);
    EXPECT_LE(before - axis.demand.torque, step + 1e-3F);
    before = axis.demand.torque;
  }
  EXPECT_EQ(cycles, 9) << "from 1 to -1.5 by steps of 0.3";
}

}  // namespace
}  // namespace tuning_inertia_test
}  // namespace servodrome::drive
