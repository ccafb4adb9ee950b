#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"

// Units, modes and windows of the iSMK, compared with the manual's figures and closed-form results.
namespace servodrome {
namespace ismk_motion_test {
namespace {

using drive::Counts;
using products::ismk::acceleration_dec_from_rps_s;
using products::ismk::rpm_from_velocity_dec;
using products::ismk::velocity_dec_from_rpm;
using test::IsmkRig;

constexpr double rest = 65.0;  // counts: friction holds the shaft up to a third of a degree away
constexpr std::uint16_t target_reached = 0x0400;
constexpr std::uint16_t position_limit = 0x0800;
constexpr std::uint16_t bit_12 = 0x1000;

double rpm(IsmkRig& rig) { return rig.device.drive().axis().velocity() * 60.0 / 65536.0; }
Counts position(IsmkRig& rig) { return rig.device.drive().axis().position(); }

struct Enabled : IsmkRig {
  explicit Enabled(int mode, const plant::Parameters& parameters = test::ismk_plant())
      : IsmkRig(parameters, test::ismk_settings()) {
    run_ms(5);
    set(0x6060, 0, mode);
    control(0x2F);
    run_ms(2);
    EXPECT_EQ(status() & 0xFF, 0x37);
  }
  void profile(double speed_rpm, double ramp_rps_s) {
    set(0x6081, 0, std::llround(velocity_dec_from_rpm(speed_rpm)));
    set(0x6083, 0, std::llround(acceleration_dec_from_rps_s(ramp_rps_s)));
    set(0x6084, 0, std::llround(acceleration_dec_from_rps_s(ramp_rps_s)));
  }
  // Starts a move and returns the time for which the demand moved.
  double move_ms(std::int64_t target, std::uint16_t start = 0x3F) {
    set(0x607A, 0, target);
    control(static_cast<std::uint16_t>(start & ~0x10));
    control(start);
    run_ms(1.5);
    const std::int64_t ticks = run_until([this] { return !device.drive().in_motion(); }, 60000.0);
    EXPECT_GE(ticks, 0);
    return static_cast<double>(ticks) / 16.0 + 1.5;
  }
};

// --- Units (ch. 7.2, Tables 8-1 and 8-3, appendix II)

TEST(IsmkUnits, PrintedExamplesAreExactWithRoundToNearest) {
  struct {
    double rpm;
    std::int64_t dec;
  } const speeds[]{{100, 0x001B4E82}, {150, 0x0028F5C3}, {200, 0x00369D03}, {-100, -1789570},
                   {300, 5368709},    {5000, 89478485},  {10, 178957},      {3000, 53687091}};
  for (const auto& [speed, dec] : speeds) {
    // 10 rpm is 178956.97: the default of 60F9h sub 0Ah was truncated (ch. 7.5).
    EXPECT_EQ(std::llround(velocity_dec_from_rpm(speed)), dec) << speed;
    EXPECT_NEAR(rpm_from_velocity_dec(static_cast<double>(dec)), speed, 1e-4);
  }
  EXPECT_EQ(static_cast<std::uint32_t>(-1789570), 0xFFE4B17Eu);
  EXPECT_EQ(std::llround(acceleration_dec_from_rps_s(100.0)), 107374);
  EXPECT_EQ(std::llround(acceleration_dec_from_rps_s(50.0)), 53687);
  EXPECT_EQ(std::llround(acceleration_dec_from_rps_s(610.0)), 654983);
  // Derived: velocity is 16.384 DEC per inc/s, acceleration is velocity DEC per millisecond.
  EXPECT_DOUBLE_EQ(velocity_dec_from_rpm(60.0), 65536.0 * 16.384);
  EXPECT_DOUBLE_EQ(acceleration_dec_from_rps_s(1.0), velocity_dec_from_rpm(60.0) / 1000.0);
}

// The peak current is 2048 in every rating; 1 Arms of the rating with 48 Ap is 60.33 (appendix II).
// Ch. 1.3.1: peak and continuous current, rated and greatest torque, rotor inertia in kgcm2.
struct Plate {
  const char* model;
  double peak_a, continuous_a_rms, rated_nm, peak_nm, inertia_kgcm2;
};
constexpr auto plates = std::to_array<Plate>({
    {"40-010", 18.0, 4.0, 0.32, 0.96, 0.044},
    {"60-020", 24.0, 7.0, 0.64, 1.92, 0.17},
    {"60-040", 48.0, 12.0, 1.27, 3.81, 0.31},
    {"80-075", 100.0, 23.0, 2.39, 7.17, 0.85},
});

TEST(IsmkUnits, CurrentOfEveryRating) {
  ASSERT_EQ(products::ismk::ratings.size(), plates.size());
  for (const Plate& plate : plates) {
    IsmkRig rig(plate.model);
    const products::Model& model = rig.device.rating();
    ASSERT_EQ(model.name, plate.model);
    EXPECT_NEAR(static_cast<double>(model.motor.peak_current_a), plate.peak_a, 1e-5);
    EXPECT_NEAR(static_cast<double>(model.stage_rated_current_a), plate.continuous_a_rms * std::sqrt(2.0), 1e-4);
    EXPECT_NEAR(static_cast<double>(model.motor.rated_torque_nm), plate.rated_nm, 1e-6);
    EXPECT_NEAR(static_cast<double>(model.motor.torque_constant_nm_per_a), plate.peak_nm / plate.peak_a, 1e-6);
    EXPECT_NEAR(static_cast<double>(model.motor.inertia_kgm2), plate.inertia_kgcm2 * 1e-4, 1e-10);
    EXPECT_EQ(model.motor.rated_speed_rpm, 3000.0F);       // ch. 1.3.1
    EXPECT_EQ(model.motor.counts_per_revolution, 65536U);  // Table 8-2
    rig.run_ms(5);
    const drive::MotorData& motor = rig.device.drive().configuration().motor;
    const double peak_dec =
        static_cast<double>(motor.peak_current_a / motor.rated_current_a) / rig.device.drive().axis().units.current;
    EXPECT_NEAR(peak_dec, 2048.0, 1e-2) << model.name;
    EXPECT_EQ(rig.get(0x6510, 3), std::llround(plate.peak_a));
    EXPECT_EQ(rig.get(0x6410, 3), 65536);
    rig.set(0x6060, 0, 4);
    rig.plant.lock_rotor(true);
    rig.set(0x60F6, 8, 512);
    rig.control(0x0F);
    rig.run_ms(50);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6078)), 512.0, 8.0) << model.name;
    EXPECT_NEAR(static_cast<double>(rig.device.drive().loops().current_q_a), plate.peak_a / 4.0, 0.02 * plate.peak_a);
    // 6073h in the same unit.
    rig.set(0x6073, 0, 256);
    rig.run_ms(50);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6078)), 256.0, 8.0) << model.name;
  }
  EXPECT_NEAR(2048.0 / (48.0 / 1.414), 60.33, 0.005);
}

// --- Position mode

// 50000 inc at 200 rpm with 100 rps/s: 33.3 ms up, 195.6 ms constant, 33.3 ms down, then the window.
TEST(IsmkPosition, TheExampleTakes262Milliseconds) {
  Enabled rig(1);
  rig.profile(200, 100);
  const double moving = rig.move_ms(50000);
  EXPECT_NEAR(moving, 262.2, 1.5);
  const std::int64_t reached = rig.run_until([&] { return (rig.status() & target_reached) != 0; }, 200.0);
  const double window = static_cast<double>(reached) / 16.0;
  std::printf("50000 inc at 200 rpm, 100 rps/s: %.1f ms, reached %.1f ms later\n", moving, window);
  EXPECT_GE(window, 9.0) << "2508h sub 9 is 10 ms (ch. 7.5)";
  EXPECT_LT(window, 40.0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 50000.0, rest);
  EXPECT_EQ(rig.status() & ~0x0200, 0x5437) << "the start bit is still set: bit 12 (C6)";
  rig.control(0x2F);
  rig.run_ms(2);
  EXPECT_EQ(rig.status() & ~0x0200, 0x4437);
}

// 6081h is 0 after power-on: the axis does not move until it is set (ch. 7.3).
TEST(IsmkPosition, NoSpeedNoMotion) {
  Enabled rig(1);
  rig.set(0x607A, 0, 50000);
  rig.control(0x3F);
  rig.run_ms(100);
  EXPECT_NEAR(static_cast<double>(position(rig)), 0.0, 2.0);
}

TEST(IsmkPosition, AbsoluteAndRelative) {
  Enabled rig(1);
  rig.profile(3000, 500);
  rig.move_ms(100000);
  rig.move_ms(100000);  // the same target: the axis is already there
  rig.run_ms(50);
  EXPECT_NEAR(static_cast<double>(position(rig)), 100000.0, rest);
  rig.move_ms(-30000, 0x5F);
  rig.run_ms(50);
  EXPECT_NEAR(static_cast<double>(position(rig)), 70000.0, rest);
}

// Table 5-4: bit 5 replaces the present move, without it the target waits; a third target is not accepted (bit 12).
TEST(IsmkPosition, ImmediateAndQueued) {
  Enabled rig(1);
  rig.profile(600, 200);
  const auto give = [&rig](std::int64_t target, std::uint16_t word) {
    rig.set(0x607A, 0, target);
    rig.control(static_cast<std::uint16_t>(word & ~0x10));
    rig.control(word);
    rig.run_ms(5);
  };
  give(500000, 0x1F);
  give(-200000, 0x1F);
  EXPECT_NE(rig.status() & bit_12, 0);
  rig.control(0x0F);
  rig.run_ms(5);
  EXPECT_NE(rig.status() & bit_12, 0) << "no room";
  give(300000, 0x1F);
  Counts farthest = 0;
  rig.run_until(
      [&] {
        farthest = std::max(farthest, position(rig));
        return (rig.status() & target_reached) != 0;
      },
      5000);
  EXPECT_NEAR(static_cast<double>(farthest), 500000.0, 200.0);
  EXPECT_NEAR(static_cast<double>(position(rig)), -200000.0, rest);
  give(500000, 0x3F);
  rig.run_ms(200);
  give(-300000, 0x3F);
  farthest = 0;
  rig.run_until(
      [&] {
        farthest = std::max(farthest, position(rig));
        return (rig.status() & target_reached) != 0;
      },
      5000);
  EXPECT_LT(farthest, 200000);
  EXPECT_NEAR(static_cast<double>(position(rig)), -300000.0, rest);
}

// 103Fh: the axis follows every write of the target without another edge (Table 5-4).
TEST(IsmkPosition, TrackingFollowsEveryWrite) {
  Enabled rig(1);
  rig.profile(3000, 500);
  rig.control(0x103F);
  for (const std::int64_t target : {40000, -25000, 90000}) {
    rig.set(0x607A, 0, target);
    rig.run_ms(400);
    EXPECT_NEAR(static_cast<double>(position(rig)), static_cast<double>(target), 10.0);
    EXPECT_NE(rig.status() & target_reached, 0);
  }
  // Without bit 12 a write alone does nothing.
  rig.control(0x3F);
  rig.set(0x607A, 0, 0);
  rig.run_ms(300);
  EXPECT_NEAR(static_cast<double>(position(rig)), 90000.0, 10.0);
}

// 60FBh sub 4 (ch. 6.2.2): the same peak acceleration with soft corners makes the ramps longer by pi/2, without a delay
// at the start, and only in mode 1.
TEST(IsmkPosition, SCurve) {
  Enabled rig(1);
  rig.profile(600, 100);
  const double trapezoid = rig.move_ms(655360);
  EXPECT_NEAR(trapezoid, 1100.0, 3.0);
  EXPECT_EQ(rig.set(0x60FB, 4, 2), dictionary::AbortCode::value_invalid);
  rig.set(0x60FB, 4, 3);
  const double s_curve = rig.move_ms(0);
  EXPECT_NEAR(s_curve, 1000.0 + 100.0 * 1.5708, 3.0);
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(600)));
  rig.set(0x6060, 0, 3);
  rig.run_ms(50);
  EXPECT_NEAR(rpm(rig), 300.0, 20.0) << "mode 3 ramps on a straight line";
}

// 60FBh sub 5: a moving average over N milliseconds delays by half of them, and ends N - 1 later (ch. 6.2.2).
TEST(IsmkPosition, SmoothingFilter) {
  const auto settles_after = [](int smoothing_ms, double& at_half_way) {
    Enabled rig(1);
    rig.control(0x06);
    rig.run_ms(2);
    EXPECT_EQ(rig.set(0x60FB, 5, smoothing_ms), dictionary::AbortCode::none);
    rig.control(0x2F);
    rig.run_ms(2);
    EXPECT_EQ(rig.set(0x60FB, 5, 7), dictionary::AbortCode::device_state);  // ch. 7.8
    rig.profile(600, 100);
    rig.set(0x607A, 0, 655360);
    rig.control(0x3F);
    rig.run_ms(550);
    at_half_way = static_cast<double>(position(rig));
    const auto arrived = [&] { return rig.device.drive().axis().demand.position == 655360; };
    return static_cast<double>(rig.run_until(arrived, 2000)) / 16.0;
  };
  double plain_place = 0.0;
  double smooth_place = 0.0;
  const double plain = settles_after(1, plain_place);
  const double smooth = settles_after(101, smooth_place);
  EXPECT_NEAR(plain_place - smooth_place, 655.36 * 50.0, 700.0) << "50 ms late at 655.36 inc/ms";
  EXPECT_NEAR(smooth - plain, 100.0, 1.5);
}

TEST(IsmkPosition, FollowingErrorIsAFaultAndBit13) {
  Enabled rig(1);
  rig.profile(3000, 500);
  rig.set(0x6065, 0, 1000);
  rig.plant.lock_rotor(true);
  rig.set(0x607A, 0, 100000);
  rig.control(0x3F);
  rig.run_ms(100);
  EXPECT_EQ(rig.status() & 0x20FF, 0x2038);
  EXPECT_EQ(rig.get(0x603F), 0x8611);
  EXPECT_EQ(rig.sent.back().data[0] | rig.sent.back().data[1] << 8, 0x8611);
}

// --- Speed modes

TEST(IsmkSpeed, RampsInMode3) {
  Enabled rig(3);
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(600)));
  rig.run_ms(50);
  EXPECT_NEAR(rpm(rig), 300.0, 15.0);
  EXPECT_EQ(rig.status() & (target_reached | bit_12), 0);
  rig.run_ms(70);
  EXPECT_NEAR(rpm(rig), 600.0, 5.0);
  EXPECT_NE(rig.status() & target_reached, 0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), velocity_dec_from_rpm(600), velocity_dec_from_rpm(5));
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F9, 0x1A)), 655.0, 6.0);
  EXPECT_LT(std::abs(rig.get(0x60F9, 0x1C)), 178956);
  rig.set(0x60FF, 0, 0);
  rig.run_ms(120);
  EXPECT_NE(rig.status() & bit_12, 0) << "speed is zero (ch. 5.2.1.3)";
}

// Bit 10 compares 60FFh minus the actual speed (60F9h sub 1Ch, ch. 5.2.1.2) with 60F9h sub 0Ah, regardless of a ramp in
// progress and of the limit 607Fh.
TEST(IsmkSpeed, ReachedIsTheSpeedErrorInMode3) {
  Enabled rig(3);
  const auto error_inside = [&] { return std::abs(rig.get(0x60F9, 0x1C)) < rig.get(0x60F9, 0x0A); };
  const auto shown = [&] { return (rig.status() & target_reached) != 0; };
  rig.set(0x6083, 0, 10737);  // a tenth
  int disagree = 0;
  for (const double target : {90.0, 600.0, -300.0}) {
    rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(target)));
    for (int ms = 0; ms < 1500; ++ms) {
      rig.run_ms(1);
      const double off = std::abs(std::abs(static_cast<double>(rig.get(0x60F9, 0x1C))) - 178956.0);
      if (off > velocity_dec_from_rpm(5) && shown() != error_inside()) ++disagree;
    }
    EXPECT_TRUE(shown()) << target;
  }
  EXPECT_EQ(disagree, 0);
  // 60FFh of 900 rpm; 607Fh limits it to 600 rpm.
  rig.set(0x607F, 0, std::llround(velocity_dec_from_rpm(600)));
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(900)));
  rig.run_ms(3000);
  EXPECT_NEAR(rpm(rig), 600.0, 10.0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F9, 0x1C)), velocity_dec_from_rpm(300), velocity_dec_from_rpm(10));
  EXPECT_FALSE(shown());
}

// "The actual speed will immediately reach the target speed" (Table 5-6, 6060h): as fast as the current limit allows.
TEST(IsmkSpeed, Mode3NegativeHasNoRamps) {
  Enabled rig(-3);
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(-600)));
  const std::int64_t ticks = rig.run_until([&] { return rpm(rig) < -595.0; }, 100.0);
  ASSERT_GE(ticks, 0);
  EXPECT_LT(static_cast<double>(ticks) / 16.0, 25.0);
  rig.run_ms(50);
  EXPECT_NEAR(rpm(rig), -600.0, 5.0);
  EXPECT_NE(rig.status() & target_reached, 0);
  EXPECT_EQ(rig.status() & bit_12, 0);
}

// 60F9h sub 0Ah against the target of 60FFh, 2010h sub 18h for 60F9h sub 14h (ch. 5.2.1.2 and 5.2.1.3).
TEST(IsmkSpeed, ReachedAndZeroByTheirWindows) {
  Enabled rig(-3);
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(100)));
  rig.run_ms(100);
  EXPECT_NE(rig.status() & target_reached, 0);
  rig.plant.lock_rotor(true);
  rig.run_ms(20);
  EXPECT_EQ(rig.status() & target_reached, 0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F9, 0x1C)), velocity_dec_from_rpm(100), 2000.0);
  rig.set(0x60F9, 0x0A, std::llround(velocity_dec_from_rpm(101)));
  rig.run_ms(2);
  EXPECT_NE(rig.status() & target_reached, 0);
  EXPECT_NE(rig.status() & bit_12, 0);

  // The time of the zero speed window.
  Enabled timed(-3);
  timed.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(100)));
  timed.set(0x60F9, 0x14, 80);
  timed.run_ms(200);
  timed.set(0x60FF, 0, 0);
  timed.run_until([&] { return std::abs(rpm(timed)) < 2.0; }, 200.0);
  timed.run_ms(60);
  EXPECT_EQ(timed.status() & bit_12, 0);
  timed.run_ms(40);
  EXPECT_NE(timed.status() & bit_12, 0);
}

// 607Fh and 6080h (ch. 5.2.1.4).
TEST(IsmkSpeed, TheLimitOfSpeed) {
  for (const int mode : {3, -3}) {
    Enabled rig(mode);
    rig.set(0x6080, 0, 500);
    rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(2000)));
    rig.run_ms(400);
    EXPECT_NEAR(rpm(rig), 500.0, 5.0);
    EXPECT_EQ(rig.status() & position_limit, 0) << "bit 11 is of positions (Table 5-5)";
  }
}

// 607Eh inverts all directions, and is refused while enabled (ch. 5.2).
TEST(IsmkSpeed, InvertedDirection) {
  IsmkRig rig;
  rig.run_ms(5);
  EXPECT_EQ(rig.set(0x607E, 0, 1), dictionary::AbortCode::none);
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(300)));
  rig.control(0x0F);
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), -300.0, 5.0);
  EXPECT_GT(rig.get(0x606C), 0);
  EXPECT_GT(rig.get(0x6063), 0);
  EXPECT_GT(rig.get(0x60FC), 0);
  EXPECT_EQ(rig.set(0x607E, 0, 0), dictionary::AbortCode::device_state);
}

// --- Torque and pulse

TEST(IsmkTorque, PercentAndCurrentAreOneTarget) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.plant.lock_rotor(true);
  rig.set(0x6060, 0, 4);
  rig.set(0x6071, 0, 500);
  rig.control(0x0F);
  rig.run_ms(50);
  EXPECT_NEAR(static_cast<double>(rig.device.drive().axis().torque()), 0.5, 0.02);
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F5, 8)), 2048.0 / 6.0, 6.0);
  EXPECT_NEAR(rig.plant.torque_nm(), 0.5 * 1.27, 0.03);
}

TEST(IsmkTorque, SpeedIsLimitedBy607F) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x6060, 0, 4);
  rig.set(0x607F, 0, std::llround(velocity_dec_from_rpm(800)));
  rig.set(0x6071, 0, 300);
  rig.control(0x0F);
  rig.run_ms(500);
  EXPECT_NEAR(rpm(rig), 800.0, 40.0);
}

// With the low factory gains: full torque on a held shaft, and a speed hardly above the limit, up to a load of ten
// times the rotor's inertia.
TEST(IsmkTorque, SpeedLimitNeitherThrottlesNorOvershoots) {
  constexpr double limit_rpm = 510.0;
  for (const double load_kgm2 : {0.0, test::ismk_plant().load.inertia_kgm2, 1.0e-4, 3.0e-4}) {
    SCOPED_TRACE(load_kgm2);
    plant::Parameters parameters = test::ismk_plant();
    parameters.load.inertia_kgm2 = load_kgm2;
    test::FactoryIsmkRig rig(parameters, test::ismk_settings());
    rig.run_ms(5);
    rig.set(0x6060, 0, 4);
    rig.set(0x607F, 0, std::llround(velocity_dec_from_rpm(limit_rpm)));
    rig.set(0x6071, 0, 900);
    rig.control(0x0F);
    double fastest_rpm = 0.0;
    for (int ms = 0; ms < 1000; ++ms) {
      rig.run_ms(1);
      fastest_rpm = std::max(fastest_rpm, rig.plant.velocity_rpm());
    }
    EXPECT_LT(fastest_rpm, 1.15 * limit_rpm);
    EXPECT_NEAR(rig.plant.velocity_rpm(), limit_rpm, 0.02 * limit_rpm);
    rig.plant.lock_rotor(true);
    rig.run_ms(5);
    EXPECT_GT(rig.device.drive().axis().torque(), 0.45F);
    rig.run_ms(200);
    EXPECT_NEAR(static_cast<double>(rig.device.drive().axis().torque()), 0.9, 0.01);
  }
}

// The position within a turn comes from the encoder (ch. 1.3.1).
TEST(IsmkPosition, StartsWithinTheTurnAfterPowerOn) {
  plant::Parameters parameters = test::ismk_plant();
  parameters.encoder.start_position_counts = 3 * 65536 + 3392;
  IsmkRig rig(parameters, test::ismk_settings());
  rig.run_ms(5);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 3392.0, 2.0);
}

// A set-point without speed also replaces the present move: the axis comes to rest.
TEST(IsmkPosition, ASetPointWithoutSpeedBreaksTheMoveOff) {
  Enabled rig(1);
  rig.profile(600, 100);
  rig.set(0x607A, 0, 10 * 65536);
  rig.control(0x2F);
  rig.control(0x3F);
  rig.run_ms(200);
  const Counts before = position(rig);
  rig.set(0x6081, 0, 0);
  rig.set(0x607A, 0, 8 * 65536);
  rig.control(0x2F);
  rig.control(0x3F);
  rig.run_ms(1000);
  EXPECT_FALSE(rig.device.drive().in_motion());
  EXPECT_LT(position(rig), before + 65536);
  EXPECT_EQ(rig.status() & target_reached, 0);
}

// Mode 7 without a lock to the SYNC: a 607Ah that is written during a halt does not move the axis at the end of the
// halt.
TEST(IsmkInterpolation, ATargetDuringAHaltDoesNotActAtItsEnd) {
  Enabled rig(7);
  rig.control(0x1F);
  rig.run_ms(2);
  rig.set(0x607A, 0, 100);
  rig.run_ms(200);
  ASSERT_NEAR(static_cast<double>(position(rig)), 100.0, rest);
  rig.control(0x11F);
  rig.run_ms(50);
  rig.set(0x607A, 0, 20000);
  rig.run_ms(50);
  rig.control(0x1F);
  rig.run_ms(300);
  EXPECT_NEAR(static_cast<double>(position(rig)), 100.0, rest);
  rig.set(0x607A, 0, 20000);
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(position(rig)), 20000.0, rest);
}

// --- Step stop (Table 5-18)

// A load displaces a shaft that a direct current holds by asin(load / greatest torque), electrically, and no controller
// corrects this. With the position loop the shaft returns.
TEST(IsmkStepStop, HoldsAtTheTargetAsAStepperDoes) {
  for (const bool step_stop : {true, false}) {
    plant::Parameters parameters = test::ismk_plant();
    parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.0;
    parameters.load.viscous_friction_nms = 0.01;
    Enabled rig(1, parameters);
    const drive::MotorData& motor = rig.device.drive().configuration().motor;
    rig.set(0x2340, 1, step_stop ? 1 : 0);
    rig.set(0x2340, 2, 400);
    rig.profile(600, 100);
    rig.move_ms(65536);
    rig.run_ms(100);
    ASSERT_TRUE((rig.status() & target_reached) != 0);
    ASSERT_NEAR(static_cast<double>(position(rig)), 65536.0, 20.0);

    const double most = 400.0 / 2048.0 * static_cast<double>(motor.peak_current_a * motor.torque_constant_nm_per_a);
    rig.plant.set_external_torque_nm(0.5 * most);
    rig.run_ms(500);
    const double turned = static_cast<double>(65536 - position(rig)) / 65536.0 * motor.pole_pairs * 360.0;
    if (step_stop) {
      EXPECT_NEAR(std::abs(turned), 30.0, 0.5) << "electrical degrees: asin 0.5";
      EXPECT_NEAR(static_cast<double>(rig.device.drive().loops().following_error_counts),
                  static_cast<double>(65536 - position(rig)), 2.0)
          << "60F4h shows what a load turned the shaft by";
    } else {
      EXPECT_NEAR(turned, 0.0, 0.5);
    }
    rig.plant.set_external_torque_nm(0.0);
    rig.run_ms(500);
    EXPECT_NEAR(static_cast<double>(position(rig)), 65536.0, 20.0) << "the direction of the current stood still";
    rig.move_ms(0);
    rig.run_ms(100);
    EXPECT_NEAR(static_cast<double>(position(rig)), 0.0, 20.0);
  }
}

// Mode -4 of a drive without pulse inputs: enabled, without motion (C2).
TEST(IsmkPulse, StandsWhateverTheTargets) {
  Enabled rig(-4);
  rig.set(0x60FF, 0, 17895697);
  rig.set(0x607A, 0, 100000);
  rig.set(0x6081, 0, 17895697);
  rig.control(0x3F);
  rig.run_ms(200);
  EXPECT_NEAR(static_cast<double>(position(rig)), 0.0, 2.0);
  EXPECT_EQ(rig.status() & 0xFF, 0x37);
}

}  // namespace
}  // namespace ismk_motion_test
}  // namespace servodrome
