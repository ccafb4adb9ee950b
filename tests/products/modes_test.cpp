#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// The modes except profile position, and torque and speed limits, limit switches, probes and inputs/outputs of complete
// drives on their plants (CiA 402-2 clauses 11 to 18; ISMC manual, ch. 4.4 to 4.6, ch. 4.8.1 to 4.8.3).
namespace servodrome {
namespace modes_test {
namespace {

using dictionary::AbortCode;
using drive::Signal;
using products::Generic402;
using products::Ismc;
using test::Rig;

constexpr std::uint16_t reached = 0x0400;
constexpr std::uint16_t limited = 0x0800;
constexpr double counts_per_rpm = 131072.0 / 60.0;

template <typename DeviceType>
struct Axis : Rig<DeviceType> {
  explicit Axis(std::int8_t mode, const plant::Parameters& parameters = test::default_plant())
      : Rig<DeviceType>(parameters) {
    must(0x6060, 0, mode);
  }
  void must(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    EXPECT_EQ(this->set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub};
  }
  double demand_velocity() { return this->device.drive().axis().generator.velocity(); }
  double velocity() { return static_cast<double>(this->get(0x606C)); }
  double ms_until(const std::function<bool()>& condition, double limit_ms = 10000.0) {
    const std::int64_t ticks = this->run_until(condition, limit_ms);
    EXPECT_GE(ticks, 0);
    return static_cast<double>(ticks) / 16.0;
  }
};
using Reference = Axis<Generic402>;
using Servo = Axis<Ismc>;

// --- Profile velocity

TEST(ProfileVelocity, AcceleratesAndDeceleratesByTheirOwnRamps) {
  Reference axis(3);
  axis.must(0x6083, 0, 2621440);
  axis.must(0x6084, 0, 655360);
  ASSERT_TRUE(axis.enable());
  const auto at = [&axis](double goal) { return [&axis, goal] { return axis.demand_velocity() == goal; }; };
  axis.must(0x60FF, 0, 500000);
  EXPECT_NEAR(axis.ms_until(at(500000.0)), 500.0 / 2.62144, 0.6);
  axis.must(0x60FF, 0, 100000);
  EXPECT_NEAR(axis.ms_until(at(100000.0)), 400.0 / 0.65536, 0.6);
  axis.must(0x60FF, 0, -500000);  // through zero: one ramp down, the other up
  EXPECT_NEAR(axis.ms_until(at(-500000.0)), 100.0 / 0.65536 + 500.0 / 2.62144, 1.1);
  axis.must(0x60FF, 0, 0);
  EXPECT_NEAR(axis.ms_until(at(0.0)), 500.0 / 0.65536, 0.6);
  axis.run_ms(100);
  EXPECT_EQ(axis.get(0x606C), 0);
}

TEST(ProfileVelocity, IsClippedTo607F) {
  Reference axis(3);
  axis.must(0x607F, 0, 300000);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60FF, 0, 2000000);
  axis.run_ms(500);
  EXPECT_EQ(axis.demand_velocity(), 300000.0);
  EXPECT_EQ(axis.status() & limited, limited);
  axis.must(0x60FF, 0, 200000);
  axis.run_ms(500);
  EXPECT_EQ(axis.demand_velocity(), 200000.0);
  EXPECT_EQ(axis.status() & limited, 0);
}

TEST(ProfileVelocity, WindowsAndThresholds) {  // 606Dh to 6070h
  Reference axis(3);
  axis.must(0x606D, 0, 5000);
  axis.must(0x606E, 0, 100);
  axis.must(0x606F, 0, 20000);
  axis.must(0x6070, 0, 40);
  ASSERT_TRUE(axis.enable());
  axis.run_ms(20);
  EXPECT_EQ(axis.status() & 0x1000, 0x1000);
  axis.must(0x60FF, 0, 500000);
  // 606Ch is 4 ms late.
  EXPECT_NEAR(axis.ms_until([&] { return (axis.status() & 0x1000) == 0; }), 20.0 / 1.31072 + 4.0 + 40.0, 3.0);
  EXPECT_EQ(axis.status() & reached, 0);
  axis.ms_until([&] { return axis.demand_velocity() == 500000.0; });
  EXPECT_NEAR(axis.ms_until([&] { return (axis.status() & reached) != 0; }), 100.0, 10.0);
  axis.plant.set_external_torque_nm(3.0);
  axis.ms_until([&] { return (axis.status() & reached) == 0; }, 20.0);
  axis.plant.set_external_torque_nm(0.0);
  axis.must(0x60FF, 0, 0);
  axis.ms_until([&] { return (axis.status() & 0x1000) != 0; }, 1000.0);
  EXPECT_LT(std::abs(axis.velocity()), 20000.0);
}

TEST(ProfileVelocity, SlippageShowsInBit13OfTheReferenceDriveOnly) {
  Reference axis(3);
  axis.must(0x60F8, 0, 10000);
  ASSERT_TRUE(axis.enable());
  axis.plant.lock_rotor(true);
  axis.must(0x60FF, 0, 100000);
  axis.run_ms(200);
  EXPECT_EQ(axis.status() & 0x2000, 0x2000);
  Servo servo(3);  // G21
  ASSERT_TRUE(servo.enable());
  servo.plant.lock_rotor(true);
  servo.must(0x60FF, 0, 100000);
  servo.run_ms(200);
  EXPECT_EQ(servo.status() & 0x2000, 0);
}

TEST(ProfileVelocity, StopOfTheIsmcHasARampOfItsOwn) {  // 2117h
  Servo axis(3);
  axis.must(0x2117, 0, 3);
  axis.must(0x60A4, 1, 13107200);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60FF, 0, 500000);
  EXPECT_NEAR(axis.ms_until([&] { return axis.demand_velocity() == 500000.0; }), 500.0 / 1.31072, 0.6);
  axis.must(0x60FF, 0, 0);
  EXPECT_NEAR(axis.ms_until([&] { return axis.demand_velocity() == 0.0; }), 500.0 / 1.31072 + 100.0, 0.6);
  EXPECT_EQ(axis.status() & 0x4F, 0x07);
}

// While the brake opens, the mode does not run and shows neither slippage nor a limit.
TEST(ProfileVelocity, TellsNothingWhileTheBrakeOpens) {
  Reference axis(3);
  axis.must(0x60F8, 0, 1000000);
  axis.must(0x60FF, 0, 100000);
  drive::Configuration configuration = axis.device.drive().configuration();
  configuration.brake_release_ms = 100;
  axis.device.drive().configure(configuration);
  ASSERT_TRUE(axis.enable());
  for (int i = 0; i < 80; ++i) {
    EXPECT_EQ(axis.demand_velocity(), 0.0) << i;
    EXPECT_EQ(axis.status() & (0x2000 | limited), 0) << i;
    axis.run_ms(1);
  }
  axis.run_ms(400);
  EXPECT_EQ(axis.demand_velocity(), 100000.0);
}

// --- Velocity mode

struct Vl : testing::Test {
  static constexpr std::uint16_t run = 0x7F;  // enable, unlock, reference ramp
  Reference axis{2};
  double rpm() { return axis.demand_velocity() / counts_per_rpm; }
  void SetUp() override {
    axis.must(0x6048, 1, 1500);
    axis.must(0x6048, 2, 1);
    axis.must(0x6049, 1, 3000);
    axis.must(0x6049, 2, 2);
    axis.must(0x604A, 1, 6000);
    axis.must(0x604A, 2, 1);
    ASSERT_TRUE(axis.enable());
    axis.control(run);
  }
};

TEST_F(Vl, RampsAreSpeedPerTime) {
  axis.must(0x6042, 0, 600);
  EXPECT_NEAR(axis.ms_until([&] { return std::abs(rpm() - 600.0) < 1e-6; }), 400.0, 0.6);
  axis.run_ms(50);
  EXPECT_EQ(axis.get(0x6043), 600);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6044)), 600.0, 2.0);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 600.0, 5.0);
  axis.must(0x6042, 0, 0);
  EXPECT_NEAR(axis.ms_until([&] { return rpm() == 0.0; }), 400.0, 0.6);
  axis.must(0x6042, 0, 600);
  axis.run_ms(500);
  axis.control(0x02);  // quick stop by 604Ah
  EXPECT_NEAR(axis.ms_until([&] { return rpm() == 0.0; }), 100.0, 0.6);
}

// A change of only one ramp parameter acts on the present motion.
TEST_F(Vl, RampsMayChangeUnderWay) {
  axis.must(0x6042, 0, 1500);
  axis.run_ms(500);  // 750 rpm
  axis.must(0x6048, 1, 3000);
  EXPECT_NEAR(axis.ms_until([&] { return std::abs(rpm() - 1500.0) < 1e-6; }), 250.0, 1.1);
  axis.must(0x6042, 0, 0);
  axis.run_ms(500);  // 750 rpm again
  axis.must(0x6049, 1, 6000);
  EXPECT_NEAR(axis.ms_until([&] { return rpm() == 0.0; }), 250.0, 1.1);
}

TEST_F(Vl, AmountsLimitBothDirections) {  // 6046h
  axis.must(0x6046, 1, 100);
  axis.must(0x6046, 2, 1000);
  const auto settle = [&](std::int64_t target) {
    axis.must(0x6042, 0, target);
    axis.run_ms(1500);
    return static_cast<double>(axis.get(0x6043));
  };
  EXPECT_EQ(settle(30), 100.0);
  EXPECT_EQ(axis.status() & limited, limited);
  EXPECT_EQ(settle(2000), 1000.0);
  EXPECT_EQ(settle(500), 500.0);
  EXPECT_EQ(axis.status() & limited, 0);
  EXPECT_EQ(settle(-2000), -1000.0);
  EXPECT_EQ(settle(-30), -100.0);
  EXPECT_EQ(settle(0), 0.0);
}

TEST_F(Vl, FactorsMultiply) {  // 604Bh, 604Ch: a dimension factor of 60 makes the unit revolutions per second
  axis.must(0x604B, 1, 1);
  axis.must(0x604B, 2, 2);
  axis.must(0x6042, 0, 600);
  axis.run_ms(1000);
  EXPECT_NEAR(rpm(), 300.0, 1e-6);
  EXPECT_EQ(axis.get(0x6043), 600);
  axis.must(0x604B, 2, 1);
  axis.must(0x604C, 1, 60);
  axis.must(0x6042, 0, 10);
  axis.run_ms(1000);
  EXPECT_NEAR(rpm(), 600.0, 1e-6);
  EXPECT_EQ(axis.get(0x6043), 10);
}

TEST_F(Vl, ControlwordOfTheRampGenerator) {
  axis.must(0x6042, 0, 600);
  axis.run_ms(200);
  axis.control(0x5F);  // locked: the output does not change
  const double held = rpm();
  EXPECT_NEAR(held, 300.0, 5.0);
  axis.run_ms(200);
  EXPECT_NEAR(rpm(), held, 1e-6);
  axis.control(0x7F);
  axis.run_ms(300);
  EXPECT_NEAR(rpm(), 600.0, 1e-6);
  axis.control(0x3F);  // input zero
  EXPECT_NEAR(axis.ms_until([&] { return rpm() == 0.0; }), 400.0, 0.6);
  axis.control(0x7F);
  axis.run_ms(500);
  axis.control(0x6F);  // ramp not enabled
  axis.run_ms(500);
  EXPECT_EQ(rpm(), 0.0);
}

// --- Torque

TEST(ProfileTorque, LinearSlope) {
  Reference axis(4);
  axis.must(0x6087, 0, 1000);
  axis.plant.lock_rotor(true);
  ASSERT_TRUE(axis.enable());
  axis.must(0x6071, 0, 500);
  for (int ms = 50; ms <= 450; ms += 50) {
    axis.run_ms(50);
    EXPECT_NEAR(static_cast<double>(axis.get(0x6074)), ms, 2.0);
    EXPECT_NEAR(static_cast<double>(axis.get(0x6077)), ms, 3.0);
    EXPECT_EQ(axis.status() & reached, 0);
  }
  axis.run_ms(51);
  EXPECT_EQ(axis.get(0x6074), 500);
  EXPECT_EQ(axis.status() & reached, reached);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.5 * 1.27, 0.01);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6078)), 500.0, 8.0);
  axis.must(0x6071, 0, -500);
  axis.run_ms(500);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6074)), 0.0, 2.0);
}

TEST(ProfileTorque, Sin2SlopeIsSteepestAtItsMiddle) {
  Reference axis(4);
  axis.must(0x6087, 0, 1000);
  axis.must(0x6088, 0, 1);
  axis.plant.lock_rotor(true);
  ASSERT_TRUE(axis.enable());
  axis.must(0x6071, 0, 500);
  double before = 0.0;
  double steepest = 0.0;
  const std::int64_t begin = axis.ticks();
  while ((axis.status() & reached) == 0 || axis.ticks() - begin < 16) {
    ASSERT_LT(axis.ticks() - begin, 16000 * 2);
    axis.run_ms(10);
    const double now = static_cast<double>(axis.get(0x6074));
    EXPECT_GE(now, before - 0.5);
    steepest = std::max(steepest, now - before);
    before = now;
  }
  EXPECT_NEAR(steepest, 10.0, 1.1);  // 1000 a second
  EXPECT_NEAR(static_cast<double>(axis.ticks() - begin) / 16.0, 500.0 * 1.5708, 12.0);
}

TEST(ProfileTorque, HaltStopsTheAxisByItsDecelerationSlope) {  // ch. 3.4, 605Dh
  Servo free(4);
  free.must(0x6087, 0, 1000);
  free.must(0x6071, 0, 40);
  ASSERT_TRUE(free.enable());
  free.ms_until([&] { return free.plant.velocity_rpm() > 500.0; });
  free.control(0x10F);
  free.run_ms(1);
  const double rest = free.plant.velocity_rpm() * counts_per_rpm / 1310720.0 * 1000.0;
  EXPECT_NEAR(free.ms_until([&] { return (free.status() & reached) != 0; }), rest, 0.05 * rest);
  free.run_ms(20);
  EXPECT_NEAR(free.plant.velocity_rpm(), 0.0, 1.0);
}

TEST(ProfileTorque, OfTheIsmcWithoutASlopeIsAStepAndItsSpeedIsLimited) {  // G23, 2115h, 2116h
  Servo axis(4);
  axis.must(0x2115, 0, 200);
  axis.must(0x2116, 0, 100);
  ASSERT_TRUE(axis.enable());
  axis.must(0x6071, 0, 300);
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6074), 300);
  double most = 0.0;
  for (int i = 0; i < 1000; ++i) {
    axis.run_ms(0.5);
    most = std::max(most, axis.plant.velocity_rpm());
  }
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.2 * 3000.0, 12.0);
  EXPECT_LT(most, 0.2 * 3000.0 * 1.1);
  EXPECT_EQ(axis.status() & limited, limited);
  axis.must(0x6071, 0, -300);
  axis.run_ms(500);
  EXPECT_NEAR(axis.plant.velocity_rpm(), -0.1 * 3000.0, 6.0);
  // 0 is a limit as well: the axis does not turn in this direction.
  axis.must(0x2115, 0, 0);
  axis.must(0x6071, 0, 500);
  axis.run_ms(500);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 1.0);
  axis.must(0x2116, 0, 0);
  axis.must(0x6071, 0, -500);
  axis.run_ms(500);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 1.0);
}

TEST(TorqueLimits, HoldInBothDirections) {  // 60E0h, 60E1h, 6072h
  Reference axis(3);
  axis.must(0x60E0, 0, 400);
  axis.must(0x60E1, 0, 250);
  axis.plant.lock_rotor(true);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60FF, 0, 500000);
  axis.run_ms(600);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6077)), 400.0, 4.0);
  EXPECT_EQ(axis.status() & limited, limited);
  axis.must(0x60FF, 0, -500000);
  axis.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6077)), -250.0, 4.0);
  axis.must(0x6072, 0, 100);
  axis.run_ms(10);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6077)), -100.0, 3.0);
  EXPECT_NEAR(axis.plant.torque_nm(), -0.127, 0.004);
}

TEST(TorqueLimits, AreTheUsersWithPolarity) {
  Reference axis(3);
  axis.must(0x607E, 0, 0x40);
  axis.must(0x60E0, 0, 400);
  axis.must(0x60E1, 0, 250);
  axis.plant.lock_rotor(true);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60FF, 0, 500000);
  axis.run_ms(600);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6077)), 400.0, 4.0);
  EXPECT_NEAR(axis.plant.torque_nm(), -0.4 * 1.27, 0.01);
}

TEST(ProfileTorque, EnteredWithPolarityGoesOnWithTheTorqueThatIs) {
  Reference axis(3);
  axis.must(0x607E, 0, 0x40);
  axis.must(0x6087, 0, 100);
  ASSERT_TRUE(axis.enable());
  axis.plant.set_external_torque_nm(0.5);
  axis.run_ms(500);
  const double torque = axis.plant.torque_nm();
  EXPECT_NEAR(torque, 0.5, 0.03);
  axis.must(0x6071, 0, -400);
  axis.must(0x6060, 0, 4);
  axis.run_ms(2);
  EXPECT_NEAR(axis.plant.torque_nm(), torque, 0.02);
}

// --- Cyclic modes: offsets

TEST(CyclicOffsets, AddUp) {  // 60B0h, 60B1h, 60B2h
  Reference position(8);
  ASSERT_TRUE(position.enable());
  position.must(0x60B0, 0, 1500);
  position.must(0x607A, 0, 1000);
  position.send(0x80, {});
  position.run_ms(200);  // 2500 counts at once are too far: the axis catches up
  EXPECT_EQ(position.get(0x6062), 2500);
  position.must(0x60B0, 0, -300);
  position.send(0x80, {});
  position.run_ms(500);
  EXPECT_EQ(position.get(0x6062), 700);
  EXPECT_NEAR(static_cast<double>(position.get(0x6064)), 700.0, 1.0);

  Reference velocity(9);
  ASSERT_TRUE(velocity.enable());
  velocity.must(0x60B1, 0, -50000);
  velocity.must(0x60FF, 0, 250000);
  velocity.run_ms(300);
  EXPECT_NEAR(velocity.velocity(), 200000.0, 2000.0);
  EXPECT_EQ(velocity.status() & 0x1000, 0x1000);

  Reference torque(10);
  torque.plant.lock_rotor(true);
  ASSERT_TRUE(torque.enable());
  torque.must(0x60B2, 0, -100);
  torque.must(0x6071, 0, 300);
  torque.run_ms(50);
  EXPECT_NEAR(static_cast<double>(torque.get(0x6077)), 200.0, 3.0);

  // In velocity mode, the torque offset acts in the user's direction of 607Eh bit 6.
  for (const int polarity : {0x00, 0x40}) {
    Reference added(9);
    added.must(0x607E, 0, polarity);
    ASSERT_TRUE(added.enable());
    added.must(0x60B2, 0, 150);
    added.run_ms(1);
    EXPECT_FLOAT_EQ(added.device.drive().axis().demand.torque, polarity == 0 ? 0.15F : -0.15F);
  }
}

// Targets in a synchronous RPDO, one per SYNC: in every cycle the demand is on the straight line between the last two,
// on the target one period after its SYNC, and never beyond the last one.
TEST(CyclicPosition, SynchronousTargetsOfOneToFourMilliseconds) {
  for (const int period_ms : {1, 2, 3, 4}) {
    SCOPED_TRACE(period_ms);
    Servo axis(8);
    axis.must(0x60C2, 1, period_ms);
    axis.must(0x1400, 2, 1);
    axis.send(0, {1, 0});
    ASSERT_TRUE(axis.enable());
    const auto send_target = [&axis](std::int64_t value) {
      std::vector<std::uint8_t> data{0x0F, 0x00, 0x08};
      for (int i = 0; i < 4; ++i) data.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
      axis.send(0x201, data);
      axis.send(0x80, {});
    };
    const std::int64_t final = 100000;
    std::int64_t from = 0;
    for (int i = 1; i <= 100; ++i) {
      // A smooth motion of 100 periods.
      const double x = i / 100.0;
      const std::int64_t to = std::llround(static_cast<double>(final) * x * x * (3.0 - 2.0 * x));
      send_target(to);
      for (int part = 1; part <= 2 * period_ms; ++part) {
        axis.run_ms(0.5);
        const double line = static_cast<double>(from) + static_cast<double>(to - from) * part / (2.0 * period_ms);
        ASSERT_NEAR(static_cast<double>(axis.get(0x60FC)), line, part == 2 * period_ms ? 0.0 : 0.51)
            << i << "." << part;
      }
      from = to;
    }
    for (int i = 0; i < 100; ++i) {
      send_target(final);
      axis.run_ms(period_ms);
      EXPECT_EQ(axis.get(0x60FC), final);
    }
    axis.run_ms(1000);  // time for the last counts; friction may keep two of them (drive/loops/rest.hpp)
    EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), static_cast<double>(final), 2.0);
    EXPECT_EQ(axis.status() & (limited | 0x106F), 0x1027);
  }
}

TEST(CyclicPositionOfTheIsmc, IsNotDisturbedByItsOtherPdos) {
  // Targets every 4 ms by asynchronous PDO, with target velocity and SYNC in between: the line stays straight.
  Servo axis(8);
  axis.must(0x60C2, 1, 4);
  axis.send(0, {1, 0});
  ASSERT_TRUE(axis.enable());
  const auto bytes = [](std::int64_t value) {
    std::vector<std::uint8_t> data{0x0F, 0x00, 0x08};
    for (int i = 0; i < 4; ++i) data.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    return data;
  };
  std::int64_t target = 0;
  for (int i = 0; i < 300; ++i) {
    target += std::min(i, 100) * 4;
    axis.send(0x201, bytes(target));
    for (int part = 0; part < 8; ++part) {
      axis.run_ms(0.5);
      if (part == 2) axis.send(0x301, {0, 0, 0, 0, 0, 0, 0, 0});
      if (part == 5) axis.send(0x80, {});
      if (i > 110) {
        EXPECT_NEAR(axis.demand_velocity(), 100000.0, 1.0) << i << "." << part;
      }
    }
  }
}

// --- Limits of the travel

plant::Parameters with_limit_switches() {
  plant::Parameters parameters = test::default_plant();
  parameters.switches[0] = {.wire = 0, .from_counts = 100000};
  parameters.switches[1] = {.wire = 1, .to_counts = -100000};
  parameters.switch_count = 2;
  return parameters;
}

void wire_limit_switches(Reference& axis) {
  axis.must(0x2030, 1, static_cast<std::int64_t>(Signal::positive_limit));
  axis.must(0x2030, 2, static_cast<std::int64_t>(Signal::negative_limit));
}

TEST(LimitSwitches, EndEveryVelocityMotionTowardsThem) {
  for (const std::int8_t mode : {std::int8_t{2}, std::int8_t{3}, std::int8_t{9}}) {
    SCOPED_TRACE(int{mode});
    Reference axis(mode, with_limit_switches());
    wire_limit_switches(axis);
    ASSERT_TRUE(axis.enable());
    axis.control(0x7F);
    axis.must(0x60FF, 0, 400000);
    axis.must(0x6042, 0, 183);
    axis.ms_until([&] { return axis.device.drive().axis().active(Signal::positive_limit); });
    axis.run_ms(300);
    const std::int64_t stopped = axis.plant.position_counts();
    EXPECT_GT(stopped, 100000);
    EXPECT_LT(stopped, 120000);
    EXPECT_EQ(axis.status() & limited, limited);
    axis.run_ms(500);
    EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped), 50.0);
    axis.must(0x60FF, 0, 300000);
    axis.must(0x6042, 0, 150);
    axis.run_ms(300);
    EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped), 50.0);
    axis.must(0x60FF, 0, -400000);
    axis.must(0x6042, 0, -183);
    axis.run_ms(200);
    EXPECT_LT(axis.plant.position_counts(), stopped - 1000);
  }
}

TEST(LimitSwitches, CyclicTargetsBeyondThemDoNotCreepIn) {
  Reference axis(8, with_limit_switches());
  wire_limit_switches(axis);
  ASSERT_TRUE(axis.enable());
  std::int64_t target = 0;
  double velocity = 0.0;
  for (int i = 0; i < 2000; ++i) {
    velocity = std::min(velocity + 1000.0, 400000.0);
    target += std::lround(velocity * 0.001);
    axis.must(0x607A, 0, target);
    axis.send(0x80, {});
    axis.run_ms(1);
  }
  EXPECT_GT(target, 600000);
  EXPECT_LT(axis.plant.position_counts(), 120000);
  const std::int64_t stopped = axis.plant.position_counts();
  for (int i = 0; i < 500; ++i) {
    axis.must(0x607A, 0, ++target);
    axis.send(0x80, {});
    axis.run_ms(1);
  }
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped), 2.0);
  axis.must(0x607A, 0, stopped - 5000);
  axis.send(0x80, {});
  axis.run_ms(300);  // with the profile's ramps, not in one cycle
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped - 5000), 2.0);
}

TEST(LimitSwitches, QuickStopDuringTheirStopIsOneThatStays) {
  Reference axis(9, with_limit_switches());
  wire_limit_switches(axis);
  axis.must(0x605A, 0, 6);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60FF, 0, 400000);
  axis.ms_until([&] { return axis.device.drive().axis().active(Signal::positive_limit); });
  axis.run_ms(5);
  EXPECT_GT(axis.plant.velocity_rpm(), 50.0);
  axis.control(0x02);
  axis.run_ms(200);
  EXPECT_EQ(axis.status() & 0x6F, 0x07);
  axis.must(0x60FF, 0, -400000);  // away from the switch, but there is no motion in Quick stop active
  axis.run_ms(200);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 0.1);
  EXPECT_EQ(axis.status() & 0x6F, 0x07);
}

TEST(LimitSwitches, TorqueDoesNotPushBeyondThem) {
  Reference axis(4, with_limit_switches());
  wire_limit_switches(axis);
  axis.must(0x6087, 0, 10000);
  ASSERT_TRUE(axis.enable());
  axis.must(0x6071, 0, 30);
  axis.ms_until([&] { return axis.device.drive().axis().active(Signal::positive_limit); });
  axis.run_ms(500);
  const std::int64_t stopped = axis.plant.position_counts();
  axis.run_ms(500);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped), 2000.0);
  axis.must(0x6071, 0, -30);
  axis.run_ms(300);
  EXPECT_LT(axis.plant.position_counts(), stopped - 2000);
}

// The limiter of the speed brakes with the torque limit, and has nothing left over at the end: the shaft does not run
// back.
TEST(LimitSwitches, TorqueBrakesAtThemAndDoesNotTurnRound) {
  for (const std::int8_t mode : {std::int8_t{4}, std::int8_t{10}}) {
    for (const int direction : {1, -1}) {
      for (const int brakes : {50, 300, 1000}) {
        SCOPED_TRACE(testing::Message() << "mode " << int{mode} << ", direction " << direction << ", " << brakes);
        Reference axis(mode, with_limit_switches());
        wire_limit_switches(axis);
        axis.must(0x6087, 0, 100000);
        axis.must(direction > 0 ? 0x60E1 : 0x60E0, 0, brakes);
        ASSERT_TRUE(axis.enable());
        axis.must(0x6071, 0, direction * 300);
        const Signal limit = direction > 0 ? Signal::positive_limit : Signal::negative_limit;
        axis.ms_until([&] { return axis.device.drive().axis().active(limit); });
        const auto speed = [&] { return direction * axis.velocity(); };
        EXPECT_GT(speed(), 300.0 * counts_per_rpm);
        double least = speed();
        for (int ms = 0; ms < 1000; ++ms) {
          axis.run_ms(1);
          least = std::min(least, speed());
        }
        EXPECT_GT(least, -20.0 * counts_per_rpm);
        EXPECT_NEAR(speed(), 0.0, 20.0 * counts_per_rpm);
      }
    }
  }
}

TEST(SoftwareLimits, HoldInEveryModeOfTheReferenceDrive) {  // 607Dh: also of the actual position
  for (const std::int8_t mode : {std::int8_t{2}, std::int8_t{3}, std::int8_t{4}, std::int8_t{9}, std::int8_t{10}}) {
    SCOPED_TRACE(int{mode});
    Reference axis(mode);
    axis.must(0x607D, 1, -100000);
    axis.must(0x607D, 2, 200000);
    axis.must(0x6087, 0, 10000);
    ASSERT_TRUE(axis.enable());
    axis.control(0x7F);
    for (const int sign : {1, -1}) {
      axis.must(0x60FF, 0, sign * 400000);
      axis.must(0x6042, 0, sign * 183);
      axis.must(0x6071, 0, sign * 30);
      axis.run_ms(3000);
      const double limit = sign > 0 ? 200000.0 : -100000.0;
      EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), limit, 3000.0);
      EXPECT_LT(std::abs(axis.plant.velocity_rpm()), 2.0);
      EXPECT_EQ(axis.status() & limited, limited);
    }
  }
}

// --- Probes and terminals

TEST(TouchProbe, LatchesExactCounts) {  // 60B8h to 60BDh
  plant::Parameters parameters = test::default_plant();
  parameters.switches[0] = {.wire = 3, .from_counts = 50123, .to_counts = 60456};
  parameters.switch_count = 1;
  parameters.encoder.index_position_counts = 7001;
  Reference axis(3, parameters);
  axis.must(0x2030, 4, static_cast<std::int64_t>(Signal::probe_1));
  ASSERT_TRUE(axis.enable());
  axis.must(0x60B8, 0, 0x1531);  // probe 1: input, both edges, first event; probe 2: index, rising edge
  EXPECT_EQ(axis.get(0x60B9), 0x0101);
  axis.must(0x60FF, 0, 777777);
  axis.run_ms(1000);
  EXPECT_EQ(axis.get(0x60B9), 0x0307);
  EXPECT_EQ(axis.get(0x60BA), 50123);
  EXPECT_EQ(axis.get(0x60BB), 60457);  // the first count at which the switch is off again
  EXPECT_EQ(axis.get(0x60BC), 7001);
  axis.must(0x60B8, 0, 0);
  EXPECT_EQ(axis.get(0x60B9), 0);
}

TEST(TouchProbe, OfTheIsmcIsTheRisingEdgeOfZ) {  // ch. 4.8.1, G29
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.index_position_counts = 4242;
  Servo axis(3, parameters);
  ASSERT_TRUE(axis.enable());
  axis.must(0x60B8, 0, 0x15);
  axis.must(0x60FF, 0, 200000);
  axis.run_ms(500);
  EXPECT_EQ(axis.get(0x60B9), 0x43);
  EXPECT_EQ(axis.get(0x60BA), 4242);
  axis.must(0x60B8, 0, 0);
  axis.must(0x60B8, 0, 0x31);  // DI: accepted, never latches
  axis.plant.force_input(3, true);
  axis.run_ms(2);
  axis.plant.force_input(3, false);
  axis.run_ms(2);
  EXPECT_EQ(axis.get(0x60B9), 0x01);
}

TEST(Terminals, OfTheIsmc) {  // ch. 4.8.2.1 and 4.8.2.2
  Servo axis(0);
  axis.run_ms(1);
  for (int wire = 0; wire < 6; ++wire) {
    axis.plant.force_input(wire, true);
    axis.run_ms(1);
    EXPECT_EQ(axis.get(0x60FD) & 0x3F, 1 << wire);
    axis.plant.force_input(wire, false);
  }
  axis.must(0x60FE, 1, 0xFFFFFFFF);
  axis.run_ms(1);
  EXPECT_EQ(axis.actuation.outputs, 0U) << "nothing is driven until the mask is written";
  axis.must(0x60FE, 2, 0x000B0000);
  axis.run_ms(1);
  EXPECT_EQ(axis.actuation.outputs, 0xBU);
  axis.must(0x2F13, 0, 0x9);  // DO1 has another function
  axis.run_ms(1);
  EXPECT_EQ(axis.actuation.outputs, 0x9U);
  axis.must(0x60FE, 1, 0x00010000);
  axis.run_ms(1);
  EXPECT_EQ(axis.actuation.outputs, 0x1U);
}

TEST(Terminals, OfTheReferenceDrive) {  // CiA 402-2 60FDh, 60FEh
  Reference axis(0);
  axis.must(0x2030, 3, static_cast<std::int64_t>(Signal::negative_limit));
  axis.must(0x2030, 4, static_cast<std::int64_t>(Signal::home));
  axis.run_ms(1);
  axis.plant.force_input(2, true);
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x60FD) & 0x00FF000F, 0x00040001);
  axis.plant.force_input(3, true);
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x60FD) & 0x00FF000F, 0x000C0005);
  axis.must(0x2031, 0, 0x08);  // inverts input 3: the signal, not the level of the wire
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x60FD) & 0x00FF000F, 0x000C0001);
  axis.must(0x60FE, 2, 0x000F0000);
  axis.must(0x60FE, 1, 0x00050000);
  axis.run_ms(1);
  EXPECT_EQ(axis.actuation.outputs, 0x5U);
}

}  // namespace
}  // namespace modes_test
}  // namespace servodrome
