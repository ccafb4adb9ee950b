#include <cmath>
#include <complex>
#include <cstdio>
#include <gtest/gtest.h>
#include <memory>
#include <vector>

#include "drive/tuning/resonance_analysis.hpp"
#include "loops_support.hpp"

// Resonances of an elastic axis: the drive finds them in closed loop and suppresses them with notches.
namespace servodrome::drive::test {
namespace tuning_resonance_test {
namespace {

TEST(Fft, IsTheTransformAndMayBeSpread) {
  using Transform = Fft<6>;
  Transform::Values real{};
  Transform::Values imaginary{};
  std::vector<std::complex<double>> input(Transform::size);
  for (std::size_t n = 0; n < Transform::size; ++n) {
    real[n] = static_cast<float>(std::cos(1.3 * static_cast<double>(n * n)));
    imaginary[n] = static_cast<float>(std::sin(0.7 * static_cast<double>(n)) + 0.25);
    input[n] = {static_cast<double>(real[n]), static_cast<double>(imaginary[n])};
  }
  Transform fft;
  std::size_t calls = 1;
  while (!fft.advance(real, imaginary, 5)) ++calls;
  EXPECT_EQ(calls, (Transform::size + 6 * Transform::size / 2 + 4) / 5);
  for (std::size_t k = 0; k < Transform::size; ++k) {
    std::complex<double> expected = 0.0;
    for (std::size_t n = 0; n < Transform::size; ++n) {
      expected += input[n] * std::polar(1.0, -2.0 * pi * static_cast<double>(k * n) / Transform::size);
    }
    EXPECT_NEAR(static_cast<double>(real[k]), expected.real(), 1.0e-4) << k;
    EXPECT_NEAR(static_cast<double>(imaginary[k]), expected.imag(), 1.0e-4) << k;
  }
}

// Model of the axis: a rigid body, and resonances above it, each with a share of the acceleration.
class Resonators {
 public:
  struct Mode {
    double frequency_hz;
    double share;
  };
  explicit Resonators(std::vector<Mode> modes) : modes_(std::move(modes)), states_(modes_.size() + 1) {}

  // Advances a period of 125 us with this torque; returns the encoder's position.
  Counts step(double torque) {
    constexpr int substeps = 16;
    constexpr double dt = 125e-6 / substeps;
    constexpr double counts = 1.0e9;  // per unit of position
    double position = 0.0;
    for (int k = 0; k < substeps; ++k) {
      states_.back().speed += dt * torque;
      states_.back().position += dt * states_.back().speed;
      for (std::size_t i = 0; i < modes_.size(); ++i) {
        const double w = 2.0 * pi * modes_[i].frequency_hz;
        State& state = states_[i];
        state.speed += dt * (modes_[i].share * torque - 2.0 * 0.02 * w * state.speed - w * w * state.position);
        state.position += dt * state.speed;
      }
    }
    for (const State& state : states_) position += state.position;
    return std::llround(counts * position);
  }

 private:
  struct State {
    double position = 0.0;
    double speed = 0.0;
  };
  std::vector<Mode> modes_;
  std::vector<State> states_;
};

// There are two notches: of more resonances the strongest two are kept, whatever their order in frequency, and none
// twice.
TEST(Resonances, OfMoreThanThereIsRoomForTheHighest) {
  using Mode = Resonators::Mode;
  const auto analysis = std::make_unique<ResonanceAnalysis>();
  for (const auto& [low, middle, high] :
       {std::tuple{1.0, 0.4, 1.0}, {0.2, 1.0, 1.0}, {1.0, 1.0, 0.2}, {0.9, 0.2, 0.5}}) {
    Resonators axis({Mode{250.0, low}, Mode{500.0, middle}, Mode{1000.0, high}});
    analysis->begin({});
    Counts position = 0;
    double torque = 0.0;
    for (int i = 0; analysis->running(); ++i) {
      ASSERT_LT(i, 100000);
      torque = static_cast<double>(analysis->exchange({.position = position, .torque = static_cast<float>(torque)}));
      position = axis.step(torque);
      analysis->compute(64);
    }
    ASSERT_EQ(analysis->count(), ResonanceAnalysis::most_resonances) << low << middle << high;
    EXPECT_GE(analysis->resonance(0).height, analysis->resonance(1).height);
    std::vector<double> expected;
    if (low > std::min(middle, high)) expected.push_back(250.0);
    if (middle > std::min(low, high)) expected.push_back(500.0);
    if (high > std::min(low, middle)) expected.push_back(1000.0);
    std::vector<double> found;
    for (std::size_t i = 0; i < 2; ++i) found.push_back(static_cast<double>(analysis->resonance(i).frequency_hz));
    std::sort(found.begin(), found.end());
    ASSERT_EQ(expected.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(found[i], expected[i], 0.03 * expected[i]);
  }
}

constexpr double rotor_kgm2 = 0.31e-4;

// Two masses on a spring: the rotor has the resonance sqrt(c (1/J1 + 1/J2)) and, below it, the antiresonance.
plant::Parameters elastic_axis(double resonance_hz, double load_ratio, double damping = 0.01) {
  plant::Parameters parameters = frictionless(65536);
  parameters.motor.rated_torque_nm = 1.27;
  parameters.motor.rated_current_a = 11.3;
  parameters.motor.torque_constant_nm_per_a = 0.1122;
  parameters.motor.resistance_ohm = 0.09;
  parameters.motor.direct_inductance_h = parameters.motor.quadrature_inductance_h = 0.2e-3;
  parameters.motor.rotor_inertia_kgm2 = rotor_kgm2;
  parameters.motor.coulomb_friction_nm = 0.005;
  parameters.supply.volts = 48.0;
  parameters.supply.overcurrent_a = 80.0;
  parameters.supply.bus_overcurrent_a = 80.0;
  const double load = load_ratio * rotor_kgm2;
  const double reduced = rotor_kgm2 * load / (rotor_kgm2 + load);
  const double w = 2.0 * pi * resonance_hz;
  parameters.load.inertia_kgm2 = load;
  parameters.load.elastic = true;
  parameters.load.stiffness_nm_per_rad = reduced * w * w;
  parameters.load.damping_nms = 2.0 * damping * reduced * w;
  parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.01;
  return parameters;
}

constexpr Rates slow_rates{4, 16};
constexpr float velocity_period = 250.0e-6F;

// The axis is held in position control, with a velocity loop of this crossover for the whole inertia.
struct ElasticAxis : Axis {
  ElasticAxis(const plant::Parameters& parameters, double bandwidth_hz) : Axis(parameters, slow_rates) {
    gains.velocity_kp = static_cast<float>(2.0 * pi * bandwidth_hz *
                                           static_cast<double>(motor.inertia_kgm2 / motor.torque_constant_nm_per_a));
    gains.velocity_ki = gains.velocity_kp * static_cast<float>(2.0 * pi * bandwidth_hz / 5.0);
    gains.position_kp = static_cast<float>(2.0 * pi * bandwidth_hz / 4.0);
    gains.velocity_feedback = VelocityFeedback::second_order;
    gains.velocity_filter_hz = static_cast<float>(std::max(240.0, 4.0 * bandwidth_hz));
    gains.torque_filter_hz = 0.0F;
    configure();
    demand.loop = Loop::position;
  }
  ResonanceAnalysis& analyse(ResonanceAnalysis::Settings settings = {}) {
    settings.sample_s = velocity_period;
    const Gains kept = gains;
    gains.velocity_kp *= 0.125F;
    gains.velocity_ki *= 0.125F * 0.125F;
    gains.position_kp *= 0.125F;
    configure();
    analysis.begin(settings);
    cascade.set_analysis(&analysis);
    for (int cycles = 0; analysis.running() && cycles < 20000; ++cycles) {
      for (int i = 0; i < 16; ++i) tick();
      analysis.compute(64);
    }
    cascade.set_analysis(nullptr);
    gains = kept;
    configure();
    return analysis;
  }
  // RMS of the current about its mean, some time after a torque pulse.
  double oscillation_a(double seconds = 0.5) {
    plant.set_external_torque_nm(0.2);
    run_seconds(0.002);
    plant.set_external_torque_nm(0.0);
    run_seconds(0.5);
    double sum = 0.0;
    double mean = 0.0;
    const auto ticks = std::lround(seconds / tick_seconds);
    for (auto i = ticks; i > 0; --i) {
      tick();
      sum += plant.current_a() * plant.current_a();
      mean += plant.current_a();
    }
    mean /= static_cast<double>(ticks);
    return std::sqrt(std::max(sum / static_cast<double>(ticks) - mean * mean, 0.0));
  }
  ResonanceAnalysis analysis;
};

double error_percent(const ResonanceAnalysis& found, double hz) {
  return 100.0 * (static_cast<double>(found.resonance(0).frequency_hz) / hz - 1.0);
}

TEST(Resonance, FoundWithinThreePercentWhateverTheLoopIsTunedTo) {
  for (const double load_ratio : {1.0, 3.0}) {
    for (const double hz : {120.0, 200.0, 300.0, 450.0, 700.0, 900.0}) {
      for (const double bandwidth_hz : {30.0, 80.0}) {
        ElasticAxis axis(elastic_axis(hz, load_ratio), bandwidth_hz);
        const ResonanceAnalysis& found = axis.analyse();
        ASSERT_EQ(found.count(), 1U) << hz << " Hz, load " << load_ratio;
        std::printf("load %.0f rotors, %3.0f Hz, loop %2.0f Hz: found %5.1f Hz, %+.2f %%, prominence %.1f\n",
                    load_ratio, hz, bandwidth_hz, static_cast<double>(found.resonance(0).frequency_hz),
                    error_percent(found, hz), static_cast<double>(found.resonance(0).prominence));
        EXPECT_NEAR(error_percent(found, hz), 0.0, 3.0) << hz << " Hz, load " << load_ratio;
      }
    }
  }
}

// Loops with a gain that is too high for the spring: they oscillate until the notch is set to the measured frequency.
TEST(Resonance, NotchTakesTheOscillationOut) {
  struct Case {
    double hz, load_ratio, bandwidth_hz;
  };
  for (const Case& c : {Case{120.0, 3.0, 50.0},
                        {200.0, 1.0, 60.0},
                        {200.0, 3.0, 60.0},
                        {300.0, 1.0, 100.0},
                        {300.0, 3.0, 80.0},
                        {450.0, 3.0, 100.0}}) {
    ElasticAxis axis(elastic_axis(c.hz, c.load_ratio), c.bandwidth_hz);
    const double before = axis.oscillation_a();
    const ResonanceAnalysis& found = axis.analyse();
    ASSERT_EQ(found.count(), 1U);
    EXPECT_NEAR(error_percent(found, c.hz), 0.0, 3.0);
    const float centre_hz = found.resonance(0).frequency_hz;
    axis.gains.notches[0] = {centre_hz, 0.5F * centre_hz, 0.05F};
    axis.configure();
    const double after = axis.oscillation_a();
    std::printf("%.0f Hz, load %.0f rotors, loop %.0f Hz: found %.1f Hz; current %.2f A rms before, %.3f A after\n",
                c.hz, c.load_ratio, c.bandwidth_hz, static_cast<double>(centre_hz), before, after);
    EXPECT_GT(before, 5.0);
    EXPECT_LT(after, 0.01 * before);
  }
}

TEST(Resonance, ShowsInTheControllersAnswerToo) {
  for (const double hz : {150.0, 300.0, 600.0}) {
    ElasticAxis axis(elastic_axis(hz, 2.0), 40.0);
    const ResonanceAnalysis& found = axis.analyse({.answer = ResonanceAnalysis::Answer::controller});
    ASSERT_EQ(found.count(), 1U) << hz;
    EXPECT_NEAR(error_percent(found, hz), 0.0, 3.0);
  }
}

TEST(Resonance, OfARigidAxisThereIsNone) {
  plant::Parameters parameters = elastic_axis(300.0, 1.0);
  parameters.load.elastic = false;
  ElasticAxis axis(parameters, 60.0);
  EXPECT_EQ(axis.analyse().count(), 0U);
}

// Without any response there is no noise level to compare with, so no peak is accepted.
TEST(Resonance, OfAnAxisThatDoesNotMoveThereIsNone) {
  ResonanceAnalysis analysis;
  analysis.begin({});
  float torque = 0.0F;
  while (analysis.exciting()) torque = analysis.exchange({.position = 4711, .torque = torque});
  while (analysis.running()) analysis.compute(100);
  EXPECT_EQ(analysis.state(), ResonanceAnalysis::State::done);
  EXPECT_EQ(analysis.count(), 0U);
}

// A mechanism with three masses has two resonances; here two modes in parallel with the rigid body.
TEST(Resonance, TwoAreTheMost) {
  constexpr double sample_s = 125.0e-6;
  constexpr std::array modes_hz{180.0, 620.0};
  ResonanceAnalysis analysis;
  analysis.begin({.sample_s = static_cast<float>(sample_s), .amplitude = 0.1F});
  std::array<double, 3> position{};
  std::array<double, 3> speed{};
  float torque = 0.0F;
  while (analysis.exciting()) {
    double sum = 0.0;
    for (std::size_t i = 0; i < 3; ++i) sum += position[i];
    torque = analysis.exchange({.position = static_cast<Counts>(std::floor(sum)), .torque = torque});
    for (int step = 0; step < 16; ++step) {
      const double h = sample_s / 16.0;
      for (std::size_t i = 0; i < 3; ++i) {
        const double w = i == 0 ? 0.0 : 2.0 * pi * modes_hz[i - 1];
        speed[i] += h * (1.0e8 * static_cast<double>(torque) - w * w * position[i] - 0.03 * w * speed[i]);
        position[i] += h * speed[i];
      }
    }
  }
  while (analysis.running()) analysis.compute(100);
  ASSERT_EQ(analysis.count(), 2U);
  const auto a = static_cast<double>(analysis.resonance(0).frequency_hz);
  const auto b = static_cast<double>(analysis.resonance(1).frequency_hz);
  EXPECT_NEAR(std::min(a, b), modes_hz[0], 0.03 * modes_hz[0]);
  EXPECT_NEAR(std::max(a, b), modes_hz[1], 0.03 * modes_hz[1]);
}

}  // namespace
}  // namespace tuning_resonance_test
}  // namespace servodrome::drive::test
