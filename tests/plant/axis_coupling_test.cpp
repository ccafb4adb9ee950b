#include "plant/axis_coupling.hpp"

#include <array>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>

#include "plant/rig.hpp"

// Two axes whose loads are coupled, compared with closed forms.
namespace servodrome::plant::test {
namespace axis_coupling_test {
namespace {

Parameters bare_axis(double load_kgm2) {
  Parameters p = bare_motor();
  p.load.inertia_kgm2 = load_kgm2;
  return p;
}

// Two axes without power and without friction.
struct Pair {
  Pair(const CouplingParameters& parameters, const Parameters& one, const Parameters& other)
      : first(one), second(other), coupling(parameters, first.plant, second.plant) {
    for (const Rig* rig : {&first, &second}) {
      const Parameters& p = rig->plant.parameters();
      inertia_kgm2[rig == &first ? 0 : 1] = p.motor.rotor_inertia_kgm2 + p.load.inertia_kgm2;
    }
  }
  void step() {
    coupling.pull();
    first.step();
    second.step();
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) step();
  }
  void kick() {
    first.plant.set_external_torque_nm(-1.0);
    run(4);
    first.plant.set_external_torque_nm(0.0);
  }
  double energy_j() const {
    double energy = coupling.stored_j();
    for (const Rig* rig : {&first, &second}) {
      energy += rig->plant.energy().kinetic_j + rig->plant.energy().elastic_j;
    }
    return energy;
  }
  // The torques on the shafts are -T and ratio * T, so this combination of the angular momenta stays.
  double momentum() const {
    return coupling.parameters().ratio * inertia_kgm2[0] * first.speed_rad_s() + inertia_kgm2[1] * second.speed_rad_s();
  }
  double resonance_rad_s() const {
    const CouplingParameters& p = coupling.parameters();
    return std::sqrt(p.stiffness_nm_per_rad * (1.0 / inertia_kgm2[0] + p.ratio * p.ratio / inertia_kgm2[1]));
  }

  Rig first;
  Rig second;
  AxisCoupling coupling;
  std::array<double, 2> inertia_kgm2{};
};

constexpr double light = 0.28e-4;
constexpr double heavy = 1.0e-4;

// Stiff enough that the vibration turns by `angle` rad in a tick.
CouplingParameters undamped(double angle, double ratio) {
  const double per_inertia = 1.0 / (0.28e-4 + light) + ratio * ratio / (0.28e-4 + heavy);
  return {.ratio = ratio, .stiffness_nm_per_rad = angle * angle / (h * h * per_inertia), .damping_nms = 0.0};
}

TEST(AxisCoupling, TwoFreeInertiasVibrateAtTheirResonance) {
  for (const double ratio : {1.0, -1.0, 3.0}) {
    for (const double angle : {0.02, 0.1, 0.5}) {
      Pair pair(undamped(angle, ratio), bare_axis(light), bare_axis(heavy));
      pair.kick();
      double first = 0.0;
      double last = 0.0;
      int crossings = 0;
      double old = pair.coupling.twist_rad();
      for (int tick = 0; tick < 16000; ++tick) {
        pair.step();
        const double twist = pair.coupling.twist_rad();
        if (old < 0.0 && twist >= 0.0) {
          last = (tick + old / (old - twist)) * h;
          if (crossings++ == 0) first = last;
        }
        old = twist;
      }
      const double measured = 2.0 * std::numbers::pi * (crossings - 1) / (last - first);
      EXPECT_NEAR(measured, pair.resonance_rad_s(), (angle * angle / 24.0 + 5.0e-4) * measured)
          << ratio << ' ' << angle;
      // The step's own frequency is known exactly.
      EXPECT_NEAR(measured, 2.0 / h * std::asin(0.5 * angle), 5.0e-4 * measured) << ratio << ' ' << angle;
    }
  }
}

TEST(AxisCoupling, KeepsMomentumAndEnergyWithoutDamping) {
  for (const double ratio : {1.0, -1.0, 3.0}) {
    for (const double angle : {0.02, 0.1, 0.9}) {
      Pair pair(undamped(angle, ratio), bare_axis(light), bare_axis(heavy));
      pair.kick();
      const double momentum = pair.momentum();
      const auto mean_energy_j = [&pair] {
        double sum = 0.0;
        for (int i = 0; i < 16000; ++i) {
          pair.step();
          sum += pair.energy_j();
        }
        return sum / 16000.0;
      };
      const double energy_j = mean_energy_j();
      pair.run(160000);
      EXPECT_NEAR(mean_energy_j(), energy_j, 2.0e-4 * energy_j) << ratio << ' ' << angle;
      EXPECT_NEAR(pair.momentum(), momentum, 1.0e-9 * std::abs(momentum)) << ratio << ' ' << angle;
    }
  }
}

TEST(AxisCoupling, DampingTakesTheAmplitudeOfItsClosedForm) {
  CouplingParameters parameters = undamped(0.05, 1.0);
  parameters.damping_nms = 0.001;
  Pair pair(parameters, bare_axis(light), bare_axis(heavy));
  pair.kick();
  const auto amplitude_rad = [&pair] {
    double most = 0.0;
    for (int i = 0; i < 200; ++i) {  // longer than a period
      pair.step();
      most = std::max(most, std::abs(pair.coupling.twist_rad()));
    }
    return most;
  };
  const double before = amplitude_rad();
  pair.run(1600);
  const double decay_per_s = 0.5 * parameters.damping_nms * (1.0 / (0.28e-4 + light) + 1.0 / (0.28e-4 + heavy));
  const double expected = before * std::exp(-decay_per_s * 1800.0 * h);
  EXPECT_NEAR(amplitude_rad(), expected, 0.02 * expected);
}

// A torque on one side deflects the coupling by torque / stiffness while the brake of the other side holds. A greater
// one drags that side along.
TEST(AxisCoupling, OneSideTwistsAgainstTheBrakeOfTheOther) {
  for (const double ratio : {1.0, -1.0, 2.0}) {
    Parameters braked = bare_axis(heavy);
    braked.motor.brake_torque_nm = 4.0;
    const CouplingParameters parameters{.ratio = ratio, .stiffness_nm_per_rad = 20.0, .damping_nms = 0.02};
    Pair pair(parameters, bare_axis(light), braked);
    pair.second.actuation.brake_released = false;
    pair.first.plant.set_external_torque_nm(-0.8);
    pair.run(16000);
    EXPECT_NEAR(pair.coupling.twist_rad(), 0.8 / 20.0, 1.0e-9);
    EXPECT_EQ(pair.second.plant.position_counts(), 0);
    EXPECT_EQ(pair.second.speed_rad_s(), 0.0);
    const double breaks_away_nm = 4.0 / std::abs(ratio);
    pair.first.plant.set_external_torque_nm(-1.1 * breaks_away_nm);
    pair.run(4000);
    EXPECT_GT(ratio * pair.second.speed_rad_s(), 1.0);
  }
}

TEST(AxisCoupling, WithinItsPlayNoTorqueActs) {
  const CouplingParameters parameters{.stiffness_nm_per_rad = 50.0, .damping_nms = 2.0e-5, .backlash_rad = 0.4};
  Pair pair(parameters, bare_axis(light), bare_axis(light));
  pair.kick();
  const double speed = pair.first.speed_rad_s();
  const int ticks = static_cast<int>(0.15 / speed / h);
  pair.run(ticks);
  EXPECT_EQ(pair.first.speed_rad_s(), speed);
  EXPECT_EQ(pair.second.speed_rad_s(), 0.0);
  // Equal masses exchange their speeds when a flank with little damping rebounds.
  pair.run(ticks + 200);
  EXPECT_NEAR(pair.first.speed_rad_s(), 0.0, 0.01 * speed);
  EXPECT_NEAR(pair.second.speed_rad_s(), speed, 0.01 * speed);
}

TEST(AxisCoupling, TheOrderOfTheTwoAxesHasNoEffect) {
  const CouplingParameters parameters{.stiffness_nm_per_rad = 50.0, .backlash_rad = 0.01};
  Pair one(parameters, bare_axis(light), bare_axis(heavy));
  Pair other(parameters, bare_axis(light), bare_axis(heavy));
  for (Pair* pair : {&one, &other}) pair->first.plant.set_external_torque_nm(-0.2);
  for (int i = 0; i < 16000; ++i) {
    one.step();
    other.coupling.pull();
    other.second.step();
    other.first.step();
    ASSERT_EQ(one.first.plant.velocity_rpm(), other.first.plant.velocity_rpm()) << i;
    ASSERT_EQ(one.second.plant.velocity_rpm(), other.second.plant.velocity_rpm()) << i;
  }
}

TEST(AxisCoupling, PlacingAnAxisAndRelaxingLeavesNoTwist) {
  Pair pair({.stiffness_nm_per_rad = 50.0}, bare_axis(light), bare_axis(heavy));
  pair.first.plant.set_position_counts(1'000'000'007);
  pair.coupling.relax();
  EXPECT_EQ(pair.coupling.twist_rad(), 0.0);
  pair.run(1000);
  EXPECT_EQ(pair.first.plant.position_counts(), 1'000'000'007);
  EXPECT_EQ(pair.second.plant.position_counts(), 0);
}

// Whatever the axes are: at the greatest stiffness and damping that validate() accepts, and the
// least damping, the machine does not gain energy.
TEST(AxisCoupling, IsStableAtItsLimits) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> draw(0.0, 1.0);
  for (int i = 0; i < 100; ++i) {
    std::array<Parameters, 2> axes;
    for (Parameters& p : axes) {
      p = bare_axis(std::pow(10.0, -6.0 + 4.0 * draw(random)));
      p.load.elastic = draw(random) < 0.5;
      p.load.stiffness_nm_per_rad = std::pow(10.0, 4.0 * draw(random));
      p.load.damping_nms = draw(random) < 0.5 ? 0.0 : 0.01;
      p.load.backlash_rad = draw(random) < 0.3 ? 0.01 : 0.0;
    }
    CouplingParameters parameters{.ratio = draw(random) < 0.5 ? 1.0 : -5.0 * draw(random) - 0.01,
                                  .backlash_rad = draw(random) < 0.3 ? 0.02 : 0.0};
    // The limits, as the message about a value beyond them states them.
    const auto limits = [&](double CouplingParameters::*member) {
      CouplingParameters trial = parameters;
      trial.*member = 1.0e9;
      const std::string message = validate(trial, axes[0], axes[1]).at(0);
      const std::size_t within = message.find("within ") + 7;
      return std::pair(std::stod(message.substr(within)), std::stod(message.substr(message.find(".. ") + 3)));
    };
    parameters.stiffness_nm_per_rad = limits(&CouplingParameters::stiffness_nm_per_rad).second;
    const auto [least, most] = limits(&CouplingParameters::damping_nms);
    parameters.damping_nms = draw(random) < 0.5 ? least : most;
    Pair pair(parameters, axes[0], axes[1]);
    pair.kick();
    // The energy at the ends of the ticks is not constant in a leapfrog step: it varies by 4/3 with an angle of 1 rad.
    const auto greatest_j = [&pair](int ticks) {
      double most_j = 0.0;
      for (int tick = 0; tick < ticks; ++tick) {
        pair.step();
        most_j = std::max(most_j, pair.energy_j());
      }
      return most_j;
    };
    const double before_j = greatest_j(1000);
    ASSERT_LE(greatest_j(10000), 4.0 / 3.0 * before_j) << i;
  }
}

TEST(AxisCoupling, RefusesWhatTheTickCannotResolve) {
  const Parameters axis = bare_axis(light);
  EXPECT_THAT(validate(CouplingParameters{}, axis, axis), testing::IsEmpty());
  // 0.5 * 5.6e-5 kgm2 / (62.5 us)^2, and / 62.5 us.
  EXPECT_THAT(validate({.stiffness_nm_per_rad = 7167.0, .damping_nms = 0.447}, axis, axis), testing::IsEmpty());
  EXPECT_THAT(validate({.stiffness_nm_per_rad = 7200.0}, axis, axis),
              testing::ElementsAre(
                  testing::AllOf(testing::StartsWith("stiffness_nm_per_rad: 7200"), testing::HasSubstr(".. 716"))));
  EXPECT_THAT(validate({.damping_nms = 0.5}, axis, axis), testing::ElementsAre(testing::HasSubstr("0 .. 0.44")));
  EXPECT_THAT(validate({.ratio = 0.0}, axis, axis), testing::ElementsAre(testing::StartsWith("ratio: ")));
  EXPECT_THAT(validate({.backlash_rad = -1.0}, axis, axis),
              testing::ElementsAre(testing::StartsWith("backlash_rad: ")));
  Plant first(axis);
  Plant second(axis);
  EXPECT_THROW(AxisCoupling({.stiffness_nm_per_rad = 7200.0}, first, second), std::invalid_argument);
}

}  // namespace
}  // namespace axis_coupling_test
}  // namespace servodrome::plant::test
