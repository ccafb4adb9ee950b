#include <array>
#include <cmath>
#include <complex>
#include <gtest/gtest.h>
#include <optional>

#include "loops_support.hpp"

// Closed-loop frequency responses with a delayed power stage. A small sine is the reference of a loop; its response is
// calculated by correlation and compared with that of the linear equations of controller, hold, delay, winding and
// shaft. The sensors are ideal, and no limit is reached.
namespace servodrome::drive::test {
namespace loops_response_test {
namespace {

using Complex = std::complex<double>;

constexpr double most_decibels = 0.2;
constexpr double most_degrees = 2.0;
constexpr std::array frequencies_hz{4.0,   12.0,  32.0,  60.0,  100.0, 140.0, 200.0,
                                    260.0, 340.0, 452.0, 600.0, 760.0, 900.0, 1000.0};

// Current, speed and angle of the shaft.
template <typename Number>
using State = std::array<Number, 3>;

// Response of winding and shaft to a voltage that is held for a tick, at z:
// L i' = v - R i - e w, J w' = k i, angle' = w.
struct Machine {
  double resistance_ohm;
  double inductance_h;
  double emf_vs;  // V per rad/s
  double torque_nm_per_a;
  double inertia_kgm2;
  bool locked;

  State<double> slope(const State<double>& x, double volts) const {
    const double current = (volts - resistance_ohm * x[0] - emf_vs * x[1]) / inductance_h;
    return {current, locked ? 0.0 : torque_nm_per_a * x[0] / inertia_kgm2, x[1]};
  }
  // The state one tick later, by the Taylor series of the exponential.
  State<double> after_tick(State<double> x, double volts) const {
    State<double> term = x;
    for (int n = 1; n <= 20; ++n) {
      const State<double> derivative = slope(term, n == 1 ? volts : 0.0);
      for (std::size_t j = 0; j < 3; ++j) x[j] += term[j] = derivative[j] * tick_seconds / n;
    }
    return x;
  }
  // Solves (z - A) x = B; the angle has no effect on the other states.
  State<Complex> response(Complex z) const {
    const State<double> by_current = after_tick({1.0, 0.0, 0.0}, 0.0);
    const State<double> by_speed = after_tick({0.0, 1.0, 0.0}, 0.0);
    const State<double> by_volts = after_tick({}, 1.0);
    const Complex determinant = (z - by_current[0]) * (z - by_speed[1]) - by_speed[0] * by_current[1];
    const Complex current = (by_volts[0] * (z - by_speed[1]) + by_speed[0] * by_volts[1]) / determinant;
    const Complex speed = ((z - by_current[0]) * by_volts[1] + by_current[1] * by_volts[0]) / determinant;
    return {current, speed, (by_current[2] * current + by_speed[2] * speed + by_volts[2]) / (z - 1.0)};
  }
};

// The response at `z` of samples taken every `ratio` steps from a system whose input is held for `ratio` steps: the sum
// over all aliased frequencies.
template <typename System>
auto decimated(Complex z, int ratio, const System& system) {
  auto sum = decltype(system(z)){};
  for (int alias = 0; alias < ratio; ++alias) {
    const Complex fast = std::polar(1.0, (std::arg(z) + 2.0 * pi * alias) / ratio);
    Complex hold = 0.0;
    for (int step = 0; step < ratio; ++step) hold += std::pow(fast, -step) / static_cast<double>(ratio);
    const auto response = system(fast);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += hold * response[i];
  }
  return sum;
}

// Closed loops of the cascade (drive/loops/cascade.hpp) in SI units, each at the samples of its own rate.
struct Model {
  Machine machine;
  Gains gains;
  Rates rates;
  int delay_ticks;

  static Complex low_pass(double corner_hz, double period_s, Complex z) {
    const double kept = corner_hz > 0.0 ? std::exp(-2.0 * pi * corner_hz * period_s) : 0.0;
    return (1.0 - kept) / (1.0 - kept / z);
  }

  // Current, speed and angle as a function of the current reference, then of a voltage added to the controller's.
  std::array<Complex, 6> current_loop(Complex z) const {
    const double winding_pole = std::exp(-machine.resistance_ohm * tick_seconds / machine.inductance_h);
    const double loop_pole = std::exp(-2.0 * pi * static_cast<double>(gains.current_bandwidth_hz) * tick_seconds);
    const double kp = (1.0 - loop_pole) * machine.resistance_ohm / (1.0 - winding_pole);
    const Complex controller = kp * (z - winding_pole) / (z - 1.0);
    const State<Complex> plant = machine.response(z);
    const Complex late = std::pow(z, -delay_ticks);
    const Complex closed = late / (1.0 + controller * plant[0] * late);
    std::array<Complex, 6> response;
    for (std::size_t i = 0; i < 3; ++i) {
      response[i] = plant[i] * controller * closed;
      response[i + 3] = plant[i] * closed;
    }
    return response;
  }

  // Speed and angle as a function of the velocity reference.
  std::array<Complex, 2> velocity_loop(Complex z) const {
    const double period_s = rates.velocity_loop_ticks * tick_seconds;
    const auto by = decimated(z, rates.velocity_loop_ticks, [this](Complex fast) { return current_loop(fast); });
    const Complex measured =  // of the angle
        low_pass(static_cast<double>(gains.velocity_filter_hz), period_s, z) * (1.0 - 1.0 / z) / period_s;
    const Complex controller =
        low_pass(static_cast<double>(gains.torque_filter_hz), period_s, z) *
        (static_cast<double>(gains.velocity_kp) + static_cast<double>(gains.velocity_ki) * period_s / (z - 1.0));
    // The measured speed: compared with the reference, and as the back-EMF that the drive adds.
    const Complex back_speed = by[1] * controller - by[4] * machine.emf_vs;
    const Complex back_angle = by[2] * controller - by[5] * machine.emf_vs;
    const Complex angle = by[2] * controller / (1.0 + back_angle * measured);
    return {by[1] * controller - back_speed * measured * angle, angle};
  }

  Complex position_loop(Complex z) const {
    const int ratio = rates.position_loop_ticks / rates.velocity_loop_ticks;
    const Complex angle = decimated(z, ratio, [this](Complex fast) { return velocity_loop(fast); })[1];
    const Complex open = static_cast<double>(gains.position_kp) * angle;
    return open / (1.0 + open);
  }
};

class LateLoops : public ::testing::Test {
 protected:
  void prepare(int delay_ticks, Rates rates, bool locked) {
    plant::Parameters parameters = frictionless(1 << 24);
    parameters.stage = {
        .ideal = false, .delay_ticks = delay_ticks, .dead_time_us = 0.0, .switch_drop_v = 0.0, .modulation_limit = 1.0};
    axis_.emplace(parameters, rates);
    Axis& axis = *axis_;
    axis.motor.voltage_delay_ticks = static_cast<std::uint8_t>(delay_ticks);
    axis.gains = default_gains(axis.motor, rates, {});
    axis.configure();
    axis.plant.lock_rotor(locked);
    const plant::Motor& motor = parameters.motor;
    model_ = {.machine = {.resistance_ohm = motor.resistance_ohm,
                          .inductance_h = motor.quadrature_inductance_h,
                          .emf_vs = motor.pole_pairs * plant::flux_linkage_vs(motor),
                          .torque_nm_per_a = 1.5 * motor.pole_pairs * plant::flux_linkage_vs(motor),
                          .inertia_kgm2 = motor.rotor_inertia_kgm2 + parameters.load.inertia_kgm2,
                          .locked = locked},
              .gains = axis.gains,
              .rates = rates,
              .delay_ticks = delay_ticks};
  }

  // Calls `set` with a sine every `period_ticks`, and returns the response of `shown()`, sampled at the same ticks.
  template <typename Set, typename Shown>
  Complex measured(double frequency_hz, int period_ticks, Set set, Shown shown) {
    constexpr int window = 4000;  // ticks: an integer number of periods of each frequency in this test
    Complex sum = 0.0;
    for (int k = 0; k < 3 * window; ++k) {
      if (k % period_ticks == 0) {
        const Complex turned = std::polar(1.0, 2.0 * pi * frequency_hz * k * tick_seconds);
        set(turned.imag());
        if (k >= window) sum += shown() * std::conj(turned);
      }
      axis_->cascade.set_demand(axis_->demand);
      axis_->cascade.tick(axis_->feedback, axis_->actuation);
      axis_->plant.step(axis_->actuation, axis_->feedback);
    }
    return sum * Complex(0.0, 1.0) * (static_cast<double>(period_ticks) / window);
  }

  static void expect_equal(Complex measured, Complex computed) {
    const Complex ratio = measured / computed;
    const double decibels = 20.0 * std::log10(std::abs(ratio));
    const double degrees = std::arg(ratio) * 180.0 / pi;
    EXPECT_NEAR(decibels, 0.0, most_decibels);
    EXPECT_NEAR(degrees, 0.0, most_degrees);
  }

  std::optional<Axis> axis_;
  Model model_{};
};

constexpr std::array delays{0, 1, 2, 3};
constexpr std::array rates_of_products{Rates{2, 8}, Rates{4, 16}};

Complex at(double frequency_hz, int period_ticks) {
  return std::polar(1.0, 2.0 * pi * frequency_hz * period_ticks * tick_seconds);
}

TEST_F(LateLoops, CurrentFollowsAsComputed) {
  for (const int delay : delays) {
    for (const double frequency_hz : frequencies_hz) {
      SCOPED_TRACE(testing::Message() << delay << " ticks, " << frequency_hz << " Hz");
      prepare(delay, {1, 1}, true);
      axis_->gains.torque_filter_hz = 0.0F;
      axis_->configure();
      axis_->demand.loop = Loop::torque;
      const double amplitude_a = 0.2 * static_cast<double>(axis_->motor.rated_current_a);
      const Complex response = measured(
          frequency_hz, 1,
          [&](double sine) {
            axis_->demand.torque = static_cast<float>(amplitude_a * sine) * axis_->motor.torque_constant_nm_per_a /
                                   axis_->motor.rated_torque_nm;
          },
          [&] { return axis_->plant.current_a(); });
      expect_equal(response / amplitude_a, model_.current_loop(at(frequency_hz, 1))[0]);
    }
  }
}

TEST_F(LateLoops, VelocityFollowsAsComputed) {
  for (const Rates rates : rates_of_products) {
    for (const int delay : delays) {
      for (const double frequency_hz : frequencies_hz) {
        SCOPED_TRACE(testing::Message() << delay << " ticks, " << frequency_hz << " Hz");
        prepare(delay, rates, false);
        axis_->demand.loop = Loop::velocity;
        const double amplitude_rpm = 20.0;
        const Complex response = measured(
            frequency_hz, rates.velocity_loop_ticks,
            [&](double sine) {
              axis_->demand.velocity = static_cast<float>(axis_->counts_per_s(amplitude_rpm * sine));
            },
            [&] { return axis_->plant.velocity_rpm(); });
        expect_equal(response / amplitude_rpm, model_.velocity_loop(at(frequency_hz, rates.velocity_loop_ticks))[0]);
      }
    }
  }
}

TEST_F(LateLoops, PositionFollowsAsComputed) {
  for (const Rates rates : rates_of_products) {
    for (const int delay : delays) {
      for (const double frequency_hz : frequencies_hz) {
        if (frequency_hz * rates.position_loop_ticks * tick_seconds >= 0.5) continue;
        SCOPED_TRACE(testing::Message() << delay << " ticks, " << frequency_hz << " Hz");
        prepare(delay, rates, false);
        axis_->demand.loop = Loop::position;
        const double amplitude = 0.02 * axis_->motor.counts_per_revolution;
        const Counts start = axis_->plant.position_counts();
        const Complex response = measured(
            frequency_hz, rates.position_loop_ticks,
            [&](double sine) {
              const double place = amplitude * sine;
              axis_->demand.position = start + static_cast<Counts>(std::floor(place));
              axis_->demand.position_fraction = static_cast<float>(place - std::floor(place));
            },
            [&] {
              return static_cast<double>(axis_->plant.position_counts() - start) + axis_->plant.position_fraction();
            });
        expect_equal(response / amplitude, model_.position_loop(at(frequency_hz, rates.position_loop_ticks)));
      }
    }
  }
}

}  // namespace
}  // namespace loops_response_test
}  // namespace servodrome::drive::test
