// The fit finds the parameters of a synthetic axis, and names the parameters that a recording does not determine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fit/error.hpp"
#include "fit/report.hpp"
#include "synthetic_axis.hpp"

namespace servodrome::fit {
namespace fit_model_test {
namespace {

using test::forget;
using test::SyntheticAxis;
using testing::HasSubstr;
using enum Parameter;

double value(const Result& result, Parameter parameter) {
  EXPECT_TRUE(result.of(parameter).value) << text_of(parameter).word << ": " << result.of(parameter).why_not;
  return result.of(parameter).value.value_or(0.0);
}

void expect_found(const Result& result, const SyntheticAxis& axis, double relative = 0.003) {
  const auto near = [&](Parameter parameter, double truth) {
    EXPECT_NEAR(value(result, parameter), truth, relative * std::abs(truth)) << text_of(parameter).word;
  };
  near(resistance, axis.resistance_ohm);
  near(quadrature_inductance, axis.quadrature_h);
  near(torque_constant, axis.torque_constant());
  near(inertia, axis.inertia_kgm2);
  near(coulomb_friction, axis.coulomb_nm);
  near(viscous_friction, axis.viscous_nms);
  near(weight, axis.weight_nm);
  EXPECT_NEAR(value(result, voltage_delay), axis.delay_s, 0.03 / axis.rate_hz);
  EXPECT_NEAR(value(result, torque_delay), 0.0, 0.03 / axis.rate_hz);
}

std::string problem_of(const Signals& signals, const Motor& motor) {
  try {
    fit(signals, motor);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(FitModel, FindsAllOfAnAxisThatFollowsTheEquations) {
  const SyntheticAxis axis;
  const Result result = fit(axis.signals(), axis.motor());
  expect_found(result, axis);
  EXPECT_NEAR(result.stage_drop_v.value(), 0.0, 0.003);
  EXPECT_EQ(result.turns_backwards, false);
  EXPECT_THAT(result.of(direct_inductance).why_not, HasSubstr("without direct current"));
}

TEST(FitModel, TellsTheInductancesApartWhereADirectCurrentFlows) {
  const SyntheticAxis axis{.direct_h = 3e-3, .quadrature_h = 5e-3, .direct_a = -2.0};
  const Result result = fit(axis.signals(), axis.motor());
  expect_found(result, axis);
  EXPECT_NEAR(value(result, direct_inductance), 3e-3, 1e-5);
}

TEST(FitModel, DelaysOfManySamplesAreFound) {
  for (const double samples : {-3.0, 1.5, 8.0}) {
    SyntheticAxis axis;
    axis.delay_s = samples / axis.rate_hz;
    expect_found(fit(axis.signals(), axis.motor()), axis);
  }
}

TEST(FitModel, WhatTheStageDropsIsNoResistance) {
  const SyntheticAxis axis{.drop_v = 0.8};
  const Result result = fit(axis.signals(), axis.motor());
  expect_found(result, axis);
  EXPECT_NEAR(result.stage_drop_v.value(), 0.8, 0.01);
}

TEST(FitModel, AWarmWindingsResistanceIsToldAt25Degrees) {
  const SyntheticAxis axis{.warmth_k = 20.0};
  Signals signals = axis.signals();
  expect_found(fit(signals, axis.motor()), axis);
  forget(signals, {Role::temperature});
  EXPECT_NEAR(value(fit(signals, axis.motor()), resistance), 1.2 * (1.0 + 3.93e-3 * 20.0), 0.03) << "half of 40 K";
}

TEST(FitModel, TwoPhasesMakeTorqueOfTheirOwn) {
  const SyntheticAxis axis{.pole_pairs = 50, .phases_half = 1.0, .speed_rad_s = 60.0};
  expect_found(fit(axis.signals(), axis.motor()), axis);
}

TEST(FitModel, AnEncoderThatCountsBackwardsIsSeen) {
  const SyntheticAxis axis{.weight_nm = 0.1};
  SyntheticAxis mirrored = axis;
  mirrored.weight_nm = -0.1;
  Signals signals = mirrored.signals();
  for (const Role role : {Role::position, Role::velocity}) {
    for (double& sample : signals.values[static_cast<std::size_t>(role)]) sample = -sample;
  }
  const Result result = fit(signals, axis.motor());
  expect_found(result, axis);
  EXPECT_EQ(result.turns_backwards, true);
  EXPECT_THAT(toml_of(result, axis.motor()), HasSubstr("direction = -1"));
}

TEST(FitModel, WithoutPolePairsOneAxisOfTheFrameIsEnough) {
  const SyntheticAxis axis;
  expect_found(fit(axis.signals(), Motor{}), axis);
}

TEST(FitModel, TorqueAndVelocityShowTheMechanicsAlone) {
  const SyntheticAxis axis;
  Signals signals = axis.signals();
  forget(signals, {Role::position, Role::quadrature_voltage, Role::direct_voltage});
  Motor motor;
  motor.torque_constant_nm_per_a = axis.torque_constant();
  const Result result = fit(signals, motor);
  EXPECT_NEAR(value(result, inertia), axis.inertia_kgm2, 0.003 * axis.inertia_kgm2);
  EXPECT_FALSE(result.of(resistance).value);
  EXPECT_THAT(result.of(resistance).why_not, HasSubstr("the quadrature voltage (vq)"));
  EXPECT_THAT(result.of(resistance).remedy, HasSubstr("vd, vq, id, iq"));
  EXPECT_THAT(fit(signals, Motor{}).of(inertia).remedy, HasSubstr("--torque-constant"));
  forget(signals, {Role::quadrature_current});
  EXPECT_THAT(fit(signals, motor).of(inertia).why_not, HasSubstr("the torque, the quadrature current (iq)"));
}

TEST(FitModel, ATorqueWithTheWrongSignMakesNoInertia) {
  const SyntheticAxis axis;
  Motor motor;
  motor.torque_constant_nm_per_a = -axis.torque_constant();
  for (const bool constant : {false, true}) {
    Signals signals = axis.signals();
    forget(signals, {Role::quadrature_voltage, Role::direct_voltage});
    if (constant)
      signals.values[static_cast<std::size_t>(Role::quadrature_current)].assign(signals.seconds.size(), 0.0);
    const Result result = fit(signals, motor);
    EXPECT_FALSE(result.of(inertia).value);
    EXPECT_FALSE(result.of(coulomb_friction).value);
    EXPECT_THAT(result.of(inertia).why_not, HasSubstr("does not rise"));
  }
}

TEST(FitModel, OneDirectionDoesNotTellFrictionFromWeight) {
  const SyntheticAxis axis{.offset_rad_s = 300.0};
  const Result result = fit(axis.signals(), axis.motor());
  EXPECT_NEAR(value(result, inertia), axis.inertia_kgm2, 0.003 * axis.inertia_kgm2);
  EXPECT_NEAR(value(result, viscous_friction), axis.viscous_nms, 0.003 * axis.viscous_nms);
  EXPECT_FALSE(result.of(coulomb_friction).value);
  EXPECT_FALSE(result.of(weight).value);
  EXPECT_THAT(result.of(weight).remedy, HasSubstr("both ways"));
  EXPECT_THAT(toml_of(result, axis.motor()), testing::Not(HasSubstr("gravity_torque_nm")));
}

TEST(FitModel, ConstantSpeedShowsNoInertia) {
  const SyntheticAxis axis{.speed_rad_s = 0.0, .offset_rad_s = 300.0};
  const Result result = fit(axis.signals(), axis.motor());
  for (const Parameter parameter : {resistance, inertia, coulomb_friction, viscous_friction, weight}) {
    EXPECT_FALSE(result.of(parameter).value) << text_of(parameter).word;
    EXPECT_FALSE(result.of(parameter).why_not.empty()) << text_of(parameter).word;
    EXPECT_FALSE(result.of(parameter).remedy.empty()) << text_of(parameter).word;
  }
}

TEST(FitModel, SaysWhatIsWrongWithTheRecording) {
  const SyntheticAxis axis;
  Signals few = SyntheticAxis{.duration_s = 0.04}.signals();
  EXPECT_THAT(problem_of(few, axis.motor()), HasSubstr("synthetic: 160 samples are too few; record at least 200"));
  const SyntheticAxis standing{.speed_rad_s = 0.01};
  EXPECT_THAT(problem_of(standing.signals(), axis.motor()), HasSubstr("the shaft turns by no more than"));
  Signals blind = axis.signals();
  forget(blind, {Role::position, Role::velocity});
  EXPECT_THAT(problem_of(blind, axis.motor()),
              HasSubstr("the position, the velocity missing; record position or velo"));
}

TEST(FitModel, MissingSamplesAreLeftOut) {
  const SyntheticAxis axis;
  Signals signals = axis.signals();
  for (auto& values : signals.values) {
    for (std::size_t i = 2000; i < 2200 && !values.empty(); ++i) values[i] = std::nan("");
  }
  expect_found(fit(signals, axis.motor()), axis);
  // One sample in seven is missing in the table, as on a busy computer.
  Signals gaps = axis.signals();
  for (auto* values : {&gaps.seconds, &gaps.values[0], &gaps.values[1], &gaps.values[3], &gaps.values[4],
                       &gaps.values[5], &gaps.values[6]}) {
    std::vector<double> kept;
    for (std::size_t i = 0; i < values->size(); ++i) {
      if (i % 7 != 3) kept.push_back((*values)[i]);
    }
    *values = kept;
  }
  expect_found(fit(gaps, axis.motor()), axis, 0.006);
}

}  // namespace
}  // namespace fit_model_test
}  // namespace servodrome::fit
