#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>

#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// The drive identifies inertia and friction with its own moves, on the simulated axis.
namespace servodrome::test {
namespace inertia_identification_test {
namespace {

using drive::InertiaEstimate;
using drive::InertiaIdentification;
using Outcome = InertiaIdentification::Outcome;

constexpr double rotor_kgm2 = 0.31e-4;
constexpr double rated_nm = 1.27;

// A 400 W motor of 48 V with an encoder of 16 bits, on its load.
plant::Parameters axis_with(double load_ratio) {
  plant::Parameters parameters = default_plant();
  parameters.motor.rated_torque_nm = rated_nm;
  parameters.motor.rated_current_a = 11.3;
  parameters.motor.torque_constant_nm_per_a = 0.1122;
  parameters.motor.resistance_ohm = 0.09;
  parameters.motor.direct_inductance_h = parameters.motor.quadrature_inductance_h = 0.2e-3;
  parameters.motor.rotor_inertia_kgm2 = rotor_kgm2;
  parameters.supply.volts = 310.0;
  parameters.supply.overcurrent_a = 80.0;
  parameters.supply.bus_overcurrent_a = 80.0;
  parameters.encoder.counts_per_revolution = 65536;
  parameters.load.inertia_kgm2 = load_ratio * rotor_kgm2;
  parameters.load.viscous_friction_nms = 2.0e-4;
  parameters.load.coulomb_friction_nm = 0.04;
  parameters.load.static_friction_nm = 0.06;
  return parameters;
}

struct Bench : Rig<products::Generic402> {
  explicit Bench(const plant::Parameters& parameters) : Rig(parameters) {
    set(0x6060, 0, 1);
    EXPECT_TRUE(enable());
    run_ms(20);
  }
  static InertiaIdentification::Request request() {
    return {.travel_counts = 65536.0, .speed_counts_per_s = 800.0 / 60.0 * 65536.0, .torque_limit = 1.0F};
  }
  Outcome identify(const InertiaIdentification::Request& wanted = request()) {
    EXPECT_TRUE(device.drive().identify_inertia(wanted));
    started = ticks();
    run_until([&] { return !device.drive().identification().running(); }, 8000.0);
    return device.drive().identification().outcome();
  }
  const InertiaEstimate& estimate() { return device.drive().identification().estimate(); }
  std::int64_t started = 0;
};

TEST(InertiaIdentification, FindsLoadsOfHalfToTwentyRotors) {
  for (const double ratio : {0.5, 1.0, 2.0, 5.0, 10.0, 20.0}) {
    Bench bench(axis_with(ratio));
    const double total = (1.0 + ratio) * rotor_kgm2;
    const double start = static_cast<double>(bench.plant.position_counts());
    ASSERT_EQ(bench.identify(), Outcome::done) << ratio;
    const double seconds = static_cast<double>(bench.ticks() - bench.started) * drive::tick_seconds;
    const double error = 100.0 * (bench.estimate().inertia_kgm2 / total - 1.0);
    std::printf(
        "load %4.1f rotors: inertia %+6.2f %%, coulomb %.4f Nm, viscous %.2e Nms, gravity %+.4f Nm, %u windows, %.2f "
        "s, +-%.2f %%\n",
        ratio, error, bench.estimate().coulomb_nm, bench.estimate().viscous_nms, bench.estimate().constant_nm,
        bench.estimate().windows, seconds, 100.0 * bench.estimate().relative_uncertainty);
    EXPECT_NEAR(error, 0.0, 5.0) << ratio;
    EXPECT_NEAR(bench.estimate().coulomb_nm, 0.04, 0.01) << ratio;
    bench.run_ms(300);
    EXPECT_EQ(bench.device.drive().state(), drive::PowerState::operation_enabled);
    EXPECT_LT(std::fabs(bench.plant.velocity_rpm()), 1.0);
    EXPECT_LT(std::fabs(static_cast<double>(bench.plant.position_counts()) - start), 65536.0);
  }
}

// A hanging load, and a load on a spring: the holding torque is separated, and the oscillation does not count.
TEST(InertiaIdentification, SeesThroughGravityAndElasticity) {
  for (const double ratio : {1.0, 10.0}) {
    plant::Parameters hanging = axis_with(ratio);
    hanging.load.gravity_torque_nm = 0.3;
    hanging.motor.brake_torque_nm = 2.0;  // holds the load until the motor does
    Bench bench(hanging);
    bench.run_ms(500);
    ASSERT_EQ(bench.identify(), Outcome::done);
    EXPECT_NEAR(bench.estimate().inertia_kgm2, (1.0 + ratio) * rotor_kgm2, 0.05 * (1.0 + ratio) * rotor_kgm2);
    EXPECT_NEAR(bench.estimate().constant_nm, 0.3, 0.02);

    plant::Parameters elastic = axis_with(ratio);
    elastic.load.elastic = true;
    elastic.load.stiffness_nm_per_rad = 60.0;  // oscillates at 440 Hz with one rotor inertia, 330 Hz with ten
    elastic.load.damping_nms = 2.0e-4;
    Bench ringing(elastic);
    ASSERT_EQ(ringing.identify(), Outcome::done);
    EXPECT_NEAR(ringing.estimate().inertia_kgm2, (1.0 + ratio) * rotor_kgm2, 0.05 * (1.0 + ratio) * rotor_kgm2);
  }
}

TEST(InertiaIdentification, NeedsAnAxisThatStandsUnderControl) {
  Rig<products::Generic402> off(axis_with(1.0));
  EXPECT_FALSE(off.device.drive().identify_inertia(Bench::request()));
  Bench bench(axis_with(1.0));
  EXPECT_FALSE(bench.device.drive().identify_inertia({.travel_counts = 65536.0, .speed_counts_per_s = 0.0}));
  EXPECT_FALSE(bench.device.drive().identify_inertia({.travel_counts = 0.0, .speed_counts_per_s = 1.0e5}));
  bench.set(0x6060, 0, 3);
  bench.set(0x6083, 0, 10000000);
  bench.set(0x6084, 0, 10000000);
  bench.set(0x60FF, 0, 65536);
  bench.run_ms(100);
  EXPECT_FALSE(bench.device.drive().identify_inertia(Bench::request()));
  EXPECT_EQ(bench.device.drive().identification().outcome(), Outcome::none);
}

TEST(InertiaIdentification, EndsWithoutAResultWhereItCannotBeHad) {
  Bench locked(axis_with(1.0));
  locked.plant.lock_rotor(true);
  EXPECT_EQ(locked.identify(), Outcome::no_motion);

  Bench hurried(axis_with(1.0));
  InertiaIdentification::Request request = Bench::request();
  request.timeout_s = 0.3;
  EXPECT_EQ(hurried.identify(request), Outcome::not_converged);

  // A load falls while the drive assumes that it holds it: it leaves its travel.
  Bench pulled(axis_with(1.0));
  pulled.set(0x6085, 0, 100000000);
  ASSERT_TRUE(pulled.device.drive().identify_inertia(Bench::request()));
  pulled.run_ms(300);
  pulled.plant.set_external_torque_nm(2.0);
  pulled.run_until([&] { return !pulled.device.drive().identification().running(); }, 3000.0);
  EXPECT_EQ(pulled.device.drive().identification().outcome(), Outcome::travel_exceeded);
  pulled.plant.set_external_torque_nm(0.0);
  pulled.run_ms(1000);
  EXPECT_LT(std::fabs(pulled.plant.velocity_rpm()), 1.0);
  EXPECT_EQ(pulled.device.drive().state(), drive::PowerState::operation_enabled);
}

TEST(InertiaIdentification, GivesWayToWhateverElseIsAsked) {
  const auto interrupted = [](auto&& by) {
    Bench bench(axis_with(1.0));
    bench.set(0x6084, 0, 10000000);
    EXPECT_TRUE(bench.device.drive().identify_inertia(Bench::request()));
    bench.run_ms(350);
    EXPECT_TRUE(bench.device.drive().identification().running());
    EXPECT_GT(std::fabs(bench.plant.velocity_rpm()), 10.0);
    by(bench);
    bench.run_ms(1);
    EXPECT_EQ(bench.device.drive().identification().outcome(), Outcome::interrupted);
    bench.run_ms(1500);
    EXPECT_LT(std::fabs(bench.plant.velocity_rpm()), 1.0);
  };
  interrupted([](Bench& bench) { bench.control(0x10F); });  // halt
  interrupted([](Bench& bench) { bench.control(0x00); });
  interrupted([](Bench& bench) { bench.control(0x02); });  // quick stop
  interrupted([](Bench& bench) { bench.set(0x6060, 0, 3); });
  interrupted([](Bench& bench) { bench.device.drive().inject(drive::Cause::external, true); });
  interrupted([](Bench& bench) { bench.device.drive().stop_identification(); });
}

TEST(InertiaIdentification, StopsAtALimitSwitch) {
  plant::Parameters parameters = axis_with(1.0);
  parameters.switches[0] = {.wire = 1, .from_counts = 3000};  // generic402: input 1 is the positive limit
  parameters.switch_count = 1;
  Bench bench(parameters);
  bench.set(0x6085, 0, 100000000);
  EXPECT_EQ(bench.identify(), Outcome::limit_switch);
  bench.run_ms(500);
  EXPECT_LT(std::fabs(bench.plant.velocity_rpm()), 1.0);
}

// Any motion with acceleration and deceleration is sufficient: the estimator runs while the drive follows its own
// program.
TEST(InertiaEstimator, LearnsFromMovesThatAreNotItsOwn) {
  for (const double ratio : {0.5, 5.0, 20.0}) {
    Bench bench(axis_with(ratio));
    bench.set(0x6081, 0, 65536 * 10);
    bench.set(0x6083, 0, 65536 * 80);
    bench.set(0x6084, 0, 65536 * 80);
    drive::InertiaEstimator estimator;
    estimator.begin({.counts_per_revolution = 65536.0, .rated_torque_nm = rated_nm, .cycle_s = 0.5e-3});
    InertiaEstimate found;
    int moves = 0;
    for (; moves < 12; ++moves) {
      bench.set(0x607A, 0, moves % 2 == 0 ? 65536 * 3 : 0);
      bench.control(0x3F);
      for (int cycle = 0; cycle < 1200; ++cycle) {
        do bench.tick();
        while (bench.ticks() % 8 != 1);  // a cycle has just begun
        estimator.sample(bench.device.drive().axis().encoder_position, bench.device.drive().loops().mean_torque);
      }
      bench.control(0x2F);
      if (estimator.estimate(found) && found.relative_uncertainty < 0.002) break;
    }
    EXPECT_LT(moves, 12);
    const double error = 100.0 * (found.inertia_kgm2 / ((1.0 + ratio) * rotor_kgm2) - 1.0);
    std::printf("load %4.1f rotors, moves of a master: inertia %+.2f %% after %d moves, %u windows\n", ratio, error,
                moves + 1, found.windows);
    EXPECT_NEAR(error, 0.0, 5.0);
  }
}

// Standstill and constant speed give no information, and the estimator reports none.
TEST(InertiaEstimator, KnowsWhenItKnowsNothing) {
  drive::InertiaEstimator estimator;
  estimator.begin({.counts_per_revolution = 65536.0, .rated_torque_nm = rated_nm, .cycle_s = 1e-3});
  InertiaEstimate found;
  for (int i = 0; i < 2000; ++i) estimator.sample(1000, 0.1F);
  for (int i = 0; i < 2000; ++i) estimator.sample(1000 + 50 * i, 0.1F);
  EXPECT_EQ(estimator.windows(), 0U);
  EXPECT_FALSE(estimator.estimate(found));
}

// Four unknowns and an estimate of their errors need eight windows: with seven there is no result, with eight it is
// right.
TEST(InertiaEstimator, TooFewWindowsAreNoEstimate) {
  drive::InertiaEstimator estimator;
  estimator.begin({.counts_per_revolution = 65536.0, .rated_torque_nm = rated_nm, .cycle_s = 1e-3});
  constexpr double inertia = 1.0e-4;
  constexpr double rad_per_count = 2.0 * 3.14159265358979 / 65536.0;
  InertiaEstimate found;
  double speed = 0.0;
  double position = 0.0;
  for (int i = 0; estimator.windows() < 8; ++i) {
    ASSERT_LT(i, 4000);
    EXPECT_FALSE(estimator.estimate(found)) << estimator.windows();
    const double acceleration = 400.0 * std::sin(2.0 * 3.14159265358979 * i / 300.0);  // rad/s2
    estimator.sample(static_cast<drive::Counts>(std::llround(position / rad_per_count)),
                     static_cast<float>(inertia * acceleration / rated_nm));
    speed += acceleration * 1e-3;
    position += speed * 1e-3;
  }
  ASSERT_TRUE(estimator.estimate(found));
  EXPECT_EQ(found.windows, 8U);
  EXPECT_NEAR(found.inertia_kgm2, inertia, 0.05 * inertia);
}

// The end of an identification is no command: a target that a limit switch ended does not act again.
TEST(InertiaIdentification, WakesNoTargetThatALimitEnded) {
  for (const int mode : {3, 8, 9}) {
    SCOPED_TRACE(mode);
    Bench bench(axis_with(1.0));
    bench.set(0x6083, 0, 65536 * 20);
    bench.set(0x6084, 0, 65536 * 20);
    bench.set(0x6085, 0, 65536 * 100);
    bench.set(0x6060, 0, mode);
    bench.run_ms(5);
    const auto command = [&] { mode == 8 ? bench.set(0x607A, 0, 65536 * 50) : bench.set(0x60FF, 0, 65536 * 3); };
    command();
    bench.run_ms(200);
    EXPECT_GT(bench.plant.velocity_rpm(), 50.0);
    bench.plant.force_input(1, true);
    bench.run_ms(500);
    bench.plant.force_input(1, false);
    command();
    bench.run_ms(200);
    ASSERT_LT(std::fabs(bench.plant.velocity_rpm()), 1.0) << "held";
    ASSERT_EQ(bench.identify(), Outcome::done);
    bench.run_ms(300);
    const auto there = static_cast<double>(bench.plant.position_counts());
    command();
    bench.run_ms(500);
    EXPECT_NEAR(static_cast<double>(bench.plant.position_counts()), there, 100.0);
    EXPECT_LT(std::fabs(bench.plant.velocity_rpm()), 1.0);
  }
}

TEST(InertiaIdentification, WakesNoRecordsThatCameMeanwhile) {
  Bench bench(axis_with(1.0));
  bench.set(0x60C4, 2, 64);
  bench.set(0x6060, 0, 7);
  bench.run_ms(5);
  bench.control(0x1F);
  ASSERT_TRUE(bench.device.drive().identify_inertia(Bench::request()));
  bench.run_ms(100);
  for (int n = 1; n <= 20; ++n) bench.set(0x60C1, 1, bench.get(0x6064) + 2000 * n);
  ASSERT_GE(bench.run_until([&] { return !bench.device.drive().identification().running(); }, 8000.0), 0);
  bench.run_ms(300);
  const std::int64_t there = bench.plant.position_counts();
  bench.run_ms(500);
  EXPECT_NEAR(static_cast<double>(bench.plant.position_counts()), static_cast<double>(there), 100.0);
  EXPECT_EQ(bench.get(0x60C4, 4), 0);
}

// Drives that refuse targets beyond 607Dh with a fault keep their own test moves within it as well.
TEST(InertiaIdentification, StaysWithinSoftwareLimitsThatAreSetMeanwhile) {
  for (const double turns : {0.02, 0.1}) {
    SCOPED_TRACE(turns);
    test::JmcRig rig;
    rig.open_limits();
    rig.set(0x6060, 0, 1);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(300);
    drive::Drive& drive = rig.device.drive();
    const double turn = drive.axis().units.counts_per_revolution;
    ASSERT_TRUE(drive.identify_inertia({.travel_counts = turn, .speed_counts_per_s = 800.0 / 60.0 * turn}));
    rig.run_until([&] { return std::fabs(rig.plant.velocity_rpm()) > 1.0; }, 1000.0);
    const auto limit = static_cast<std::int64_t>(turns * turn);
    rig.set(0x607D, 1, drive.axis().units.to_user(-limit));
    rig.set(0x607D, 2, drive.axis().units.to_user(limit));
    double furthest = 0.0;
    for (int i = 0; i < 3000; ++i) {
      rig.run_ms(1);
      furthest = std::max(furthest, std::fabs(static_cast<double>(drive.axis().position())));
    }
    EXPECT_FALSE(drive.identification().running());
    EXPECT_EQ(drive.identification().outcome(), Outcome::travel_exceeded);
    EXPECT_LT(furthest, static_cast<double>(limit) + 0.002 * turn);
    EXPECT_LT(std::fabs(rig.plant.velocity_rpm()), 1.0);
    rig.set(0x607D, 1, 0);
    rig.set(0x607D, 2, 1);
    rig.run_ms(2);
    EXPECT_FALSE(drive.identify_inertia({.travel_counts = turn, .speed_counts_per_s = 800.0 / 60.0 * turn}))
        << "no room";
  }
}

}  // namespace
}  // namespace inertia_identification_test
}  // namespace servodrome::test
