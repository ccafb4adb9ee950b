// The results of `tune` do not depend on the phase between the master's cycle and the drive's cycle: with complete
// drives, in virtual time, compared with the plant and with the drive's equations.
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "draws.hpp"
#include "tuning_rig.hpp"

namespace servodrome::master::tuning {
namespace tuning_phase_test {
namespace {

using namespace test;

// The drive's velocity and position loops run every 0.125 and 0.5 ms (an iSMK's every 0.25 and 1 ms), its current loop
// every 62.5 us.
constexpr Time cycle = 1ms;

const std::string ideal_elastic = std::string("ideal = true\n") + elastic;

double inertia_of(TuningRig& rig) {
  const plant::Parameters& plant = rig.drive().settings().plant;
  const double kgm2 = plant.motor.rotor_inertia_kgm2 + plant.load.inertia_kgm2;
  // In A s2/rad for a drive that shows its current only.
  if (rig.units.torque_name == std::string_view("Nm")) return kgm2;
  return kgm2 / (plant.motor.torque_constant_nm_per_a / std::numbers::sqrt2);
}

// The open velocity loop of an ideal rigid axis, by the equations of drive/loops/cascade.hpp: the PI with the low pass
// on its torque, held for a velocity period; the current loop, a first order in ticks; the shaft; the difference of the
// position and its low pass.
Margins margins_by_equations(TuningRig& rig) {
  const drive::Configuration& drive = rig.servo().configuration();
  const plant::Parameters& plant = rig.drive().settings().plant;
  const double inertia = plant.motor.rotor_inertia_kgm2 + plant.load.inertia_kgm2;
  constexpr double tick_s = drive::tick_seconds;
  const double period_s = rig.servo().axis().policy.loops.velocity_ticks * tick_s;
  const auto number = [](float value) { return static_cast<double>(value); };
  std::vector<double> frequencies;
  std::vector<Complex> open_loop;
  for (double hz = 5.0; hz < 1000.0; hz *= 1.01) {
    const Complex s(0.0, turn * hz);
    const Complex z = std::exp(s * period_s);
    const Complex tick = std::exp(s * tick_s);
    const auto low_pass = [&](float corner_hz, double every_s, Complex step) {
      const double kept = corner_hz > 0.0F ? std::exp(-turn * number(corner_hz) * every_s) : 0.0;
      return (1.0 - kept) / (1.0 - kept / step);
    };
    const Complex current_a =
        (number(drive.gains.velocity_kp) + number(drive.gains.velocity_ki) * period_s / (z - 1.0)) *
        low_pass(drive.gains.torque_filter_hz, period_s, z);
    const Complex hold = (1.0 - 1.0 / z) / (1.0 - 1.0 / tick) * (tick_s / period_s);
    const Complex current_loop = low_pass(drive.gains.current_bandwidth_hz, tick_s, tick) / tick;
    const Complex angle = number(drive.motor.torque_constant_nm_per_a) / (inertia * s * s);
    const Complex velocity = low_pass(drive.gains.velocity_filter_hz, period_s, z) * (1.0 - 1.0 / z) / period_s;
    frequencies.push_back(hz);
    open_loop.push_back(current_a * hold * current_loop * angle * velocity);
  }
  return margins_of(frequencies, open_loop);
}

struct Range {
  double least = 1e300;
  double greatest = -1e300;

  void add(double value) {
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  double scatter() const { return greatest / least - 1.0; }  // relative
};

TEST(TunePhase, AnIdealAxisIsTheSameAtEveryPhase) {
  const int phases = servodrome::test::draws(32);
  constexpr double promised = 180.0;
  Range inertia, delay_ms, margin, kp, ki, bandwidth;
  for (int phase = 0; phase < phases; ++phase) {
    TuningRig rig({"generic402", BusKind::can, "ideal = true\n"}, phase * cycle / phases);
    const double truth = inertia_of(rig);
    const Margins drive_before = margins_by_equations(rig);
    const auto tuner = rig.tuner();
    const SessionResult result =
        tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = promised, .apply = true, .steps = false});
    const Measurement& before = result.before;
    EXPECT_NEAR(before.mechanics.inertia, truth, 0.03 * truth) << phase;
    EXPECT_FALSE(before.mechanics.resonance) << phase;
    EXPECT_NEAR(*before.margins.phase_margin_deg, *drive_before.phase_margin_deg, 2.0) << phase;
    EXPECT_NEAR(*before.margins.crossover_hz, *drive_before.crossover_hz, 0.03 * *drive_before.crossover_hz) << phase;
    ASSERT_TRUE(result.after) << phase;
    EXPECT_NEAR(*result.after->bandwidth_hz, promised, 0.05 * promised) << phase;
    EXPECT_NEAR(*result.after->margins.phase_margin_deg, *margins_by_equations(rig).phase_margin_deg, 2.0) << phase;
    inertia.add(before.mechanics.inertia);
    delay_ms.add(1e3 * before.controller.delay.total_s());
    margin.add(*before.margins.phase_margin_deg);
    kp.add(result.proposal.velocity.kp);
    ki.add(result.proposal.velocity.ki);
    bandwidth.add(*result.after->bandwidth_hz);
  }
  EXPECT_LT(kp.scatter(), 0.05);
  EXPECT_LT(ki.scatter(), 0.05);
  EXPECT_LT(delay_ms.scatter(), 0.1);
  std::printf(
      "inertia %.3g .. %.3g, delay %.3f .. %.3f ms, phase margin %.1f .. %.1f deg, proposed kp %.4f .. %.4f and "
      "ki %.3f .. %.3f, then measured %.1f .. %.1f Hz\n",
      inertia.least, inertia.greatest, delay_ms.least, delay_ms.greatest, margin.least, margin.greatest, kp.least,
      kp.greatest, ki.least, ki.greatest, bandwidth.least, bandwidth.greatest);
}

struct Case {
  const char* name;
  RigCase rig;
  int phases;
  double bandwidth_hz;
  double inertia_tolerance;
  double gain_scatter;
};
class TunePhases : public testing::TestWithParam<Case> {};
// An iSMK samples commands once per millisecond, like the master. If SYNC and this cycle nearly coincide, the jitter of
// the bus sometimes moves a sample to the next cycle, which disturbs the timing from which inertia and delay are
// calculated; and at 23 Hz of bandwidth the noise of its sensors is stronger than the response above 200 Hz. EtherCAT
// with SYNC0 fixes the phase.
const Case cases[] = {
    {"reference", {"generic402", BusKind::can}, 4, 100.0, 0.03, 0.05},
    {"reference_elastic_ideal", {"generic402", BusKind::can, ideal_elastic.c_str()}, 4, 50.0, 0.03, 0.05},
    {"reference_elastic", {"generic402", BusKind::can, elastic}, 4, 50.0, 0.03, 0.05},
    {"reference_ethercat", {"generic402-ec", BusKind::ethercat, "", 1ms}, 1, 100.0, 0.03, 0.05},
    {"ismk_ideal", {"ismk", BusKind::can, "ideal = true\n"}, 4, 40.0, 0.03, 0.05},
    {"ismk", {"ismk", BusKind::can}, 8, 40.0, 0.12, 0.2},
    {"ismk_elastic", {"ismk", BusKind::can, elastic}, 8, 35.0, 0.12, 0.2},
    {"ismk_ethercat", {"ismk-ea", BusKind::ethercat, "", 1ms}, 1, 40.0, 0.03, 0.05},
};
INSTANTIATE_TEST_SUITE_P(Drives, TunePhases, testing::ValuesIn(cases),
                         [](const auto& one) { return std::string(one.param.name); });

TEST_P(TunePhases, FindTheSame) {
  const Case& its = GetParam();
  const int phases = servodrome::test::draws(its.phases);
  Range inertia, kp;
  double truth = 0.0;
  for (int phase = 0; phase < phases; ++phase) {
    TuningRig rig(its.rig, phase * cycle / phases);
    truth = inertia_of(rig);
    const auto tuner = rig.tuner();
    const SessionResult result =
        tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = its.bandwidth_hz});
    const Mechanics& mechanics = result.before.mechanics;
    EXPECT_NEAR(mechanics.inertia, truth, its.inertia_tolerance * truth) << phase;
    const plant::Parameters& plant = rig.drive().settings().plant;
    ASSERT_EQ(mechanics.resonance.has_value(), plant.load.elastic) << phase;
    if (mechanics.resonance) {
      const double antiresonance = std::sqrt(plant.load.stiffness_nm_per_rad / plant.load.inertia_kgm2) / turn;
      const double resonance =
          antiresonance * std::sqrt(1.0 + plant.load.inertia_kgm2 / plant.motor.rotor_inertia_kgm2);
      EXPECT_NEAR(mechanics.resonance->antiresonance_hz, antiresonance, 0.03 * antiresonance) << phase;
      EXPECT_NEAR(mechanics.resonance->resonance_hz, resonance, 0.03 * resonance) << phase;
    }
    inertia.add(mechanics.inertia);
    kp.add(result.proposal.velocity.kp);
  }
  EXPECT_LT(kp.scatter(), its.gain_scatter);
  std::printf("%s: inertia %.3g (%.3g .. %.3g), proposed kp %.4f .. %.4f\n", its.name, truth, inertia.least,
              inertia.greatest, kp.least, kp.greatest);
}

}  // namespace
}  // namespace tuning_phase_test
}  // namespace servodrome::master::tuning
