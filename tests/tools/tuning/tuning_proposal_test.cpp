// The mathematics of tuning, compared with closed-form solutions.
#include <array>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>

#include "catalogue/product.hpp"
#include "tools/tuning/proposal.hpp"

namespace servodrome::master::tuning {
namespace tuning_proposal_test {
namespace {

std::vector<double> frequencies(double from, double to) {
  std::vector<double> list;
  for (double hz = from; hz < to; hz *= 1.02) list.push_back(hz);
  return list;
}
std::vector<Complex> values(const std::vector<double>& hz, const std::function<Complex(Complex)>& of) {
  std::vector<Complex> list;
  for (const double f : hz) list.push_back(of(Complex(0.0, turn * f)));
  return list;
}

TEST(FrequencyResponse, OfAFirstOrderFilter) {
  const Multisine excitation(1e-3, 1000, 2.0, 400.0, 40);
  double greatest = 0.0;
  for (unsigned n = 0; n < 1000; ++n) greatest = std::max(greatest, std::abs(excitation.value(n)));
  EXPECT_NEAR(greatest, 1.0, 0.2);
  std::vector<double> in, out;
  double y = 0.0;
  for (unsigned n = 0; n < 5000; ++n) {
    y += 0.2 * (excitation.value(n) - y);
    if (n < 2000) continue;
    in.push_back(excitation.value(n));
    out.push_back(y);
  }
  for (const ResponsePoint& point : frequency_response(in, out, excitation)) {
    const Complex exact = 0.2 / (1.0 - 0.8 * std::polar(1.0, -turn * point.frequency_hz * 1e-3));
    EXPECT_LT(std::abs(point.response / exact - 1.0), 1e-9) << point.frequency_hz;
    EXPECT_NEAR(point.coherence, 1.0, 1e-9);
  }
}

TEST(FrequencyResponse, NoiseLowersTheCoherence) {
  const Multisine excitation(1e-3, 1000, 2.0, 400.0, 40);
  std::vector<double> in, out;
  std::uint32_t random = 1;
  for (unsigned n = 0; n < 8000; ++n) {
    random = random * 1664525U + 1013904223U;
    in.push_back(excitation.value(n));
    out.push_back(excitation.value(n) + 20.0 * (random / 4294967296.0 - 0.5));
  }
  double sum = 0.0;
  const auto points = frequency_response(in, out, excitation);
  for (const ResponsePoint& point : points) sum += point.coherence;
  EXPECT_LT(sum / static_cast<double>(points.size()), 0.95);
  EXPECT_GT(sum, 0.0);
}

TEST(FrequencyResponse, DifferencesAreVelocity) {
  // x = sin(w t): the derivative computed from the differences is exact at any frequency.
  const double sample_s = 1e-3;
  for (const double hz : {3.0, 50.0, 390.0}) {
    const Complex x = 1.0;
    const Complex difference = x * (1.0 - std::polar(1.0, -turn * hz * sample_s));
    EXPECT_LT(std::abs(difference * derivative_of_differences(hz, sample_s) - Complex(0.0, turn * hz)), 1e-9);
  }
}

TEST(Margins, OfAnIntegratorWithDelay) {
  // L = wc / s e^-sT: the phase margin is 90 degrees minus wc T; the phase is -180 degrees at w T = pi / 2.
  const double wc = turn * 40.0;
  const double delay_s = 2e-3;
  const auto hz = frequencies(1.0, 400.0);
  const Margins margins = margins_of(hz, values(hz, [&](Complex s) { return wc / s * std::exp(-s * delay_s); }));
  EXPECT_NEAR(margins.crossover_hz.value_or(0), 40.0, 0.01);
  EXPECT_NEAR(margins.phase_margin_deg.value_or(0), 90.0 - 40.0 * 360.0 * delay_s, 0.1);
  EXPECT_NEAR(margins.gain_margin_hz.value_or(0), 125.0, 0.5);
  EXPECT_NEAR(margins.gain_margin_db.value_or(0), 20.0 * std::log10(125.0 / 40.0), 0.05);
}

TEST(Margins, BandwidthOfFirstAndSecondOrder) {
  const auto hz = frequencies(1.0, 400.0);
  const double w = turn * 30.0;
  EXPECT_NEAR(bandwidth_of(hz, values(hz, [&](Complex s) { return w / (s + w); })).value_or(0), 30.0, 0.05);
  EXPECT_NEAR(bandwidth_of(hz, values(hz, [&](Complex s) { return w * w / (s * s + std::sqrt(2.0) * w * s + w * w); }))
                  .value_or(0),
              30.0, 0.05);
  EXPECT_FALSE(bandwidth_of(hz, values(hz, [](Complex) { return Complex(1.0); })));
}

TEST(Bode, ThePhaseGoesOn) {
  const auto hz = frequencies(1.0, 400.0);
  const auto points = bode(hz, values(hz, [](Complex s) { return std::exp(-s * 0.01); }));
  EXPECT_NEAR(points.back().phase_deg, -360.0 * 0.01 * points.back().frequency_hz, 0.1);
  EXPECT_NEAR(points.back().gain_db, 0.0, 1e-9);
}

std::vector<ResponsePoint> measured(const Mechanics& mechanics) {
  std::vector<ResponsePoint> points;
  for (double hz = 2.0; hz < 400.0; hz *= 1.07) points.push_back({hz, mechanics.response(hz), 0.999});
  return points;
}

TEST(Identify, RigidAndElasticMechanics) {
  const Mechanics rigid{.inertia = 3e-4};
  const auto found = identify_mechanics(measured(rigid));
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->resonance);
  EXPECT_NEAR(found->inertia, 3e-4, 1e-8);

  const Mechanics elastic{.inertia = 3e-4, .resonance = Resonance{60.0, 0.02, 120.0, 0.04}};
  const auto two = identify_mechanics(measured(elastic));
  ASSERT_TRUE(two && two->resonance);
  EXPECT_NEAR(two->inertia, 3e-4, 1e-7);
  EXPECT_NEAR(two->rotor_inertia(), 0.75e-4, 1e-7);
  EXPECT_NEAR(two->resonance->antiresonance_hz, 60.0, 0.05);
  EXPECT_NEAR(two->resonance->resonance_hz, 120.0, 0.05);
  EXPECT_NEAR(two->resonance->resonance_damping, 0.04, 0.001);
}

// A loop in continuous time with sampled command, position and torque, simulated in steps of 5 us: the master's samples
// are at several phases of its cycle.
TEST(Identify, AContinuousLoopFromItsSamples) {
  constexpr double step_s = 5e-6;
  constexpr unsigned steps = 200;  // of a sample
  const VelocityController law{.kp = 0.034, .ki = 5.4, .delay = {.dead_s = 0.2e-3, .lag_s = 0.2e-3}};
  const double inertia = 5.6e-5;
  constexpr unsigned lag_steps = 40;
  constexpr unsigned dead_steps = 40;
  const Multisine excitation(1e-3, 500, 4.0, 400.0, 60);
  for (const unsigned torque_phase : {5U, 60U, 120U, 180U}) {
    std::vector<double> command, differences, torques;
    std::array<double, dead_steps> late{};
    double position = 0.0, velocity = 0.0, integral = 0.0, torque = 0.0, last = 0.0, held = 0.0;
    for (unsigned n = 0; n < 2000; ++n) {
      const double next = excitation.value(n);
      for (unsigned i = 0; i < steps; ++i) {
        if (i == torque_phase) torques.push_back(torque);
        if (i == 100) {
          command.push_back(next);
          differences.push_back(position - last);
          last = position;
        }
        if (i == 0) held = next;
        double& delayed = late[(n * steps + i) % dead_steps];
        const double error = held - delayed;
        delayed = velocity;
        integral += law.ki * error * step_s;
        torque += (law.kp * error + integral - torque) / lag_steps;
        velocity += torque / inertia * step_s;
        position += velocity * step_s;
      }
    }
    const auto settled = [&](std::vector<double>& signal) { signal.erase(signal.begin(), signal.begin() + 1000); };
    settled(command), settled(differences), settled(torques);
    auto by_command = frequency_response(command, differences, excitation);
    for (ResponsePoint& point : by_command) {
      point.response *= derivative_of_differences(point.frequency_hz, 1e-3);
    }
    unsigned calls = 0;
    const auto found =
        identify_loop(by_command, frequency_response(command, torques, excitation), 1e-3, {}, [&] { ++calls; });
    EXPECT_GT(calls, 10U) << torque_phase;
    ASSERT_TRUE(found) << torque_phase;
    EXPECT_FALSE(found->mechanics.resonance);
    EXPECT_NEAR(found->mechanics.inertia, inertia, 0.005 * inertia) << torque_phase;
    EXPECT_NEAR(found->controller.kp, law.kp, 0.005 * law.kp) << torque_phase;
    EXPECT_NEAR(found->controller.ki, law.ki, 0.01 * law.ki) << torque_phase;
    EXPECT_NEAR(found->controller.delay.total_s(), law.delay.total_s(), 1e-5) << torque_phase;
    EXPECT_LT(found->misfit, 0.005) << torque_phase;
    for (std::size_t i = 0; i < by_command.size(); ++i) {
      const double hz = by_command[i].frequency_hz;
      const Complex shaft = 1.0 / Complex(0.0, turn * hz * inertia);
      EXPECT_LT(std::abs(found->velocity_by_torque[i].response / shaft - 1.0), 0.05) << hz;
    }
  }
}

TEST(Propose, WhatIsPromisedIsPredicted) {
  for (const double hz : {10.0, 40.0, 100.0}) {
    const auto proposal = propose({.inertia = 2e-4}, {.bandwidth_hz = hz, .delay = {.dead_s = 0.5e-3}});
    ASSERT_TRUE(proposal) << hz;
    EXPECT_NEAR(proposal->bandwidth_hz, hz, 0.02 * hz);
    EXPECT_GE(proposal->margins.phase_margin_deg.value_or(0), 45.0);
    EXPECT_LE(proposal->margins.greatest_sensitivity, 2.0);
    EXPECT_NEAR(proposal->position_kp, 0.2 * turn * proposal->margins.crossover_hz.value_or(0), 1e-6);
  }
}

// No proposal loses its margins by a fifth of the inertia more or less.
TEST(Propose, HoldsWithAnotherInertia) {
  std::vector<Mechanics> loads{{.inertia = 2e-4}};
  for (const double antiresonance_hz : {150.0, 250.0}) {
    for (const double ratio : {1.2, 1.41}) {
      const Resonance resonance{antiresonance_hz, 0.02, antiresonance_hz * ratio, 0.03};
      loads.push_back({.inertia = 3e-4, .resonance = resonance});
    }
  }
  int proposals = 0;
  for (const Mechanics& load : loads) {
    for (const double hz : {20.0, 60.0, 100.0}) {
      const auto proposal =
          propose(load, {.bandwidth_hz = hz, .delay = {.dead_s = 2e-3}, .notch = catalogue::NotchAbility{}});
      if (!proposal) continue;
      ++proposals;
      for (const double factor : {0.8, 0.9, 1.1, 1.2}) {
        Mechanics other = load;
        other.inertia *= factor;
        const Proposal then = predict(proposal->velocity, other);
        EXPECT_GE(then.margins.phase_margin_deg.value_or(0.0), 40.0);
        EXPECT_LE(then.margins.greatest_sensitivity, 2.5);
      }
    }
  }
  EXPECT_GE(proposals, 8);
}

TEST(Propose, ADelaySetsTheLimit) {
  const Request request{.bandwidth_hz = 400.0, .delay = {.dead_s = 2e-3}};
  EXPECT_FALSE(propose({.inertia = 2e-4}, request));
  const double possible = greatest_bandwidth({.inertia = 2e-4}, request);
  EXPECT_GT(possible, 20.0);
  EXPECT_LT(possible, 200.0);
}

TEST(Propose, ANotchWhereTheResonanceNeedsOne) {
  const Mechanics elastic{.inertia = 3e-4, .resonance = Resonance{150.0, 0.03, 300.0, 0.06}};
  Request request{.bandwidth_hz = 40.0, .delay = {.dead_s = 1e-3}};
  const auto without = propose(elastic, request);
  request.notch = catalogue::NotchAbility{};
  const auto with = propose(elastic, request);
  ASSERT_TRUE(with);
  ASSERT_TRUE(with->velocity.notch);
  EXPECT_NEAR(with->velocity.notch->frequency_hz, 300.0, 1e-9);
  EXPECT_FALSE(without);
}

}  // namespace
}  // namespace tuning_proposal_test
}  // namespace servodrome::master::tuning
