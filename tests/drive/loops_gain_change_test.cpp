#include <cmath>
#include <complex>
#include <gtest/gtest.h>

#include "loops_support.hpp"

// Gains that change while the axis moves, and the filters that a set of gains can select.
namespace servodrome::drive::test {
namespace loops_gain_change_test {
namespace {

// An axis that turns against a load, with an error on which every gain acts.
struct LoadedAxis : Axis {
  explicit LoadedAxis(Loop loop) : Axis(frictionless(1 << 17), {4, 16}, {1000.0F, 40.0F, 40.0F}) {
    gains.velocity_feed_forward = 0.5F;
    configure();
    plant.set_external_torque_nm(0.4);
    demand.loop = loop;
    speed = counts_per_s(300.0);
    demand.velocity = static_cast<float>(speed);
    run(0.5);
  }
  void run(double seconds) {
    for (auto ticks = std::lround(seconds / tick_seconds); ticks > 0; --ticks) {
      if (cascade.position_loop_due()) {
        way += speed * 16.0 * tick_seconds;
        demand.position = static_cast<Counts>(std::floor(way));
        demand.position_fraction = static_cast<float>(way - std::floor(way));
      }
      tick();
    }
  }
  // Greatest step of the torque reference from one velocity period to the next.
  double greatest_step(double seconds) {
    double worst = 0.0;
    for (auto periods = std::lround(seconds / (4.0 * tick_seconds)); periods > 0; --periods) {
      const float before = cascade.state().torque_reference;
      run(4.0 * tick_seconds);
      worst = std::max(worst, static_cast<double>(std::fabs(cascade.state().torque_reference - before)));
    }
    return worst;
  }
  double speed = 0.0;
  double way = 0.0;
};

TEST(GainChange, TorqueGoesOnWithoutAStep) {
  struct Change {
    const char* what;
    void (*apply)(Gains&);
  };
  const Change changes[] = {
      {"velocity kp", [](Gains& g) { g.velocity_kp *= 2.0F; }},
      {"velocity kp down", [](Gains& g) { g.velocity_kp *= 0.4F; }},
      {"velocity ki", [](Gains& g) { g.velocity_ki *= 3.0F; }},
      {"position kp", [](Gains& g) { g.position_kp *= 2.0F; }},
      {"feed-forward", [](Gains& g) { g.velocity_feed_forward = 0.9F; }},
      {"no integral", [](Gains& g) { g.velocity_ki = 0.0F; }},
      {"second order", [](Gains& g) { g.velocity_feedback = VelocityFeedback::second_order; }},
      {"observer", [](Gains& g) { g.velocity_feedback = VelocityFeedback::observer; }},
      {"command filter", [](Gains& g) { g.velocity_command_filter_hz = 240.0F; }},
      {"notch",
       [](Gains& g) {
         g.notches[3] = {500.0F, 250.0F, 0.1F};
       }},
  };
  for (const Loop loop : {Loop::velocity, Loop::position}) {
    for (const Change& change : changes) {
      LoadedAxis axis(loop);
      const double quiet = axis.greatest_step(0.02);
      change.apply(axis.gains);
      axis.configure();
      // A torque that fades out changes by a thirtieth per period; the load is 0.31 of the rated torque.
      EXPECT_LT(axis.greatest_step(0.02), quiet + 0.02) << change.what;
    }
  }
}

// At the end the held-back part of the torque is gone: the axis behaves as if it always had these gains.
TEST(GainChange, EndsWhereTheNewGainsLead) {
  LoadedAxis axis(Loop::position);
  axis.gains.position_kp *= 2.0F;
  axis.configure();
  axis.run(1.0);
  const double expected = 0.5 * axis.speed / static_cast<double>(axis.gains.position_kp);
  EXPECT_NEAR(static_cast<double>(axis.cascade.state().following_error_counts), expected, 0.01 * expected);
  axis.gains.velocity_ki = 0.0F;
  axis.configure();
  axis.run(1.0);
  // Without an integral a velocity error holds the load: torque / kp.
  const double kt = static_cast<double>(axis.motor.torque_constant_nm_per_a);
  const double slip = 0.4 / kt / static_cast<double>(axis.gains.velocity_kp) * axis.counts_per_rad;
  const double more = slip / static_cast<double>(axis.gains.position_kp);
  EXPECT_NEAR(static_cast<double>(axis.cascade.state().following_error_counts), expected + more,
              0.01 * (expected + more));
}

TEST(GainChange, OfNothingChangesNothing) {
  LoadedAxis axis(Loop::position);
  LoadedAxis twin(Loop::position);
  for (int i = 0; i < 200; ++i) {
    axis.configure();
    axis.run(tick_seconds);
    twin.run(tick_seconds);
    ASSERT_EQ(axis.cascade.state().torque_reference, twin.cascade.state().torque_reference);
    ASSERT_EQ(axis.plant.current_a(), twin.plant.current_a());
  }
}

// Closed-loop response of the measured speed to the reference.
std::complex<double> closed_loop(Axis& axis, double frequency_hz) {
  const double period_s = tick_seconds * axis.rates.velocity_loop_ticks;
  const int samples = static_cast<int>(std::lround(1.0 / period_s));
  const double w = 2.0 * pi * frequency_hz;
  axis.demand.loop = Loop::velocity;
  std::complex<double> in = 0.0;
  std::complex<double> out = 0.0;
  for (int k = -samples / 2; k < samples; ++k) {
    const double t = k * period_s;
    const double reference = axis.counts_per_s(200.0 + 30.0 * std::sin(w * t));
    axis.demand.velocity = static_cast<float>(reference);
    axis.cascade.set_demand(axis.demand);
    if (k >= 0) {
      in += std::polar(1.0, -w * t) * reference;
      out += std::polar(1.0, -w * t) * axis.counts_per_s(axis.plant.velocity_rpm());
    }
    for (int i = 0; i < axis.rates.velocity_loop_ticks; ++i) {
      axis.cascade.tick(axis.feedback, axis.actuation);
      axis.plant.step(axis.actuation, axis.feedback);
    }
  }
  return out / in;
}

// A P loop of 50 Hz on a bare inertia: with unfiltered feedback the closed loop is a first-order lag of 50 Hz; the low
// passes add phase lag; the observer, which knows the torque, lags less than either; the command filter is a
// first-order lag before the loop.
TEST(VelocityFeedback, FiltersAreWhatTheyAreCalled) {
  const auto response = [](VelocityFeedback feedback, float filter_hz, float command_hz) {
    Axis axis(frictionless(1 << 20), {2, 8});
    axis.gains.velocity_kp =
        2.0F * static_cast<float>(pi) * 50.0F * axis.motor.inertia_kgm2 / axis.motor.torque_constant_nm_per_a;
    axis.gains.velocity_ki = 0.0F;
    axis.gains.torque_filter_hz = 0.0F;
    axis.gains.velocity_feedback = feedback;
    axis.gains.velocity_filter_hz = filter_hz;
    axis.gains.velocity_command_filter_hz = command_hz;
    axis.configure();
    return closed_loop(axis, 50.0);
  };
  // With the measurement M (a difference over one period is half a period late), the filter F, and G from the torque to
  // the speed: T = G / (1 + G F M). The first-order low pass, exact for held inputs, is half a period early. G also
  // depends a little on the filter: the current loop compensates the back-EMF with the filtered speed.
  const std::complex<double> measurement = std::polar(1.0, -2.0 * pi * 50.0 * 62.5e-6);
  const std::complex<double> bare = response(VelocityFeedback::first_order, 0.0F, 0.0F);
  const std::complex<double> forward = bare / (1.0 - bare * measurement);
  EXPECT_NEAR(std::abs(forward), 1.0, 0.01);
  const auto expected = [&](std::complex<double> filter) { return forward / (1.0 + forward * filter * measurement); };
  const std::complex<double> s(0.0, 50.0 / 240.0);
  const std::complex<double> first = response(VelocityFeedback::first_order, 240.0F, 0.0F);
  EXPECT_LT(std::abs(first - expected(1.0 / ((1.0 + s) * measurement))), 0.04);
  const std::complex<double> second = response(VelocityFeedback::second_order, 240.0F, 0.0F);
  EXPECT_LT(std::abs(second - expected(1.0 / (1.0 + std::sqrt(2.0) * s + s * s))), 0.05);
  const std::complex<double> observer = response(VelocityFeedback::observer, 240.0F, 0.0F);
  EXPECT_LT(std::abs(observer - bare), 0.5 * std::abs(first - bare));
  const std::complex<double> command = response(VelocityFeedback::first_order, 0.0F, 240.0F);
  EXPECT_LT(std::abs(command - bare / (1.0 + s)), 0.03);
}

TEST(VelocityIntegral, GivesNoMoreThanItsLimit) {
  for (const double load_nm : {0.2, 0.6}) {
    LoadedAxis axis(Loop::velocity);
    axis.plant.set_external_torque_nm(load_nm);
    const double kt = static_cast<double>(axis.motor.torque_constant_nm_per_a);
    axis.gains.velocity_integral_limit_a = static_cast<float>(0.4 / kt);
    axis.configure();
    axis.run(2.0);
    // Beyond the limit, the proportional part must provide the rest, and it needs an error for that.
    const double slip = std::max(load_nm - 0.4, 0.0) / kt / static_cast<double>(axis.gains.velocity_kp);
    const double error = (axis.speed - axis.counts_per_s(axis.plant.velocity_rpm())) / axis.counts_per_rad;
    EXPECT_NEAR(error, slip, 0.01 * slip + 0.02) << load_nm;
  }
}

}  // namespace
}  // namespace loops_gain_change_test
}  // namespace servodrome::drive::test
