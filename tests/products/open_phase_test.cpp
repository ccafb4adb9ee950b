#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Cause::phase_loss in both directions, in every product that has it: no alarm in any healthy situation, with any
// voltage and any load on the shaft; and a cut wire is detected wherever its phase should carry current.
namespace servodrome {
namespace open_phase_test {
namespace {

using drive::Cause;

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ULL + 1) {}
  double uniform(double low, double high) {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    return low + (high - low) * static_cast<double>(state_ >> 11) * 0x1p-53;
  }
  bool chance(double share) { return uniform(0.0, 1.0) < share; }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(uniform(0.0, static_cast<double>(count))); }
  // A value of any order of magnitude, with either sign.
  double spread(double least, double most) {
    return std::copysign(least * std::pow(most / least, uniform(0.0, 1.0)), uniform(-1.0, 1.0));
  }

 private:
  std::uint64_t state_;
};

template <typename RigType>
struct Stand {
  RigType& rig;
  Random& random;
  double rated_nm;
  double rated_rpm;
  double turn;

  Stand(RigType& stand, Random& chance) : rig(stand), random(chance) {
    const drive::MotorData& motor = rig.device.drive().configuration().motor;
    rated_nm = static_cast<double>(motor.rated_torque_nm);
    rated_rpm = static_cast<double>(motor.rated_speed_rpm);
    turn = motor.counts_per_revolution;
    rig.set(0x6065, 0, 0xFFFFFFFF);
    for (const std::uint16_t object : {std::uint16_t{0x607F}, std::uint16_t{0x60C5}, std::uint16_t{0x60C6}}) {
      rig.set(object, 0, 0x7FFFFFFF);
    }
    ignore_all_but_phase_loss();
  }
  // Other faults would end such situations, so their monitors are off.
  void ignore_all_but_phase_loss() {
    drive::Configuration configuration = rig.device.drive().configuration();
    for (const drive::FaultRow& row : rig.device.drive().policy().faults.rows) {
      if (row.cause != Cause::phase_loss) configuration.ignored.set(row.cause);
    }
    rig.device.drive().configure(configuration);
  }
  bool lost() { return rig.device.drive().is_active(Cause::phase_loss); }
  bool running() { return rig.device.drive().state() == drive::PowerState::operation_enabled; }
  void mode(std::int8_t mode) { rig.set(0x6060, 0, mode); }
  void ramp(double rpm_per_s) {
    const double unit = rig.device.drive().axis().units.acceleration;
    for (const std::uint16_t object : {std::uint16_t{0x6083}, std::uint16_t{0x6084}}) {
      rig.set(object, 0, std::lround(std::min(2.0e9, rpm_per_s / 60.0 * turn / unit)));
    }
  }
  void speed(double rpm) {
    const double user = rig.device.drive().axis().units.velocity_to_user(rpm / 60.0 * turn);
    rig.set(0x60FF, 0, std::lround(std::clamp(user, -2.0e9, 2.0e9)));
  }
  void torque(double share) { rig.set(0x6071, 0, std::lround(std::clamp(1000.0 * share, -3000.0, 3000.0))); }
  void load(double share) { rig.plant.set_external_torque_nm(share * rated_nm); }

  // Any demand and any load; the supply from almost zero to its nominal voltage.
  void draw(double nominal_v) {
    switch (random.below(6)) {
      case 0: rig.plant.set_supply_v(nominal_v * random.uniform(0.02, 0.5)); break;
      case 1: rig.plant.set_supply_v(nominal_v); break;
      case 2: load(random.spread(0.01, 3.0)); break;
      case 3: load(random.chance(0.5) ? 0.0 : random.uniform(-0.5, 0.5)); break;
      default: break;
    }
    if (random.chance(0.1)) {  // the load drives or holds it
      load(std::copysign(random.uniform(0.5, 5.0), random.uniform(-1.0, 1.0)));
    }
    if (random.chance(0.3)) mode(random.chance(0.3) ? 4 : 3);
    if (random.chance(0.5)) ramp(std::abs(random.spread(100.0, 1.0e6)));
    const double share = random.chance(0.15) ? 0.0 : random.spread(1.0e-4, 1.3);
    speed(share * rated_rpm);
    torque(random.chance(0.15) ? 0.0 : random.spread(0.005, 3.0));
  }
};

template <typename RigType>
void expect_no_alarm(const char* name, RigType& rig, std::uint64_t seed, int situations) {
  Random random(seed);
  Stand stand(rig, random);
  stand.mode(3);
  ASSERT_TRUE(rig.enable()) << name;
  const double nominal_v = rig.plant.dc_link_v();
  for (int i = 0; i < situations; ++i) {
    stand.draw(nominal_v);
    rig.run_ms(random.uniform(2.0, 60.0));
    ASSERT_FALSE(stand.lost()) << name << ", seed " << seed << ", situation " << i;
    ASSERT_TRUE(stand.running()) << name << ", seed " << seed << ", situation " << i;
  }
}

// SERVODROME_SITUATIONS multiplies their number.
int factor() {
  const char* text = std::getenv("SERVODROME_SITUATIONS");
  return text == nullptr ? 1 : std::max(1, std::atoi(text));
}

// A random plant: inertia, friction, and a rotor that a stop or a brake may hold.
plant::Parameters drawn(plant::Parameters parameters, Random& random) {
  plant::Load& load = parameters.load;
  load.inertia_kgm2 = parameters.motor.rotor_inertia_kgm2 * std::abs(random.spread(0.1, 10.0));
  load.coulomb_friction_nm = parameters.motor.rated_torque_nm * std::abs(random.spread(0.001, 0.3));
  load.static_friction_nm = load.coulomb_friction_nm * random.uniform(1.0, 2.0);
  if (random.chance(0.2)) {  // locked
    load.low_stop_counts = parameters.encoder.start_position_counts - 1;
    load.high_stop_counts = parameters.encoder.start_position_counts + 1;
  }
  return parameters;
}

plant::Parameters coarse(std::int32_t counts) {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.counts_per_revolution = counts;
  return parameters;
}

template <typename Visit>
void on_every_product(std::uint64_t seed, Visit&& visit) {
  {
    Random random(seed);
    test::Rig<products::Ismc> rig(drawn(test::default_plant(), random));
    visit("ismc", rig);
  }
  {
    Random random(seed + 1);
    test::Rig<products::Ismc> rig(drawn(coarse(4096), random));
    visit("ismc, 4096", rig);
  }
  {
    Random random(seed + 2);
    test::Rig<products::Generic402> rig(drawn(test::default_plant(), random));
    visit("generic402", rig);
  }
  for (const auto& rating : products::ismk::ratings) {
    Random random(seed + 3);
    test::IsmkRig rig(drawn(test::ismk_plant(rating.name), random), test::ismk_settings(rating.name));
    visit("ismk", rig);
  }
  for (const auto& rating : products::jmc_ec::ratings) {
    Random random(seed + 4);
    test::JmcRig rig(drawn(test::jmc_plant(rating.model.name), random), test::jmc_settings(rating.model.name));
    visit(rating.model.name.data(), rig);
  }
}

TEST(OpenPhase, NoAlarmOfAHealthyMotor) {
  const auto runs = static_cast<std::uint64_t>(4 * factor());
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    on_every_product(seed * 100, [seed](const char* name, auto& rig) { expect_no_alarm(name, rig, seed, 25); });
  }
}

TEST(OpenPhase, TorqueIntoTheVoltageLimitIsNoAlarm) {  // `servodrome torque --percent 50` on an ismk
  test::FactoryIsmkRig rig;
  rig.set(0x6060, 0, 4);
  ASSERT_TRUE(rig.enable());
  rig.set(0x6071, 0, 500);
  rig.run_ms(3000);
  EXPECT_FALSE(rig.device.drive().any_fault());
  EXPECT_GT(rig.plant.velocity_rpm(), 1000.0);
}

// Time since the wire was cut.
template <typename RigType>
double ms_to_alarm(RigType& rig, unsigned phase, double limit_ms) {
  rig.plant.inject(static_cast<plant::Injection>(static_cast<unsigned>(plant::Injection::open_phase_u) + phase), true);
  const std::int64_t ticks =
      rig.run_until([&rig] { return rig.device.drive().is_active(Cause::phase_loss); }, limit_ms);
  return ticks < 0 ? 1.0e9 : static_cast<double>(ticks) / 16.0;
}

template <typename RigType>
void expect_found(const char* name, RigType& rig, std::uint64_t seed) {
  Random random(seed);
  Stand stand(rig, random);
  const drive::MotorData& motor = rig.device.drive().configuration().motor;
  const unsigned phase = static_cast<unsigned>(random.below(motor.phases));
  const bool turning = random.chance(0.6);
  const double rpm = turning ? random.spread(0.05, 0.9) * stand.rated_rpm : 0.0;
  const double share = random.chance(0.2) ? 0.0 : random.spread(0.05, 0.9);
  stand.mode(3);
  stand.ramp(20000.0);
  ASSERT_TRUE(rig.enable()) << name;
  stand.load(share);
  stand.speed(rpm);
  rig.run_ms(600);
  ASSERT_FALSE(stand.lost());
  // The greatest current of the phase at the present position, or over some time.
  float carried = 0.0F;
  for (int i = 0; i < (turning ? 1600 : 160); ++i) {
    rig.tick();
    carried = std::max(carried, std::abs(rig.feedback.phase_current_a[phase]));
  }
  const double of_rated = static_cast<double>(carried / motor.rated_current_a);
  const double turn_ms = turning ? 60000.0 / (std::abs(rpm) * motor.pole_pairs) : 0.0;
  const double ms = ms_to_alarm(rig, phase, 2000.0);
  if (of_rated < 0.02) return;  // too little for a detection
  EXPECT_LE(ms, std::max(200.0, 1.5 * turn_ms))
      << name << ", seed " << seed << (turning ? ", turning at " : ", standing, ") << rpm << " rpm, load " << share
      << ", phase " << phase << " had carried " << of_rated;
}

// If the phase carries or should carry 2 % of the rated current: within 200 ms, or within one and a half electrical
// turns if they take longer.
TEST(OpenPhase, IsFoundWhereItShouldCarryCurrent) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(8 * factor()); ++seed) {
    on_every_product(seed * 1000, [seed](const char* name, auto& rig) { expect_found(name, rig, seed); });
  }
}

template <typename RigType>
void expect_found_at_300(const char* name) {
  for (unsigned phase = 0; phase < 3; ++phase) {
    RigType rig;
    if (phase >= rig.device.drive().configuration().motor.phases) return;
    Random random(1);
    Stand stand(rig, random);
    stand.mode(3);
    stand.ramp(20000.0);
    stand.speed(300.0);
    ASSERT_TRUE(rig.enable()) << name;
    rig.run_ms(500);
    ASSERT_NEAR(rig.plant.velocity_rpm(), 300.0, 5.0) << name;
    EXPECT_LE(ms_to_alarm(rig, phase, 1000.0), 500.0) << name << ", phase " << phase;
  }
}

TEST(OpenPhase, IsFoundAt300RpmWithoutLoad) {
  expect_found_at_300<test::Rig<products::Ismc>>("ismc");
  expect_found_at_300<test::Rig<products::Generic402>>("generic402");
  expect_found_at_300<test::IsmkRig>("ismk");
  expect_found_at_300<test::JmcRig>("jmc_ec");
}

}  // namespace
}  // namespace open_phase_test
}  // namespace servodrome
