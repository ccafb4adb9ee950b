// `tune` with complete drives, in virtual time: the promised result is checked with the signals inside the drive and at
// the shaft.
#include <cmath>
#include <gmock/gmock.h>

#include "catalogue/product.hpp"
#include "tools/tuning/own_tuning.hpp"
#include "tuning_rig.hpp"

namespace servodrome::master::tuning {
namespace tuning_test {
namespace {

using namespace test;
using testing::ContainsRegex;
using testing::HasSubstr;

// Response of the loop measured by signals inside the drive, sampled at the same instants, with a sine on the velocity
// command: independent of the tuner and of the delays of a bus.
struct Inside {
  Complex open_loop;   // feedback divided by error
  double closed_loop;  // velocity of the shaft itself divided by the command, magnitude
};
Inside at_frequency(TuningRig& rig, double hz) {
  // Whole periods in a whole number of samples.
  const double sample_s = 1e-3;
  const auto samples = static_cast<unsigned>(std::lround(std::round(1.0 * hz) / hz / sample_s));
  const double exact_hz = std::round(1.0 * hz) / (samples * sample_s);
  CyclicAxis axis(rig.cyclic->image(0));
  axis.set_mode(static_cast<OperationMode>(rig.dialect.velocity_mode));
  unsigned n = 0;
  Complex command{}, reference{}, feedback{}, shaft{};
  bool sampling = false;
  double amplitude = 2.0;
  double bias = 4.0;
  double last = 0.0;
  bool on = false;
  rig.cyclic->on_cycle([&] {
    if (!axis.enable() || !on) {
      last = rig.shaft_counts();
      axis.set_target_velocity(0);
      return;
    }
    const double position = rig.shaft_counts();
    const double moved = position - last;
    last = position;
    if (sampling) {
      const Complex turning = std::polar(1.0, -turn * exact_hz * n * sample_s);
      const drive::CascadeState& loops = rig.servo().loops();
      reference += static_cast<double>(loops.velocity_reference_counts_per_s) * turning;
      feedback += static_cast<double>(loops.velocity_counts_per_s) * turning;
      shaft += moved * turning;
    }
    const double sent = bias + amplitude * std::sin(turn * exact_hz * n * sample_s);
    axis.set_target_velocity(static_cast<std::int32_t>(std::lround(sent * rig.units.velocity_per_rad_s)));
    if (sampling) {
      command += sent * rig.units.counts_per_rad * std::polar(1.0, -turn * exact_hz * n * sample_s);
    }
    ++n;
  });
  rig.cyclic->wait(300ms);
  on = true;
  rig.cyclic->wait(1s);
  n = 0;
  sampling = true;
  rig.cyclic->wait(1ms * (2 * samples));
  sampling = false;
  on = false;
  rig.cyclic->wait(200ms);
  rig.cyclic->on_cycle([&] { axis.disable(); });
  rig.cyclic->wait(100ms);
  rig.cyclic->on_cycle({});
  const Complex velocity = shaft * derivative_of_differences(exact_hz, sample_s);
  return {feedback / (reference - feedback), std::abs(velocity / command) / hold_gain(exact_hz, sample_s)};
}

struct Case {
  RigCase rig;
  double bandwidth_hz;
};
class Tunes : public testing::TestWithParam<Case> {};
const Case cases[] = {
    {{"generic402", BusKind::can, rigid}, 60.0},
    {{"generic402", BusKind::can, elastic}, 50.0},
    {{"generic402-ec", BusKind::ethercat, rigid, 1ms}, 80.0},
    {{"generic402-ec", BusKind::ethercat, elastic, 1ms}, 50.0},
    {{"ismk", BusKind::can, rigid}, 40.0},
    {{"ismk", BusKind::can, elastic}, 35.0},
    {{"ismk-ea", BusKind::ethercat, rigid, 1ms}, 40.0},
    {{"ismk-ea", BusKind::ethercat, elastic, 1ms}, 35.0},
};
INSTANTIATE_TEST_SUITE_P(Drives, Tunes, testing::ValuesIn(cases), [](const auto& one) {
  return one.param.rig.name() + (one.param.rig.axis_text == rigid ? "_rigid" : "_elastic");
});

TEST_P(Tunes, ToTheBandwidthItPromises) {
  TuningRig rig(GetParam().rig);
  const double promised = GetParam().bandwidth_hz;
  const auto tuner = rig.tuner();
  const SessionResult result = tune(*tuner, rig.objects(), rig.dialect, rig.units, {promised, true});
  ASSERT_TRUE(result.after);
  const Measurement& after = *result.after;
  // The identified mechanics must be those of the line file.
  const plant::Load& load = rig.drive().settings().plant.load;
  const plant::Motor& motor = rig.drive().settings().plant.motor;
  const double inertia = motor.rotor_inertia_kgm2 + load.inertia_kgm2;
  const Mechanics& mechanics = result.before.mechanics;
  EXPECT_EQ(mechanics.resonance.has_value(), load.elastic);
  if (rig.units.torque_name == std::string_view("Nm")) {
    EXPECT_NEAR(mechanics.inertia, inertia, 0.06 * inertia);
  }
  if (mechanics.resonance) {
    const double antiresonance = std::sqrt(load.stiffness_nm_per_rad / load.inertia_kgm2) / turn;
    const double resonance = antiresonance * std::sqrt(inertia / motor.rotor_inertia_kgm2);
    EXPECT_NEAR(mechanics.resonance->antiresonance_hz, antiresonance, 0.05 * antiresonance);
    EXPECT_NEAR(mechanics.resonance->resonance_hz, resonance, 0.1 * resonance);
  }
  // With the loop's own signals: around the crossover, and up to the resonance.
  const double crossover = after.margins.crossover_hz.value_or(1.0);
  std::vector<double> frequencies{0.8 * crossover, crossover, 1.25 * crossover};
  for (double f = 1.25 * crossover * 1.2; f < 300.0; f *= 1.2) frequencies.push_back(f);
  std::vector<double> hz;
  std::vector<Complex> open_loop;
  for (const double f : frequencies) {
    const Inside inside = at_frequency(rig, f);
    hz.push_back(f);
    open_loop.push_back(inside.open_loop);
  }
  EXPECT_GT(at_frequency(rig, 0.85 * promised).closed_loop, std::sqrt(0.5));
  EXPECT_LT(at_frequency(rig, 1.15 * promised).closed_loop, std::sqrt(0.5));
  const Margins inside = margins_of(hz, open_loop);
  ASSERT_TRUE(inside.phase_margin_deg);
  EXPECT_GT(*inside.phase_margin_deg, 40.0);
  // The power stage is not linear near zero current, so the loop's figures depend on the amplitude by some degrees.
  EXPECT_NEAR(*inside.phase_margin_deg, after.margins.phase_margin_deg.value_or(0), 5.0);
  EXPECT_NEAR(after.bandwidth_hz.value_or(0), promised, 0.15 * promised);
  std::printf(
      "promised %.0f Hz, measured %.1f Hz and %.1f deg (before %.1f Hz); inside of the drive %.1f deg at %.1f Hz\n",
      promised, after.bandwidth_hz.value_or(0), after.margins.phase_margin_deg.value_or(0),
      result.before.bandwidth_hz.value_or(0), *inside.phase_margin_deg, inside.crossover_hz.value_or(0));
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
}

// ---- Failures on the way ----

std::vector<std::int64_t> numbers(const std::vector<GainValue>& gains) {
  std::vector<std::int64_t> list;
  for (const GainValue& gain : gains) list.push_back(gain.number);
  return list;
}

// Runs `event` at the n-th progress report. A measurement at 40 Hz has twelve reports; later ones belong to the
// measurement with new gains.
struct Outcome {
  std::string problem;
  bool gains_are_back = false;
  double seconds = 0.0;
};
Outcome tune_with(TuningRig& rig, unsigned at, const std::function<void()>& event,
                  const std::function<bool()>& cancelled = {}) {
  unsigned reports = 0;
  const auto tuner = rig.tuner({.cancelled = cancelled, .progress = [&](const char*, double) {
                                  if (++reports == at) event();
                                }});
  const auto before = numbers(read_gains(rig.objects(), rig.dialect));
  const Time start = rig.line.now();
  Outcome outcome;
  outcome.problem = master::test::problem_of([&] {
    tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = 40.0, .apply = true, .steps = false});
  });
  outcome.seconds = std::chrono::duration<double>(rig.line.now() - start).count();
  EXPECT_GE(reports, at);
  try {
    outcome.gains_are_back = numbers(read_gains(rig.objects(), rig.dialect)) == before;
  } catch (const MasterError&) {
    outcome.gains_are_back = false;
  }
  return outcome;
}

class TuneFails : public testing::TestWithParam<RigCase> {};
INSTANTIATE_TEST_SUITE_P(Drives, TuneFails,
                         testing::Values(RigCase{"generic402", BusKind::can, rigid},
                                         RigCase{"ismk", BusKind::can, rigid},
                                         RigCase{"generic402-ec", BusKind::ethercat, rigid, 1ms}),
                         [](const auto& one) { return one.param.name(); });

TEST_P(TuneFails, AFaultBeforeAnythingIsWritten) {
  TuningRig rig(GetParam());
  const Outcome outcome = tune_with(rig, 3, [&] { rig.drive().inject(drive::Cause::over_voltage, true); });
  EXPECT_THAT(outcome.problem, HasSubstr("left operation enabled"));
  EXPECT_TRUE(outcome.gains_are_back);
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
}

TEST_P(TuneFails, AFaultWithTheNewGains) {
  TuningRig rig(GetParam());
  const Outcome outcome = tune_with(rig, 16, [&] { rig.drive().inject(drive::Cause::over_voltage, true); });
  EXPECT_THAT(outcome.problem, HasSubstr("left operation enabled"));
  EXPECT_THAT(outcome.problem, HasSubstr("the old gains are restored"));
  EXPECT_TRUE(outcome.gains_are_back);
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
}

TEST_P(TuneFails, CalledOff) {
  TuningRig rig(GetParam());
  bool called_off = false;
  const Outcome outcome = tune_with(
      rig, 16, [&] { called_off = true; }, [&] { return called_off; });
  EXPECT_THAT(outcome.problem, HasSubstr("interrupted"));
  EXPECT_THAT(outcome.problem, HasSubstr("the old gains are restored"));
  EXPECT_TRUE(outcome.gains_are_back);
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
  const double standing = rig.shaft_counts();
  rig.line.run_until(rig.line.now() + 100ms);
  EXPECT_NEAR(rig.shaft_counts(), standing, 2.0);
}

TEST_P(TuneFails, PowerGoesOff) {
  TuningRig rig(GetParam());
  const Outcome outcome = tune_with(rig, 16, [&] { rig.power_off(); });
  EXPECT_THAT(outcome.problem, HasSubstr("could not be restored"));
  EXPECT_LT(outcome.seconds, 120.0);
}

TEST_P(TuneFails, TheCableIsCut) {
  TuningRig rig(GetParam());
  const Outcome outcome = tune_with(rig, 16, [&] { rig.cut(); });
  EXPECT_THAT(outcome.problem, HasSubstr("could not be restored"));
  EXPECT_LT(outcome.seconds, 120.0);
  // The drive misses its master's heartbeat and stops by itself.
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
  const double standing = rig.shaft_counts();
  rig.line.run_until(rig.line.now() + 1s);
  EXPECT_NEAR(rig.shaft_counts(), standing, 2.0);
}

TEST(TuneLimits, ABandwidthThatIsNotPossible) {
  static const std::string ideal = std::string("ideal = true\n") + rigid;
  TuningRig rig({"ismk", BusKind::can, ideal.c_str()});
  const auto tuner = rig.tuner();
  const std::string problem = master::test::problem_of(
      [&] { tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = 300.0, .apply = true}); });
  EXPECT_THAT(problem, HasSubstr("300 Hz are not possible"));
  EXPECT_THAT(problem, HasSubstr("choose --bandwidth "));
  EXPECT_EQ(read_gains(rig.objects(), rig.dialect)[0].number, 4);
}

// With the noise of a real encoder a slow loop does not show its delay well enough, but the fast one does.
TEST(TuneLimits, ABandwidthThatTheMeasurementRefutes) {
  TuningRig rig({"ismk", BusKind::can, rigid});
  const auto tuner = rig.tuner();
  const std::string problem = master::test::problem_of(
      [&] { tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = 300.0, .apply = true}); });
  EXPECT_THAT(problem, HasSubstr("choose "));
  EXPECT_EQ(read_gains(rig.objects(), rig.dialect)[0].number, 4);
}

// The drive has a fast loop already: a proposal of 60 % of the maximum would be slower.
TEST(TuneLimits, WithoutABandwidthTheLoopDoesNotBecomeSlower) {
  TuningRig rig({"generic402", BusKind::can, rigid});
  const auto tuner = rig.tuner();
  const double usual = tune(*tuner, rig.objects(), rig.dialect, rig.units, {}).bandwidth_hz;
  const double fast = 1.3 * usual;
  tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = fast, .apply = true, .steps = false});
  const SessionResult result = tune(*tuner, rig.objects(), rig.dialect, rig.units, {.apply = true});
  EXPECT_GT(*result.before.bandwidth_hz, 1.2 * usual);
  EXPECT_GT(*result.after->bandwidth_hz, 0.95 * *result.before.bandwidth_hz);
  EXPECT_THAT(text_of_changes(result), HasSubstr("bandwidth "));
  EXPECT_EQ(text_of_changes(result).find("worse: bandwidth"), std::string::npos) << text_of_changes(result);
  EXPECT_EQ(note_of(result), "");

  // With a bandwidth given, `tune` sets it even if the loop becomes slower, and its text says so.
  const SessionResult slower =
      tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = 0.5 * usual, .apply = true});
  EXPECT_LT(*slower.after->bandwidth_hz, 0.7 * usual);
  EXPECT_THAT(text_of_changes(slower), HasSubstr("worse: bandwidth "));
}

constexpr ObjectAddress reference_position_gain{0x2010, 1};  // 0.01/s
std::uint32_t position_gain_of(TuningRig& rig) {
  return rig.objects().read<std::uint32_t>(reference_position_gain.index, reference_position_gain.sub);
}

// The automatic gain of a new drive is not known; the one that is written then is compared from there on.
TEST(TuneLimits, WithoutABandwidthTheGreaterPositionGainStays) {
  TuningRig rig({"generic402", BusKind::can, rigid});
  const auto tuner = rig.tuner();
  const SessionResult first = tune(*tuner, rig.objects(), rig.dialect, rig.units, {.apply = true, .steps = false});
  EXPECT_THAT(text_of_changes(first), HasSubstr("position gain: the drive's own -> "));
  const std::uint32_t usual = position_gain_of(rig);
  EXPECT_GT(usual, 0U);
  for (const std::uint32_t before : {2 * usual, usual / 2}) {
    rig.objects().write<std::uint32_t>(reference_position_gain.index, reference_position_gain.sub, before);
    const SessionResult result = tune(*tuner, rig.objects(), rig.dialect, rig.units, {.apply = true, .steps = false});
    const std::string changes = text_of_changes(result);
    if (before > usual) {
      EXPECT_EQ(position_gain_of(rig), before);
      EXPECT_THAT(changes, ContainsRegex("about the same: .*position gain "));
    } else {
      EXPECT_GT(position_gain_of(rig), before);
      EXPECT_THAT(changes, ContainsRegex("better: .*position gain [0-9.]+ -> [0-9.]+ 1/s"));
    }
  }
  // A chosen bandwidth has its own position gain.
  rig.objects().write<std::uint32_t>(reference_position_gain.index, reference_position_gain.sub, 2 * usual);
  const SessionResult chosen = tune(*tuner, rig.objects(), rig.dialect, rig.units,
                                    {.bandwidth_hz = first.bandwidth_hz, .apply = true, .steps = false});
  EXPECT_LT(position_gain_of(rig), 2 * usual);
  EXPECT_THAT(text_of_changes(chosen), ContainsRegex("worse: position gain "));
}

// A slow loop that moves little: the axis responds clearly only at frequencies above the bandwidth.
TEST(TuneLimits, WithoutABandwidthOfThePresentLoopNothingIsWritten) {
  for (const bool apply : {false, true}) {
    TuningRig rig({"generic402", BusKind::can, rigid});
    rig.objects().write<std::uint32_t>(0x2010, 2, 8000);
    rig.objects().write<std::uint32_t>(0x2010, 3, 100000);
    const auto tuner = rig.tuner({.travel_revolutions = 8.0});
    const auto before = numbers(read_gains(rig.objects(), rig.dialect));
    SessionResult result;
    const std::string problem = master::test::problem_of(
        [&] { result = tune(*tuner, rig.objects(), rig.dialect, rig.units, {.apply = apply, .steps = false}); });
    if (apply) {
      EXPECT_THAT(problem, HasSubstr("no bandwidth of the present loop"));
      EXPECT_THAT(problem, HasSubstr("nothing is written; choose a --bandwidth"));
    } else {
      EXPECT_FALSE(result.before.bandwidth_hz);
      EXPECT_THAT(note_of(result), HasSubstr("no bandwidth of the present loop"));
    }
    EXPECT_EQ(numbers(read_gains(rig.objects(), rig.dialect)), before);
  }
}

TEST(TuneLimits, AProposalSaysWhatItMakesSlower) {
  TuningRig rig({"ismk", BusKind::can, rigid});
  const auto tuner = rig.tuner();
  const auto note_for = [&](double bandwidth_hz) {
    return note_of(tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = bandwidth_hz}));
  };
  EXPECT_THAT(note_for(12.0),
              testing::StartsWith("the proposed loop is slower than the present one: bandwidth 12.0 Hz"));
  EXPECT_THAT(note_for(40.0), testing::StartsWith("the proposed position gain is lower than the present one: "));
  EXPECT_EQ(note_of(tune(*tuner, rig.objects(), rig.dialect, rig.units, {})), "");
}

TEST(TuneLimits, AProposalWritesNothing) {
  TuningRig rig({"generic402", BusKind::can, rigid});
  const auto tuner = rig.tuner();
  const SessionResult result = tune(*tuner, rig.objects(), rig.dialect, rig.units, {.bandwidth_hz = 60.0});
  EXPECT_GT(result.gains[0].number, 0);
  EXPECT_FALSE(result.after);
  EXPECT_EQ(numbers(read_gains(rig.objects(), rig.dialect)), numbers(result.gains_before));
}

TEST(TuneLimits, ALimitSwitchIsNamed) {
  TuningRig rig({"generic402", BusKind::can,
                 "[axis.travel]\ncounts_per_unit = 131072\nlow_stop = -11\nhigh_stop = 11\n"
                 "negative_limit = -3\npositive_limit = 3\nstart = 2.0\n"});
  const auto tuner = rig.tuner();
  const std::string problem = master::test::problem_of([&] { tuner->measure(60.0, {}); });
  EXPECT_THAT(problem, HasSubstr("the positive limit switch is active (60FDh), 1.0"));
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
}

TEST(TuneLimits, ABlockedAxis) {
  TuningRig rig({"generic402", BusKind::can, rigid});
  rig.drive().plant().lock_rotor(true);
  const auto tuner = rig.tuner();
  EXPECT_THAT(master::test::problem_of([&] { tuner->measure(60.0, {}); }), HasSubstr("more than 60 % of rated torque"));
  EXPECT_NE(rig.servo().state(), PowerState::operation_enabled);
}

// For example the progress of the command cannot be printed.
TEST(OwnTuning, AnyExceptionStopsTheAxisAndRestoresTheGains) {
  for (const bool at_end : {false, true}) {
    AxisRig rig({"ismk"});
    Axis402 axis(rig.objects(), rig.options());
    const catalogue::TuningDialect& dialect = catalogue::product_of("ismk").tuning;
    const auto before = read_gains(rig.objects(), dialect);
    const auto fail = [at_end](const char* doing, double) {
      if (!at_end || std::string_view(doing) == "searching for resonances") throw std::runtime_error("disk full");
    };
    EXPECT_THROW(tune_by_itself(axis, dialect, axis.units().value(), {.progress = fail}), std::runtime_error);
    EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
    const double place = rig.shaft_counts();
    rig.objects().wait(100ms);
    EXPECT_NEAR(rig.shaft_counts(), place, 50);
    const auto after = read_gains(rig.objects(), dialect);
    for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(after[i].number, before[i].number) << i;
  }
}

// A great inertia makes the ramps of the moves long.
TEST(OwnTuning, TheAxisStaysWithinItsTravel) {
  AxisRig rig({"ismk"});
  rig.drive().plant().set_load_inertia_kgm2(0.1);
  Axis402 axis(rig.objects(), rig.options());
  const double start = rig.shaft_counts();
  const double turn = rig.drive().plant().parameters().encoder.counts_per_revolution;
  const catalogue::TuningDialect& dialect = catalogue::product_of("ismk").tuning;
  const auto before = read_gains(rig.objects(), dialect);
  EXPECT_THAT(master::test::problem_of(
                  [&] { tune_by_itself(axis, dialect, axis.units().value(), {.travel_revolutions = 1.0}); }),
              HasSubstr("the limit is 1"));
  EXPECT_LT(std::abs(rig.shaft_counts() - start) / turn, 3.0) << "the limit and the way to brake";
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  const auto after = read_gains(rig.objects(), dialect);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(after[i].number, before[i].number) << i;
}

TEST(OwnTuning, ItSaysThatNothingWasMeasured) {
  AxisRig rig({"ismk"});
  Axis402 axis(rig.objects(), rig.options());
  OwnTuningResult result = tune_by_itself(axis, catalogue::product_of("ismk").tuning, axis.units().value(), {});
  EXPECT_THAT(note_of(result), HasSubstr("nothing was measured before and after"));
  EXPECT_EQ(note_of(result).find("lower"), std::string::npos);
  EXPECT_EQ(note_of(result).find("still changing"), std::string::npos);
  result.before[0].number = result.after[0].number + 1;
  EXPECT_THAT(note_of(result), HasSubstr("Kvp[0] is lower than before: the velocity loop is slower"));
}

TEST(OwnTuning, ItSaysThatTheInertiaMayBeWrong) {
  AxisRig rig({"ismk"});
  Axis402 axis(rig.objects(), rig.options());
  const catalogue::TuningDialect& dialect = catalogue::product_of("ismk").tuning;
  const OwnTuningResult result = tune_by_itself(axis, dialect, axis.units().value(), {.seconds = 1.0});
  EXPECT_FALSE(result.inertia_settled);
  EXPECT_THAT(note_of(result), HasSubstr("the time to learn the inertia was over: repeat the tuning"));
}

}  // namespace
}  // namespace tuning_test
}  // namespace servodrome::master::tuning
