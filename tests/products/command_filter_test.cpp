#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"

// The command filter (60FBh sub 5 of the iSMK, P03-16 of the JMC) delays the demand but causes no motion itself: there
// is no jump where the filter is left in motion, and limits and stops do not act later. The test measures the true
// shaft.
namespace servodrome {
namespace command_filter_test {
namespace {

using drive::PowerState;
using products::ismk::velocity_dec_from_rpm;

struct Speeds {
  double slowest = 1e9;
  double fastest = -1e9;
};
template <typename RigType>
Speeds speeds_within(RigType& rig, int milliseconds) {
  Speeds speeds;
  for (int i = 0; i < 16 * milliseconds; ++i) {
    rig.tick();
    speeds.slowest = std::min(speeds.slowest, rig.plant.velocity_rpm());
    speeds.fastest = std::max(speeds.fastest, rig.plant.velocity_rpm());
  }
  return speeds;
}
template <typename RigType>
void expect_between(RigType& rig, int milliseconds, double slowest, double fastest) {
  const Speeds speeds = speeds_within(rig, milliseconds);
  EXPECT_GT(speeds.slowest, slowest);
  EXPECT_LT(speeds.fastest, fastest);
  EXPECT_EQ(rig.get(0x603F), 0);
}

// Ch. 6.2.2: "velocity and position commands to be delayed in the drive". Written before the motor is enabled (ch. 7.8,
// 60FB.05), in milliseconds; 1 is none.
struct Ismk : test::IsmkRig {
  static constexpr double counts_per_turn = 65536.0;
  static constexpr int limit_wire = 0;
  static constexpr bool limit_level = false;

  Ismk(std::int64_t filter, std::int64_t mode, double rpm) {
    set(0x60FB, 5, filter);
    set(0x6060, 0, mode);
    set(0x605A, 0, 2);
    set(0x6081, 0, std::llround(velocity_dec_from_rpm(rpm)));
    plant.force_input(limit_wire, !limit_level);
    set(0x2010, 3, 0x0010);  // DIN1: positive limit, normally closed (ch. 5.6.1)
    EXPECT_TRUE(enable());
    if (mode == 3) {
      set(0x60FF, 0, std::llround(velocity_dec_from_rpm(rpm)));
    } else {
      far_target();
    }
    run_ms(1200);
    EXPECT_NEAR(plant.velocity_rpm(), rpm, 0.01 * rpm);
  }
  void far_target() {
    set(0x607A, 0, 65536 * 1000);
    control(0x0F);
    control(0x1F);
    run_ms(5);
  }
};

// Ch. 8.2.4, P03-16: "time constant of the position command smoothing filter", 0.1 ms; 0 is none. 600 rpm.
struct Jmc : test::JmcRig {
  static constexpr double counts_per_turn = 4000.0;
  static constexpr int limit_wire = 0;
  static constexpr bool limit_level = true;

  Jmc(std::int64_t filter, std::int64_t mode, double = 600.0) {
    open_limits();
    set_panel(3, 16, filter);
    set(0x6065, 0, 0xFFFFFFFF);
    set(0x6060, 0, mode);
    set(0x605A, 0, 2);
    set(0x6081, 0, 40000);
    EXPECT_TRUE(enable());
    if (mode == 8) {
      double target = 0.0;
      for (int i = 0; i < 1500; ++i) {
        target += std::min(40.0, 0.2 * i);
        set(0x607A, 0, std::llround(target));
        run_ms(1);
      }
      return;
    }
    if (mode == 3) {
      set(0x60FF, 0, 40000);
    } else {
      far_target();
    }
    run_ms(500 + static_cast<double>(filter) * 0.4);
    EXPECT_NEAR(plant.velocity_rpm(), 600.0, 15.0);
  }
  void far_target() {
    set(0x607A, 0, 4'000'000);
    control(0x0F);
    control(0x1F);
    run_ms(5);
  }
};

TEST(CommandFilter, IsmkModeChangesInMotion) {
  for (const int filter : {30, 255}) {
    for (const int mode : {7, 6, -4}) {
      SCOPED_TRACE(::testing::Message() << filter << " ms, mode " << mode);
      Ismk rig(filter, 1, 1500.0);
      rig.set(0x6060, 0, mode);
      expect_between(rig, 1000, -15.0, 1545.0);
      EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
    }
  }
}
TEST(CommandFilter, JmcModeChangesInMotion) {
  for (const int filter : {500, 2000}) {
    for (const int from : {1, 8}) {
      SCOPED_TRACE(::testing::Message() << 0.1 * filter << " ms, from mode " << from);
      Jmc rig(filter, from);
      rig.set(0x6060, 0, 6);
      expect_between(rig, 600, -15.0, 618.0);
      EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
    }
  }
}

// Table 65, P03-16: "Running & set"; the demand stops before the new filter begins.
TEST(CommandFilter, JmcWrittenToZeroInMotion) {
  for (const int filter : {1000, 5000}) {
    SCOPED_TRACE(filter);
    Jmc rig(filter, 1);
    ASSERT_EQ(rig.set_panel(3, 16, 0), dictionary::AbortCode::none);
    expect_between(rig, 500, 570.0, 618.0);
    EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  }
}

TEST(CommandFilter, FromProfileVelocityToProfilePosition) {
  const auto change = [](auto& rig) {
    rig.set(0x6060, 0, 1);
    rig.far_target();
    expect_between(rig, 600, 570.0, 630.0);
  };
  for (const int filter : {1, 255}) {
    SCOPED_TRACE(filter);
    Ismk rig(filter, 3, 600.0);
    change(rig);
  }
  for (const int filter : {0, 500, 2000}) {
    SCOPED_TRACE(filter);
    Jmc rig(filter, 3);
    change(rig);
  }
}

// With this command filter, homed where it stands: software limits need homing.
void home_here(test::IsmkRig& rig, int filter) {
  rig.set(0x60FB, 5, filter);
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 35);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(50);
  rig.control(0x0F);
}

// Ch. 5.6.1: "When the actual position reaches the set software limit position, the motor stops." Sub 1 is the positive
// one, and limits need homing.
TEST(CommandFilter, IsmkRestsAtItsSoftwareLimit) {
  for (const int filter : {1, 50, 255}) {
    SCOPED_TRACE(filter);
    test::IsmkRig rig;
    ASSERT_NO_FATAL_FAILURE(home_here(rig, filter));
    rig.set(0x607D, 1, 65536 * 20);
    rig.set(0x607D, 2, -65536 * 20);
    rig.set(0x6060, 0, 3);
    rig.run_ms(20);
    rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(1500)));
    std::int64_t furthest = 0;
    for (int i = 0; i < 2500; ++i) {
      rig.run_ms(1);
      furthest = std::max(furthest, rig.plant.position_counts());
    }
    EXPECT_LT(static_cast<double>(furthest) / 65536.0, 20.05);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()) / 65536.0, 20.0, 0.05);
  }
}

// Turns from the command of a stop to its end. `word` 0: the limit switch (Table 5-16, 6085h; JMC, ch. 3.1.2).
template <typename RigType>
double way_of(std::int64_t filter, std::uint16_t word, double rpm) {
  RigType rig(filter, 1, rpm);
  const std::int64_t from = rig.plant.position_counts();
  if (word == 0) {
    rig.plant.force_input(RigType::limit_wire, RigType::limit_level);
  } else {
    rig.control(word);
  }
  double before = rig.plant.velocity_rpm();
  for (int i = 0; i < 25; ++i) {
    const double fastest = speeds_within(rig, 100).fastest;
    EXPECT_LT(fastest, std::max(before, 0.0) + 0.05 * rpm) << i;
    before = rig.plant.velocity_rpm();
  }
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  return static_cast<double>(rig.plant.position_counts() - from) / RigType::counts_per_turn;
}
template <typename RigType>
void stops_no_later(std::int64_t none, std::initializer_list<std::int64_t> filters, double rpm) {
  for (const std::uint16_t word : std::to_array<std::uint16_t>({0, 0x02, 0x10F})) {
    const double plain = way_of<RigType>(none, word, rpm);
    for (const std::int64_t filter : filters) {
      EXPECT_LT(way_of<RigType>(filter, word, rpm), plain + 0.05) << "filter " << filter << ", word " << word;
    }
  }
}
TEST(CommandFilter, IsmkStopsNoLater) { stops_no_later<Ismk>(1, {50, 255}, 1500.0); }
TEST(CommandFilter, JmcStopsNoLater) { stops_no_later<Jmc>(0, {500, 2000, 10000}, 600.0); }

// A software limit set in motion, where the shaft can still stop but the demand of the generator is beyond.
TEST(CommandFilter, IsmkStopsBeforeASoftwareLimitSetInMotion) {
  for (const int filter : {50, 255}) {
    SCOPED_TRACE(filter);
    test::IsmkRig rig;
    ASSERT_NO_FATAL_FAILURE(home_here(rig, filter));
    rig.set(0x6060, 0, 1);
    rig.set(0x6081, 0, std::llround(velocity_dec_from_rpm(1500)));
    rig.set(0x607A, 0, 65536 * 100);
    rig.run_ms(5);
    rig.control(0x1F);
    rig.run_ms(1500);
    const drive::Axis& axis = rig.device.drive().axis();
    const double stop = axis.velocity() * axis.velocity() / (2.0 * axis.quick_stop_ramp());
    ASSERT_GT(axis.velocity(), 24.0 * 65536.0);
    const auto limit = axis.position() + std::llround(stop + 0.3 * 65536.0);
    rig.set(0x607D, 1, limit);
    rig.set(0x607D, 2, -65536 * 20);
    std::int64_t furthest = 0;
    for (int i = 0; i < 2500; ++i) {
      rig.run_ms(1);
      furthest = std::max(furthest, axis.position());
    }
    EXPECT_LT(static_cast<double>(furthest - limit) / 65536.0, 0.02);
    EXPECT_GT(static_cast<double>(furthest - limit) / 65536.0, -1.0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
    EXPECT_EQ(rig.get(0x603F), 0);
  }
}

// A set-point that leads back inside is followed, whether it comes before the axis brakes for a limit set in motion,
// while it brakes, or at rest, as without the filter.
TEST(CommandFilter, IsmkFollowsASetPointBackFromASoftwareLimitSetInMotion) {
  for (const int mode : {1, 3}) {
    for (const int filter : {1, 50, 255}) {
      for (const int after_ms : {0, 20, 60, 100, 150, 200, 300, 2000}) {
        SCOPED_TRACE(::testing::Message() << "mode " << mode << ", " << filter << " ms, after " << after_ms << " ms");
        test::IsmkRig rig;
        ASSERT_NO_FATAL_FAILURE(home_here(rig, filter));
        rig.set(0x6060, 0, mode);
        const std::int64_t speed = std::llround(velocity_dec_from_rpm(1500));
        rig.set(0x6081, 0, speed);
        for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084})) rig.set(ramp, 0, rig.get(0x6085) / 4);
        rig.set(0x607A, 0, 65536 * 100);
        rig.run_ms(5);
        rig.control(0x1F);
        rig.set(0x60FF, 0, mode == 3 ? speed : 0);
        rig.run_ms(2000);
        const drive::Axis& axis = rig.device.drive().axis();
        ASSERT_GT(axis.velocity(), 24.0 * 65536.0);
        const double stop = axis.velocity() * axis.velocity() / (2.0 * axis.quick_stop_ramp());
        const auto limit = axis.position() + std::llround(stop + 65536.0);
        const std::int64_t back = axis.position() - 65536 * 5;
        rig.set(0x607D, 1, limit);
        rig.set(0x607D, 2, -65536 * 100);
        std::int64_t furthest = 0;
        const auto run = [&](int milliseconds) {
          for (int i = 0; i < milliseconds; ++i) rig.run_ms(1), furthest = std::max(furthest, axis.position());
        };
        run(after_ms);
        rig.control(0x0F);
        rig.set(0x607A, 0, back);
        rig.control(0x3F);
        rig.set(0x60FF, 0, mode == 3 ? -speed : 0);
        run(3000);
        EXPECT_LT(static_cast<double>(furthest - limit) / 65536.0, 0.02);
        if (mode == 1) {
          EXPECT_NEAR(static_cast<double>(axis.position()), static_cast<double>(back), 200.0);
          EXPECT_NE(rig.status() & 0x0400, 0);
        } else {
          EXPECT_LT(axis.velocity(), -20.0 * 65536.0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace command_filter_test
}  // namespace servodrome
