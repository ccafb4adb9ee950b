#include "drive/supervision.hpp"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <utility>
#include <vector>

// The monitors: each threshold just inside and just outside, each time exact to the cycle.
namespace servodrome::drive {
namespace supervision_test {
namespace {

using Situation = Supervision::Situation;

constexpr int cycles_per_ms = 2;

struct Monitored : testing::Test {
  Monitored() {
    axis.loops = &loops;
    axis.configuration.motor.counts_per_revolution = 6000;
    axis.units.counts_per_revolution = 6000.0;  // 1 rpm is 100 counts/s
    situation.energised = true;
    situation.dc_link_expected = true;
    feedback.dc_link_v = 310.0F;
    supervision.configure(axis);
  }
  void cycle() { supervision.cycle(axis, feedback, situation); }
  bool present(Cause cause) const { return supervision.present().test(cause); }
  // Returns true if one cycle with the present values raises the cause.
  bool shows(Cause cause) {
    cycle();
    return present(cause);
  }
  // Returns in which of the next cycles the cause is raised; 0: in none.
  int comes_after(Cause cause, int most = 10000) {
    for (int i = 1; i <= most; ++i) {
      if (shows(cause)) return i;
    }
    return 0;
  }

  Objects objects{};
  Policy policy{};
  CascadeState loops{};
  Axis axis{objects, policy};
  Feedback feedback{};
  Situation situation{};
  Supervision supervision{};
  Monitors& monitors = axis.configuration.monitors;
};

TEST_F(Monitored, NothingIsPresentAtRest) {
  for (int i = 0; i < 1000; ++i) cycle();
  EXPECT_FALSE(supervision.present().any());
  EXPECT_FALSE(supervision.warning());
  EXPECT_FALSE(supervision.chopper());
}

TEST_F(Monitored, FlagsOfEncoderAndPowerStage) {
  struct Row {
    std::uint32_t flag;
    Cause cause;
  };
  const auto encoder = std::to_array<Row>({{1U << 0, Cause::encoder_connection},
                                           {1U << 1, Cause::encoder_crc},
                                           {1U << 2, Cause::encoder_delimiter},
                                           {1U << 3, Cause::encoder_multi_turn},
                                           {1U << 4, Cause::encoder_count},
                                           {1U << 5, Cause::encoder_count_overflow},
                                           {1U << 6, Cause::hall_wiring},
                                           {1U << 7, Cause::hall_state}});
  const auto hardware = std::to_array<Row>({{1U << 0, Cause::overcurrent_u},
                                            {1U << 1, Cause::overcurrent_v},
                                            {1U << 2, Cause::overcurrent_w},
                                            {1U << 3, Cause::bus_overcurrent},
                                            {1U << 4, Cause::short_circuit},
                                            {1U << 5, Cause::gate_supply},
                                            {1U << 6, Cause::internal_hardware}});
  const auto only = [this](Cause cause) {
    CauseSet set;
    set.set(cause);
    cycle();
    return supervision.present() == set;
  };
  for (const auto& [flag, cause] : encoder) {
    feedback.encoder_faults = flag;
    EXPECT_TRUE(only(cause)) << flag;
  }
  feedback.encoder_faults = 0;
  for (const auto& [flag, cause] : hardware) {
    situation.hardware_faults = flag;
    EXPECT_TRUE(only(cause)) << flag;
    EXPECT_EQ(Supervision::comparator_of(cause), flag);
  }
  EXPECT_EQ(Supervision::comparator_of(Cause::over_voltage), 0U);
  situation.hardware_faults = 0;
  axis.configuration.encoder_loss = Cause::encoder_resolver;
  feedback.encoder_faults = 1;
  EXPECT_TRUE(only(Cause::encoder_resolver));
}

TEST_F(Monitored, Signals) {
  axis.signals = bit(Signal::external_fault);
  EXPECT_TRUE(shows(Cause::external));
  axis.signals = bit(Signal::motor_temperature);
  EXPECT_TRUE(shows(Cause::motor_contact));
  EXPECT_FALSE(present(Cause::external));
  axis.signals = bit(Signal::enable_refused);
  EXPECT_TRUE(shows(Cause::enable_refused));
  situation.energised = false;
  EXPECT_FALSE(shows(Cause::enable_refused)) << "without power nothing is refused";
}

TEST_F(Monitored, DcLinkVoltages) {
  feedback.dc_link_v = 400.0F;
  EXPECT_FALSE(shows(Cause::over_voltage));
  feedback.dc_link_v = 400.1F;
  EXPECT_TRUE(shows(Cause::over_voltage));
  monitors.over_voltage_v = 0.0F;
  EXPECT_FALSE(shows(Cause::over_voltage)) << "0: it is not watched";

  monitors.under_voltage_near_v = 220.0F;
  feedback.dc_link_v = 220.0F;
  EXPECT_FALSE(shows(Cause::under_voltage_near));
  feedback.dc_link_v = 219.9F;
  EXPECT_TRUE(shows(Cause::under_voltage_near));
  feedback.dc_link_v = 200.0F;
  EXPECT_EQ(comes_after(Cause::under_voltage), 0);
  feedback.dc_link_v = 199.9F;
  EXPECT_EQ(comes_after(Cause::under_voltage), 5 * cycles_per_ms) << "a dip of less than 5 ms is ridden through";
  situation.dc_link_expected = false;
  EXPECT_FALSE(shows(Cause::under_voltage));
  EXPECT_FALSE(shows(Cause::under_voltage_near));
}

TEST_F(Monitored, ChopperHasAHysteresis) {
  const auto at = [this](float volts) {
    feedback.dc_link_v = volts;
    cycle();
    return supervision.chopper();
  };
  EXPECT_FALSE(at(380.0F));
  EXPECT_TRUE(at(380.1F));
  EXPECT_TRUE(at(370.0F));
  EXPECT_FALSE(at(369.9F));
  EXPECT_FALSE(at(375.0F));
  monitors.brake_resistor_ms = 100;
  feedback.dc_link_v = 381.0F;
  EXPECT_EQ(comes_after(Cause::brake_resistor), 100 * cycles_per_ms);
  monitors.brake_resistor_ms = 0;
  EXPECT_EQ(comes_after(Cause::brake_resistor, 1000), 0) << "0: for ever";
}

TEST_F(Monitored, MainsMayBeAwayForAWhile) {
  feedback.supply_present = false;
  EXPECT_EQ(comes_after(Cause::power_failure), 20 * cycles_per_ms);
  feedback.supply_present = true;
  EXPECT_FALSE(shows(Cause::power_failure));
  feedback.supply_present = false;
  situation.dc_link_expected = false;
  EXPECT_EQ(comes_after(Cause::power_failure, 1000), 0);
}

TEST_F(Monitored, Temperatures) {
  struct Row {
    float Feedback::*measured;
    float threshold;
    Cause cause;
  };
  for (const auto& [measured, threshold, cause] :
       std::to_array<Row>({{&Feedback::power_stage_temperature_c, 95.0F, Cause::power_stage_hot},
                           {&Feedback::winding_temperature_c, 130.0F, Cause::motor_hot},
                           {&Feedback::encoder_temperature_c, 95.0F, Cause::encoder_hot},
                           {&Feedback::ambient_temperature_c, 60.0F, Cause::ambient_hot}})) {
    const auto warns_at = [&, place = measured](float celsius) {
      feedback.*place = celsius;
      cycle();
      return supervision.warning();
    };
    EXPECT_FALSE(warns_at(threshold - 10.0F)) << threshold;
    EXPECT_TRUE(warns_at(threshold - 9.9F)) << threshold;
    EXPECT_TRUE(warns_at(threshold));
    EXPECT_FALSE(present(cause)) << threshold;
    warns_at(threshold + 0.1F);
    EXPECT_TRUE(present(cause)) << threshold;
    feedback.*measured = 25.0F;
  }
  monitors.warning_margin_c = 0.0F;
  feedback.winding_temperature_c = 131.0F;
  EXPECT_TRUE(shows(Cause::motor_hot));
  EXPECT_FALSE(supervision.warning()) << "no margin, no warning";
  monitors.motor_hot_c = 0.0F;
  EXPECT_FALSE(shows(Cause::motor_hot)) << "0: it is not watched";
  feedback.ambient_temperature_c = -20.0F;
  EXPECT_FALSE(shows(Cause::ambient_cold));
  feedback.ambient_temperature_c = -20.1F;
  EXPECT_TRUE(shows(Cause::ambient_cold));
}

// The rated current heats up to 100 % and no further; the displayed value leads by its own share.
TEST_F(Monitored, Overload) {
  monitors.overload_near_percent = 50.0F;
  loops.current_d_a = 3.0F;
  loops.current_q_a = 4.0F;  // 5 A of 3.82 A
  int near = 0, warned = 0, tripped = 0;
  for (int i = 1; i < 100000 && tripped == 0; ++i) {
    cycle();
    if (near == 0 && present(Cause::i2t_near)) near = i;
    if (warned == 0 && supervision.warning()) warned = i;
    if (present(Cause::i2t)) tripped = i;
  }
  // -tau ln(1 - share (rated / i)^2), tau = -3 s / ln(1 - (rated / peak)^2), 0.5 ms a cycle.
  const double rated = static_cast<double>(axis.configuration.motor.rated_current_a);
  const double peak = static_cast<double>(axis.configuration.motor.peak_current_a);
  const double i = 5.0;
  const double tau = -3.0 / std::log(1.0 - rated * rated / (peak * peak));
  const auto cycles = [&](double share) { return -tau * std::log(1.0 - share * rated * rated / (i * i)) / 0.5e-3; };
  EXPECT_NEAR(near, cycles(0.5), 2.0);
  EXPECT_NEAR(warned, cycles(0.9), 2.0);
  EXPECT_NEAR(tripped, cycles(1.0), 2.0);
  monitors.i2t = false;
  EXPECT_FALSE(shows(Cause::i2t));
  EXPECT_FALSE(supervision.warning());
}

TEST_F(Monitored, OverloadOfThePowerStage) {
  monitors.stage_rated_current_a = 2.0F;
  monitors.stage_peak_current_a = 6.0F;
  monitors.overload_near_percent = 80.0F;
  supervision.configure(axis);
  loops.current_q_a = 3.0F;  // less than the motor's rated current
  const int near = comes_after(Cause::stage_i2t_near, 100000);
  EXPECT_GT(supervision.stage_utilisation_percent(), 80.0);
  const int tripped = comes_after(Cause::i2t, 100000);
  EXPECT_GT(near, 0);
  EXPECT_GT(tripped, 0);
  EXPECT_FALSE(present(Cause::stage_i2t));
  EXPECT_LT(supervision.i2t_utilisation_percent(), 80.0);
  EXPECT_FALSE(present(Cause::i2t_near));
  monitors.stage_apart = true;
  EXPECT_TRUE(shows(Cause::stage_i2t));
  EXPECT_FALSE(present(Cause::i2t));
  monitors.overload_near_percent = 0.0F;
  EXPECT_FALSE(shows(Cause::stage_i2t_near));
}

TEST_F(Monitored, OverSpeed) {
  const auto at = [this](double rpm) {
    loops.velocity_counts_per_s = static_cast<float>(rpm * 100.0);
    return shows(Cause::over_speed);
  };
  const auto keeps = [&](double rpm) {
    const int cycles = static_cast<int>(axis.cycles(100));
    for (int i = 0; i < cycles; ++i) EXPECT_FALSE(at(rpm));
  };
  for (const double sign : {1.0, -1.0}) {
    EXPECT_FALSE(at(sign * 7199.0));  // 1.2 x 6000 rpm
    EXPECT_TRUE(at(sign * 7201.0));
  }
  objects.max_motor_speed_rpm = 1000;
  keeps(0.0);
  EXPECT_FALSE(at(1199.0));
  EXPECT_TRUE(at(1201.0));
  monitors.over_speed_by_object = false;
  EXPECT_FALSE(at(1201.0));
  EXPECT_FALSE(at(7199.0));
  EXPECT_TRUE(at(7201.0));
  monitors.over_speed_rpm = 500.0F;
  keeps(0.0);
  EXPECT_FALSE(at(499.0));
  EXPECT_TRUE(at(501.0));
  // A lowered limit is monitored when the shaft has stayed a tenth below it.
  EXPECT_FALSE(at(450.0));
  monitors.over_speed_rpm = 300.0F;
  EXPECT_FALSE(at(450.0));
  EXPECT_TRUE(at(501.0)) << "till then that of before";
  keeps(271.0);
  EXPECT_FALSE(at(301.0)) << "the speed ripples";
  EXPECT_FALSE(at(269.0));
  EXPECT_FALSE(at(301.0)) << "an instant below it, as of a shaft that turns round";
  keeps(269.0);
  EXPECT_TRUE(at(301.0));
}

TEST_F(Monitored, FollowingError) {
  situation.loop = Loop::position;
  objects.following_error_window = 100;
  objects.following_error_time_out_ms = 10;
  monitors.following_error_near = 0.5F;
  for (const int sign : {1, -1}) {
    const auto at = [&](int counts) {
      loops.following_error_counts = sign * counts;
      cycle();
    };
    at(50);
    EXPECT_FALSE(present(Cause::following_error_near));
    at(51);
    EXPECT_TRUE(present(Cause::following_error_near));
    at(100);
    EXPECT_EQ(comes_after(Cause::following_error, 1000), 0);
    EXPECT_FALSE(axis.following_error);
    loops.following_error_counts = sign * 101;
    EXPECT_EQ(comes_after(Cause::following_error, 1000), 10 * cycles_per_ms);
    EXPECT_TRUE(axis.following_error);
    at(100);
    EXPECT_FALSE(present(Cause::following_error));
  }
  loops.following_error_counts = 101;
  objects.following_error_window = 0xFFFFFFFF;  // CiA 402-2: switched off
  EXPECT_EQ(comes_after(Cause::following_error, 100), 0);
  objects.following_error_window = 0;
  monitors.window_of_zero = 101;
  EXPECT_EQ(comes_after(Cause::following_error, 100), 0);
  monitors.window_of_zero = 100;
  EXPECT_EQ(comes_after(Cause::following_error, 100), 10 * cycles_per_ms);
  // Only if a position demand applies.
  situation.pressing = 1;  // homing against a hard stop: the demand is ahead on purpose, never behind
  EXPECT_FALSE(shows(Cause::following_error));
  loops.following_error_counts = -101;
  EXPECT_EQ(comes_after(Cause::following_error, 1000), 10 * cycles_per_ms);
  situation.pressing = -1;
  EXPECT_FALSE(shows(Cause::following_error));
  situation.pressing = 0;
  situation.loop = Loop::velocity;
  EXPECT_EQ(comes_after(Cause::following_error, 100), 0);
  situation.loop = Loop::position;
  situation.energised = false;
  EXPECT_EQ(comes_after(Cause::following_error, 100), 0);
}

TEST_F(Monitored, ClippedAcceleration) {
  monitors.acceleration_clipped = true;
  situation.profiled = true;
  objects.max_acceleration = objects.max_deceleration = 0;
  objects.profile_acceleration = objects.profile_deceleration = 1000;
  EXPECT_FALSE(shows(Cause::acceleration_clipped)) << "0: no limit";
  objects.max_acceleration = objects.max_deceleration = 1000;
  EXPECT_FALSE(shows(Cause::acceleration_clipped));
  objects.profile_acceleration = 1001;
  EXPECT_TRUE(shows(Cause::acceleration_clipped));
  objects.profile_acceleration = 1000;
  objects.profile_deceleration = 1001;
  EXPECT_TRUE(shows(Cause::acceleration_clipped));
  situation.profiled = false;
  EXPECT_FALSE(shows(Cause::acceleration_clipped));
  situation.profiled = true;
  monitors.acceleration_clipped = false;
  EXPECT_FALSE(shows(Cause::acceleration_clipped));
}

TEST_F(Monitored, JammedAtTheTorqueLimit) {
  monitors.jammed_ms = 50;
  loops.torque_limited = true;
  for (const Loop loop : {Loop::position, Loop::velocity}) {
    situation.loop = loop;
    axis.counts_per_ms = 0;
    EXPECT_EQ(comes_after(Cause::jammed, 1000), 50 * cycles_per_ms);
    axis.counts_per_ms = 1;
    EXPECT_FALSE(shows(Cause::jammed)) << "it moves";
  }
  axis.counts_per_ms = 0;
  situation.loop = Loop::torque;
  EXPECT_EQ(comes_after(Cause::jammed, 200), 0);
  situation.loop = Loop::velocity;
  situation.pressing = 1;
  EXPECT_EQ(comes_after(Cause::jammed, 200), 0);
  situation.pressing = 0;
  situation.energised = false;
  EXPECT_EQ(comes_after(Cause::jammed, 200), 0);
  situation.energised = true;
  loops.torque_limited = false;
  EXPECT_EQ(comes_after(Cause::jammed, 200), 0);
}

TEST_F(Monitored, LostIndex) {
  monitors.index_lost_revolutions = 2;
  const std::vector<SignalEdge> pulse{{Signal::index, true, 1000}};
  const std::vector<SignalEdge> another{{Signal::home, true, 1000}};
  const auto at = [this](Counts position) {
    axis.encoder_position = position;
    return shows(Cause::index_lost);
  };
  situation.energised = false;
  EXPECT_FALSE(at(500)) << "without power the place is where it begins";
  situation.energised = true;
  EXPECT_FALSE(at(12500));
  EXPECT_TRUE(at(12501));
  EXPECT_FALSE(at(-11500));
  EXPECT_TRUE(at(-11501));
  axis.edges = another;
  EXPECT_TRUE(at(12501)) << "not the index";
  axis.edges = pulse;
  EXPECT_FALSE(at(13000));
  axis.edges = {};
  EXPECT_FALSE(at(13000));
  EXPECT_TRUE(at(13001));
  monitors.index_lost_revolutions = 0;
  EXPECT_FALSE(at(13001));
}

TEST_F(Monitored, VelocityError) {
  monitors.velocity_error = 1000.0;
  monitors.velocity_error_ms = 30;
  situation.loop = Loop::velocity;
  axis.generator.start_from(0, 5000.0);
  for (const float velocity : {4000.0F, 6000.0F}) {
    loops.velocity_counts_per_s = velocity;
    EXPECT_EQ(comes_after(Cause::velocity_error, 200), 0);
    loops.velocity_counts_per_s = velocity < 5000.0F ? 3999.0F : 6001.0F;
    EXPECT_EQ(comes_after(Cause::velocity_error, 200), 30 * cycles_per_ms);
  }
  situation.loop = Loop::position;
  EXPECT_EQ(comes_after(Cause::velocity_error, 200), 0);
  situation.loop = Loop::velocity;
  situation.energised = false;
  EXPECT_EQ(comes_after(Cause::velocity_error, 200), 0);
  situation.energised = true;
  monitors.velocity_error = 0.0;
  EXPECT_EQ(comes_after(Cause::velocity_error, 200), 0) << "0: it is not watched";
}

TEST_F(Monitored, PositionLimit) {
  policy.limits.target_beyond = OutOfLimits::fault;
  policy.limits.software_needs_homing = true;
  objects.min_position_limit = -1000;
  objects.max_position_limit = 2000;
  axis.homed = true;
  situation.loop = Loop::position;
  const auto at = [this](Counts demand, double velocity) {
    axis.generator.start_from(demand, velocity);
    return shows(Cause::position_limit);
  };
  EXPECT_FALSE(at(2000, 10.0));
  EXPECT_TRUE(at(2001, 10.0));
  EXPECT_FALSE(at(2001, 0.0));
  EXPECT_FALSE(at(2001, -10.0)) << "on its way back";
  EXPECT_FALSE(at(-1000, -10.0));
  EXPECT_TRUE(at(-1001, -10.0));
  EXPECT_FALSE(at(-1001, 0.0));
  EXPECT_FALSE(at(-1001, 10.0));
  // In other loops the position of the shaft applies.
  situation.loop = Loop::velocity;
  EXPECT_FALSE(at(2001, 10.0));
  axis.encoder_position = 2001;
  EXPECT_TRUE(at(0, 10.0));
  axis.units.position_inverted = true;
  EXPECT_TRUE(at(0, 10.0)) << "-2001 user units, and falling";
  EXPECT_FALSE(at(0, -10.0));
  axis.units.position_inverted = false;
  situation.energised = false;
  EXPECT_FALSE(at(0, 10.0));
  situation.energised = true;
  axis.homed = false;
  EXPECT_FALSE(at(0, 10.0));
  policy.limits.software_needs_homing = false;
  EXPECT_TRUE(at(0, 10.0));
}

TEST_F(Monitored, LimitSwitches) {
  const std::uint32_t positive = bit(Signal::positive_limit);
  const std::uint32_t negative = bit(Signal::negative_limit);
  axis.signals = positive | negative;
  EXPECT_FALSE(shows(Cause::positive_limit)) << "not watched";
  monitors.limit_switches = true;
  axis.signals = 0;
  axis.homed = true;
  cycle();
  axis.signals = positive;
  EXPECT_TRUE(shows(Cause::positive_limit)) << "met";
  EXPECT_FALSE(present(Cause::negative_limit));
  EXPECT_FALSE(shows(Cause::positive_limit)) << "stood on";
  axis.signals = positive | negative;
  EXPECT_TRUE(shows(Cause::negative_limit));
  EXPECT_FALSE(present(Cause::positive_limit));
  axis.signals = 0;
  cycle();
  axis.signals = positive;
  situation.homing = true;
  EXPECT_FALSE(shows(Cause::positive_limit)) << "homing looks for it";
  situation.homing = false;
  axis.signals = 0;
  cycle();
  axis.homed = false;
  axis.signals = positive;
  EXPECT_FALSE(shows(Cause::positive_limit)) << "only after homing";
  monitors.limit_switches = false;
  monitors.limit_switch_levels = true;
  EXPECT_TRUE(shows(Cause::positive_limit)) << "the level, homed or not";
  EXPECT_TRUE(shows(Cause::positive_limit));
  situation.homing = true;
  EXPECT_FALSE(shows(Cause::positive_limit));
}

// With a closed brake: a hundredth of a turn, or ten counts if that is less.
TEST_F(Monitored, SlippingBrake) {
  for (const auto& [counts_per_revolution, most] : {std::pair{6000U, 60}, {500U, 10}}) {
    for (const int sign : {1, -1}) {
      axis.configuration.motor.counts_per_revolution = counts_per_revolution;
      situation.brake_closed = false;
      axis.encoder_position = 7000;
      cycle();
      axis.encoder_position = 5000;
      EXPECT_FALSE(shows(Cause::brake)) << "open";
      situation.brake_closed = true;
      EXPECT_FALSE(shows(Cause::brake));
      axis.encoder_position = 5000 + sign * most;
      EXPECT_FALSE(shows(Cause::brake));
      axis.encoder_position = 5000 + sign * (most + 1);
      EXPECT_TRUE(shows(Cause::brake));
    }
  }
}

}  // namespace
}  // namespace supervision_test
}  // namespace servodrome::drive
