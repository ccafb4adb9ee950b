#include <gtest/gtest.h>

#include "jmc_bus.hpp"

// The modes of the JMC EC drives over process data, on a motor.
namespace servodrome {
namespace jmc_motion_test {
namespace {

using dictionary::AbortCode;
using drive::Cause;
using drive::PowerState;
using test::JmcBus;
using Out = JmcBus::Out;
using In = JmcBus::In;

constexpr double two_pi = 6.283185307179586;

// --- Cyclic synchronous position

// With and without SYNC0: a revolution back and forth as a sine; the axis follows without a step in speed.
void follow_sine(std::uint32_t sync0_ns, int cycles_per_turn) {
  JmcBus rig;
  rig.open_limits();
  rig.connect(sync0_ns);
  rig.enable_in(8);
  const double period_ms = rig.period_ms;
  const std::int32_t start = rig.position();
  double worst = 0.0;
  double last = 0.0;
  const double w = two_pi / cycles_per_turn;
  rig.run_cycles(2 * cycles_per_turn, period_ms, [&](int i) {
    const double wanted = 2000.0 * (1.0 - std::cos(w * i));
    rig.put<std::int32_t>(Out::position, start + static_cast<std::int32_t>(std::lround(wanted)));
    if (i > 10) {
      const double now = rig.device.drive().axis().generator.velocity();
      worst = std::max(worst, std::abs(now - last));
      last = now;
      EXPECT_TRUE(rig.bit(12));
      EXPECT_EQ(rig.state(), 0x27U);
      EXPECT_FALSE(rig.bit(13));
      EXPECT_FALSE(rig.bit(7));
    } else {
      last = rig.device.drive().axis().generator.velocity();
    }
  });
  // Targets are whole increments: the speed of a cycle has an error of up to one increment, its change of up to two.
  const double steepest = 2000.0 * w * w / (period_ms * 1e-3);
  EXPECT_LT(worst, steepest + 2.2 / (period_ms * 1e-3));
  rig.settle();
  EXPECT_NEAR(rig.position(), start, 2);
  EXPECT_TRUE(rig.bit(10)) << "at rest on its target (Table 222)";
}
TEST(JmcMotion, CyclicPositionFreeRun) { follow_sine(0, 500); }
TEST(JmcMotion, CyclicPositionWithSync0) { follow_sine(1'000'000, 500); }
// The period of SYNC0 is the time between targets, whatever the value of 60C2h.
TEST(JmcMotion, CyclicPositionWithSync0Of4Ms) { follow_sine(4'000'000, 200); }

// The manual's scaling: 4000 units are a revolution (routine for CoDeSys, 'Set homing parameter'), 607Ah + 60B0h is the
// demand (Table 234).
TEST(JmcMotion, CyclicPositionOffset) {
  JmcBus rig;
  rig.open_limits();
  rig.connect();
  rig.enable_in(8);
  for (int i = 1; i <= 200; ++i) {
    rig.set(0x60B0, 0, -i);
    rig.put<std::int32_t>(Out::position, 20 * i);
    rig.cycles(1);
  }
  rig.settle();
  EXPECT_NEAR(rig.position(), 3800, 2);
}

// Too fast: the axis continues at the greatest speed with a warning, and reaches the target (Table 233, D-16).
TEST(JmcMotion, CyclicPositionAboveTheGreatestSpeed) {
  JmcBus fast;
  fast.open_limits();
  fast.set(0x6080, 0, 600);  // 40000 units/s
  fast.connect();
  fast.enable_in(8);
  double greatest = 0.0;
  bool warned = false;
  fast.cycles(200, [&](int i) {
    fast.put<std::int32_t>(Out::position, 60 * i);
    greatest = std::max(greatest, fast.device.drive().axis().generator.velocity());
    warned |= fast.bit(7);
    EXPECT_EQ(fast.state(), 0x27U);
  });
  EXPECT_NEAR(greatest, 40000.0, 1.0);
  EXPECT_TRUE(warned);
  EXPECT_STREQ(fast.device.alarm().data(), "");
  fast.settle();
  EXPECT_NEAR(fast.position(), 60 * 199, 2);
  EXPECT_FALSE(fast.bit(7));
}

// 607Bh limits the change from target to target, after it has been written (D-15).
TEST(JmcMotion, PositionChangeLimitation) {
  JmcBus rig;
  rig.open_limits();
  rig.connect();
  rig.enable_in(8);
  rig.cycles(20, [&](int i) { rig.put<std::int32_t>(Out::position, 110 * (i + 1)); });
  EXPECT_FALSE(rig.bit(7)) << "not written yet";
  rig.settle();
  EXPECT_NEAR(rig.position(), 2200, 3);
  ASSERT_EQ(rig.download(0x607B, 2, 30, 4), AbortCode::none);
  bool warned = false;
  rig.cycles(40, [&](int i) {
    rig.put<std::int32_t>(Out::position, 2200 + 2000);
    warned |= rig.bit(7);
    EXPECT_LE(rig.position(), 2200 + 30 * (i + 1));
  });
  EXPECT_TRUE(warned);
  const drive::Axis& axis = rig.device.drive().axis();
  const auto demand = [&axis] { return static_cast<double>(axis.units.to_user(axis.generator.nearest_position())); };
  double before = demand();
  rig.cycles(10, [&](int) { rig.put<std::int32_t>(Out::position, 2200 + 2000); });
  EXPECT_NEAR(demand() - before, 10 * 30, 2.0) << "as far as it may";
  rig.settle();
  EXPECT_NEAR(rig.position(), 4200, 3) << "the rest follows";
  EXPECT_FALSE(rig.bit(7));
  rig.cycles(10, [&](int) { rig.put<std::int32_t>(Out::position, 1200); });
  before = demand();
  rig.cycles(10, [&](int) { rig.put<std::int32_t>(Out::position, 1200); });
  EXPECT_NEAR(demand() - before, -10 * 100, 2.0);
  rig.cycles(40, [&](int) { rig.put<std::int32_t>(Out::position, 1200); });
  rig.settle();
  EXPECT_NEAR(rig.position(), 1200, 3) << "at -100 each, the default of sub 1";
  ASSERT_EQ(rig.download(0x607B, 1, -50, 4), AbortCode::none);
  rig.cycles(10, [&](int) { rig.put<std::int32_t>(Out::position, 200); });
  before = demand();
  rig.cycles(5, [&](int) { rig.put<std::int32_t>(Out::position, 200); });
  EXPECT_NEAR(demand() - before, -5 * 50, 2.0) << "the other limit alone was changed";
}

// --- Cyclic synchronous velocity

TEST(JmcMotion, CyclicVelocity) {
  JmcBus rig;
  rig.open_limits();
  rig.connect();
  rig.enable_in(9);
  rig.put<std::int32_t>(Out::velocity, 40000);
  rig.cycles(300);
  EXPECT_NEAR(rig.velocity(), 40000, 600);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 600.0, 6.0) << "4000 units/s are 60 rpm";
  EXPECT_TRUE(rig.bit(10));
  EXPECT_TRUE(rig.bit(12));
  rig.set(0x60B1, 0, -20000);
  rig.cycles(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 6.0);
}

// Above 6080h: alarm and stop (Tables 242 and 35).
TEST(JmcMotion, CyclicVelocityAboveTheGreatestSpeed) {
  JmcBus rig;
  rig.open_limits();
  rig.set(0x6080, 0, 600);
  rig.connect();
  rig.enable_in(9);
  rig.put<std::int32_t>(Out::velocity, 40000);
  rig.cycles(200);
  EXPECT_EQ(rig.state(), 0x27U);
  rig.put<std::int32_t>(Out::velocity, 40001);
  rig.cycles(2);
  EXPECT_EQ(rig.state(), 0x0FU) << "stopping by 605Eh";
  rig.cycles(300);
  EXPECT_EQ(rig.state() & 0x4F, 0x08U);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  EXPECT_EQ(rig.input<std::uint16_t>(In::error), 0xA420);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.420");
}

// --- Profile position

struct ProfileRig : JmcBus {
  ProfileRig() {
    open_limits();
    set(0x6081, 0, 40000);
    connect();
    enable_in(1);
  }
  void start(std::int32_t target, std::uint16_t bits = 0x10) {
    put<std::int32_t>(Out::position, target);
    word(0x0F, 2);
    word(static_cast<std::uint16_t>(0x0F | bits), 2);
  }
  double demand() { return device.drive().axis().generator.velocity(); }
};

TEST(JmcMotion, ProfilePositionHandshake) {
  ProfileRig rig;
  EXPECT_TRUE(rig.bit(10));
  rig.start(4000);
  EXPECT_TRUE(rig.bit(12)) << "taken; no other until bit 4 is 0 again (Table 250)";
  EXPECT_FALSE(rig.bit(10));
  rig.word(0x0F, 2);
  EXPECT_FALSE(rig.bit(12));
  rig.cycles(400);
  EXPECT_TRUE(rig.bit(10));
  EXPECT_NEAR(rig.position(), 4000, 2);
  rig.start(-500, 0x50);  // relative to the last target
  rig.cycles(300);
  EXPECT_NEAR(rig.position(), 3500, 2);
  // Set-points are read at the edge (Table 248).
  rig.start(20000);
  rig.cycles(150);
  rig.set(0x6081, 0, 1000);
  rig.put<std::int32_t>(Out::position, 0);
  rig.cycles(50);
  EXPECT_NEAR(rig.demand(), 40000.0, 1.0);
  rig.cycles(500);
  EXPECT_NEAR(rig.position(), 20000, 2);
}

// The four combinations of bits 9 and 5 (PP 2): the speed at the first target.
TEST(JmcMotion, ProfilePositionSecondSetPoint) {
  for (const std::uint16_t bits : std::to_array<std::uint16_t>({0x000, 0x200, 0x220, 0x020})) {
    SCOPED_TRACE(bits);
    ProfileRig rig;
    rig.start(12000);
    rig.cycles(120);
    rig.set(0x6081, 0, 20000);
    rig.start(24000, static_cast<std::uint16_t>(0x10 | bits));
    const bool immediate = (bits & 0x20) != 0;
    if (!immediate) {
      EXPECT_TRUE(rig.bit(12)) << "one is waiting";
      // A third edge while one waits is ignored (D-39).
      rig.start(-90000, static_cast<std::uint16_t>(0x10 | bits));
    }
    rig.word(0x0F, 1);
    double at_first = -1.0;
    double greatest_between = 0.0;
    for (int i = 0; i < 3000 && rig.position() < 23990; ++i) {
      rig.cycles(1);
      const std::int32_t now = static_cast<std::int32_t>(rig.device.drive().axis().generator.nearest_position());
      if (at_first < 0.0 && now >= 12000) at_first = rig.demand();
      if (now > 7000 && now < 11000) greatest_between = std::max(greatest_between, rig.demand());
    }
    EXPECT_NEAR(rig.position(), 24000, 12);
    switch (bits) {
      case 0x000: EXPECT_LT(at_first, 1500.0) << "stops at the first target"; break;
      case 0x200: EXPECT_GT(at_first, 35000.0) << "passes it at speed 1"; break;
      default:
        EXPECT_NEAR(at_first, 20000.0, 1.0) << "switched at once";
        EXPECT_LT(greatest_between, 41000.0);
        break;
    }
    rig.cycles(200);
    EXPECT_NEAR(rig.position(), 24000, 2);
    EXPECT_TRUE(rig.bit(10));
  }
}

// "The motor will stop during two runs" (PP 2): the shaft must stop, not only the demand.
TEST(JmcMotion, ShaftStandsBetweenTwoSetPoints) {
  ProfileRig rig;
  rig.start(12000);
  rig.cycles(120);
  rig.start(24000);
  rig.word(0x0F, 1);
  int standing_ticks = 0;
  int longest = 0;
  while (rig.position() < 12500) {
    for (int tick = 0; tick < 16; ++tick) {
      rig.tick();
      standing_ticks = std::abs(rig.plant.velocity_rpm()) < 1.0 && rig.position() > 11900 ? standing_ticks + 1 : 0;
      longest = std::max(longest, standing_ticks);
    }
    rig.exchange();
  }
  EXPECT_GE(longest, 24) << "1.5 ms: two cycles of 1 ms without what the shaft takes to come to rest";
  rig.cycles(600);
  EXPECT_NEAR(rig.position(), 24000, 2);
  EXPECT_TRUE(rig.bit(10));
}

// A shaft that is kept in motion from outside does not block the waiting set-point forever.
TEST(JmcMotion, SetPointThatWaitsBeginsAfterTwoSeconds) {
  ProfileRig rig;
  rig.start(4000);
  rig.start(8000);
  rig.word(0x0F, 1);
  rig.cycles(80);
  // A load that makes the axis oscillate.
  int i = 0;
  const std::int64_t ticks = rig.run_bus_until(
      [&] {
        rig.plant.set_external_torque_nm(0.3 * std::sin(2.0 * 3.14159265 * 20.0 * i++ / 16000.0));
        return rig.device.drive().axis().generator.nearest_position() > 4100;
      },
      4000);
  EXPECT_GE(ticks, 0);
}

// 6082h is the starting speed of the motor, reached immediately (Table 255, D-20).
TEST(JmcMotion, ProfilePositionStartSpeed) {
  ProfileRig rig;
  rig.set(0x6082, 0, 8000);
  rig.put<std::int32_t>(Out::position, 12000);
  rig.word(0x0F, 2);
  rig.put<std::uint16_t>(Out::controlword, 0x1F);
  rig.exchange();
  rig.tick();
  std::vector<double> speeds;
  for (int i = 0; i < 64; ++i) {
    rig.tick();
    if (rig.demand() > 0.0) speeds.push_back(rig.demand());
  }
  ASSERT_FALSE(speeds.empty());
  EXPECT_NEAR(speeds.front(), 8000.0, 400000.0 * 0.0005 + 1.0);
  rig.cycles(500);
  EXPECT_NEAR(rig.position(), 12000, 2);
  // Never more than the distance allows, and none at the end.
  rig.start(12004);
  double greatest = 0.0;
  for (int i = 0; i < 100; ++i) {
    rig.cycles(1);
    greatest = std::max(greatest, rig.demand());
  }
  EXPECT_LT(greatest, std::sqrt(2.0 * 4.0 * 400000.0) + 1.0);
  rig.settle();
  EXPECT_NEAR(rig.position(), 12004, 2);
}

// 6081h above the smaller of 607Fh and 6080h: alarm, and the operation stops (Table 254).
TEST(JmcMotion, ProfilePositionAboveTheGreatestSpeed) {
  for (const bool by_motor : {false, true}) {
    ProfileRig rig;
    rig.set(by_motor ? 0x6080 : 0x607F, 0, by_motor ? 600 : 40000);
    rig.start(2000);
    rig.cycles(300);
    EXPECT_EQ(rig.state(), 0x27U);
    EXPECT_NEAR(rig.position(), 2000, 2);
    rig.set(0x6081, 0, 40001);
    rig.start(90000);
    rig.cycles(150);
    EXPECT_EQ(rig.state() & 0x4F, 0x08U);
    EXPECT_EQ(rig.input<std::uint16_t>(In::error), 0xA420);
    EXPECT_NEAR(rig.position(), 2000, 50);
  }
}

// The defaults: 14400 units/s is the limit; ramps of 0 mean 60C5h and 60C6h (D-19, D-34).
TEST(JmcMotion, ProfilePositionWithDefaults) {
  JmcBus rig;
  rig.connect();
  rig.enable_in(1);
  rig.put<std::int32_t>(Out::position, 4000);
  rig.word(0x1F, 2);
  const std::int64_t begin = rig.ticks();
  rig.run_bus_until([&] { return rig.device.drive().axis().generator.standing(); }, 5000.0);
  // 2400 units/s, ramps of 100000 units/s^2: 4000 / 2400 + 2400 / 100000 s.
  EXPECT_NEAR(static_cast<double>(rig.ticks() - begin) / 16.0, 1000.0 * (4000.0 / 2400.0 + 0.024), 4.0);
  rig.word(0x0F, 2);
  rig.set(0x6081, 0, 14400);
  rig.put<std::int32_t>(Out::position, 8000);
  rig.word(0x1F, 5);
  EXPECT_EQ(rig.state(), 0x27U);
  rig.cycles(600);
  rig.word(0x0F, 2);
  rig.set(0x6081, 0, 14401);
  rig.word(0x1F, 150);
  EXPECT_EQ(rig.state() & 0x4F, 0x08U);
}

// 6083h above 60C5h, 6084h above 60C6h: limited, with a warning as long as this lasts (Tables 256, 257 and 268).
TEST(JmcMotion, RampsAreClippedWithWarning) {
  for (const bool acceleration : {true, false}) {
    ProfileRig rig;
    rig.set(acceleration ? 0x60C5 : 0x60C6, 0, 200000);
    rig.set(acceleration ? 0x6083 : 0x6084, 0, 200001);
    rig.set(acceleration ? 0x6084 : 0x6083, 0, 200000);
    rig.start(20000);
    EXPECT_TRUE(rig.bit(7));
    EXPECT_EQ(rig.state(), 0x27U);
    rig.word(0x0F, 1);
    const std::int64_t begin = rig.ticks();
    rig.run_bus_until([&] { return rig.device.drive().axis().generator.standing(); }, 5000.0);
    EXPECT_NEAR(static_cast<double>(rig.ticks() - begin) / 16.0, 1000.0 * (20000.0 / 40000.0 + 40000.0 / 200000.0),
                6.0);
    rig.set(acceleration ? 0x6083 : 0x6084, 0, 200000);
    rig.cycles(3);
    EXPECT_FALSE(rig.bit(7));
  }
}

// --- Profile velocity

TEST(JmcMotion, ProfileVelocityAndHalt) {
  JmcBus rig;
  rig.open_limits();
  rig.connect();
  rig.put<std::int8_t>(Out::mode, 3);
  rig.word(0x06);
  rig.word(0x07, 110);
  rig.put<std::int32_t>(Out::velocity, 40000);
  rig.word(0x10F, 20);
  EXPECT_EQ(rig.status_in() & 0x016FU, 0x0127U) << "halted but enabled (PV 4)";
  EXPECT_FALSE(rig.bit(12)) << "executes nothing";
  EXPECT_TRUE(rig.bit(10)) << "speed 0 (Table 264)";
  EXPECT_EQ(rig.velocity(), 0);
  rig.word(0x0F, 300);
  EXPECT_EQ(rig.status_in() & 0x016FU, 0x0027U);
  EXPECT_NEAR(rig.velocity(), 40000, 600);
  EXPECT_TRUE(rig.bit(10));
  EXPECT_TRUE(rig.bit(12));
  rig.word(0x10F, 5);
  EXPECT_FALSE(rig.bit(10)) << "decelerates";
  rig.cycles(200);
  EXPECT_TRUE(rig.bit(10));
  // Changes act immediately (PV 2).
  rig.word(0x0F, 20);
  rig.put<std::int32_t>(Out::velocity, -20000);
  rig.cycles(400);
  EXPECT_NEAR(rig.velocity(), -20000, 600);
}

// Above the smaller of 607Fh and 6080h: it runs at the maximum, with a warning (Table 267).
TEST(JmcMotion, ProfileVelocityAboveTheGreatestSpeed) {
  for (const bool by_motor : {false, true}) {
    JmcBus rig;
    rig.open_limits();
    rig.set(by_motor ? 0x6080 : 0x607F, 0, by_motor ? 600 : 40000);
    rig.connect();
    rig.enable_in(3);
    rig.put<std::int32_t>(Out::velocity, 40000);
    rig.cycles(300);
    EXPECT_FALSE(rig.bit(7));
    rig.put<std::int32_t>(Out::velocity, 90000);
    rig.cycles(300);
    EXPECT_TRUE(rig.bit(7));
    EXPECT_EQ(rig.state(), 0x27U);
    EXPECT_NEAR(rig.velocity(), 40000, 600);
    rig.put<std::int32_t>(Out::velocity, 30000);
    rig.cycles(300);
    EXPECT_FALSE(rig.bit(7));
    EXPECT_NEAR(rig.velocity(), 30000, 600);
  }
}

// --- Torque

// Tenths of a percent of the rated torque; 6087h is the ramp in mode 4, mode 10 has no ramp (D-14, D-18).
TEST(JmcMotion, TorqueModes) {
  for (const std::int8_t mode : std::to_array<std::int8_t>({4, 10})) {
    SCOPED_TRACE(int{mode});
    JmcBus rig;
    rig.plant.lock_rotor(true);
    rig.set(0x6087, 0, 5000);
    rig.connect();
    rig.enable_in(mode);
    rig.put<std::int16_t>(Out::torque, 1000);
    rig.cycles(50);
    const auto half_way = rig.input<std::int16_t>(In::torque);
    if (mode == 4) {
      EXPECT_NEAR(half_way, 250, 30);
    } else {
      EXPECT_NEAR(half_way, 1000, 20);
    }
    rig.cycles(300);
    EXPECT_NEAR(rig.input<std::int16_t>(In::torque), 1000, 20);
    const double rated_nm = static_cast<double>(rig.device.rating().model.motor.rated_torque_nm);
    EXPECT_NEAR(rig.plant.torque_nm(), rated_nm, 0.03 * rated_nm);
    EXPECT_EQ(rig.bit(12), mode == 10);
    // 60B2h in mode 10; 6073h = 1200 and 6072h = 1500 by default.
    rig.set(0x60B2, 0, 150);
    rig.cycles(100);
    EXPECT_NEAR(rig.input<std::int16_t>(In::torque), mode == 10 ? 1150 : 1000, 20);
    rig.put<std::int16_t>(Out::torque, 2000);
    rig.cycles(300);
    EXPECT_NEAR(rig.input<std::int16_t>(In::torque), 1200, 20) << "6073h";
    rig.set(0x6073, 0, 3000);
    rig.cycles(300);
    EXPECT_NEAR(rig.input<std::int16_t>(In::torque), 1500, 20) << "6072h";
    rig.set(0x60E0, 0, 800);
    rig.cycles(100);
    EXPECT_NEAR(rig.input<std::int16_t>(In::torque), 800, 20) << "60E0h";
  }
}

// 6080h limits the speed in torque control.
TEST(JmcMotion, TorqueModeKeepsToTheGreatestSpeed) {
  JmcBus rig;
  rig.set(0x6080, 0, 300);
  rig.connect();
  rig.enable_in(10);
  rig.put<std::int16_t>(Out::torque, 300);
  rig.cycles(1500);
  EXPECT_EQ(rig.state(), 0x27U);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 15.0);
}

// --- Halt and mode 0

// Bit 8 works in every mode, also in the cyclic ones (Tables 221 and 237).
TEST(JmcMotion, HaltInEveryMode) {
  for (const std::int8_t mode : std::to_array<std::int8_t>({1, 3, 8, 9, 10})) {
    for (const int code : {1, 2, 3, 32767}) {
      SCOPED_TRACE(std::to_string(mode) + " 605Dh = " + std::to_string(code));
      JmcBus rig;
      rig.open_limits();
      rig.set(0x605D, 0, code);
      rig.set(0x6081, 0, 40000);
      rig.set(0x6080, 0, 600);
      rig.connect();
      rig.enable_in(mode);
      rig.put<std::int32_t>(Out::velocity, 40000);
      rig.put<std::int16_t>(Out::torque, 200);
      if (mode == 1) {
        rig.put<std::int32_t>(Out::position, 400000);
        rig.word(0x1F, 1);
      }
      const auto target = [&](int) {
        if (mode == 8) rig.put<std::int32_t>(Out::position, rig.input<std::int32_t>(In::position) + 30);
      };
      rig.cycles(400, target);
      ASSERT_GT(std::abs(rig.plant.velocity_rpm()), 80.0);
      const double before = std::abs(rig.device.drive().axis().velocity());
      rig.word(0x10F, 1);
      const std::int64_t begin = rig.ticks();
      ASSERT_GE(rig.run_bus_until([&] { return std::abs(rig.plant.velocity_rpm()) < 3.0; }, 1000.0), 0);
      const double seconds = static_cast<double>(rig.ticks() - begin) / 16000.0;
      const double deceleration = code == 1 ? 400000.0 : 800000.0;
      if (code <= 2 && mode != 10) {
        EXPECT_NEAR(seconds, before / deceleration, 0.25 * before / deceleration + 0.004);
      } else if (code > 2) {
        EXPECT_LT(seconds, 0.7 * before / 800000.0 + 0.01);
      }
      rig.cycles(100);
      EXPECT_EQ(rig.state(), 0x27U);
      EXPECT_TRUE(rig.bit(10)) << "at rest";
      EXPECT_EQ(rig.bit(8), mode == 3) << "in PV only (D-09)";
      rig.word(0x0F, 1);
      rig.cycles(300, target);
      EXPECT_GT(std::abs(rig.plant.velocity_rpm()), 80.0) << "goes on";
    }
  }
}

// A master leaves 6060h of the default PDO at 0 and selects the mode by SDO (README.md of the product, 6060h = 0).
TEST(JmcMotion, ModeZeroChangesNothing) {
  JmcBus rig;
  rig.open_limits();
  rig.to_pre_operational();
  ASSERT_EQ(rig.download(0x6060, 0, 8, 1), AbortCode::none);
  rig.to_safe_operational();
  ASSERT_EQ(rig.outputs.size(), 17U);
  ASSERT_EQ(rig.inputs.size(), 27U);
  rig.exchange();
  ASSERT_EQ(rig.request(8), rig.good(8));
  const auto word = [&rig](std::uint16_t value, int count) {
    rig.put<std::uint16_t>(0, value);
    rig.cycles(count);
  };
  word(0x06, 3);
  word(0x07, 110);
  word(0x0F, 3);
  rig.cycles(200, [&](int i) { rig.put<std::int32_t>(3, 10 * i); });
  rig.cycles(100);
  EXPECT_EQ(rig.get(0x6060), 0);
  EXPECT_EQ(rig.input<std::int8_t>(2), 8);
  EXPECT_NEAR(rig.input<std::int32_t>(3), 1990, 4);
}

}  // namespace
}  // namespace jmc_motion_test
}  // namespace servodrome
