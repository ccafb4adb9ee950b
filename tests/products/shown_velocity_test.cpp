#include <cmath>
#include <deque>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// The velocity that a drive shows, 606Ch, compared with the true velocity of the shaft: its noise, its delay, and the
// bits that depend on it.
namespace servodrome {
namespace shown_velocity_test {
namespace {

constexpr std::uint16_t reached = 0x0400;
constexpr std::uint16_t speed_zero = 0x1000;
constexpr std::array<std::uint16_t, 3> greatest_values{0x607F, 0x60C5, 0x60C6};
constexpr std::array<std::uint16_t, 2> ramps{0x6083, 0x6084};

// As documented in the README of the product: the difference of two means over `lag_ms` each.
template <typename RigType>
class Watched {
 public:
  Watched(const char* name, RigType& rig, double lag_ms) : name_(name), rig_(rig), lag_ms_(lag_ms) {
    const drive::Units& units = rig.device.drive().axis().units;
    turn_ = units.counts_per_revolution;
    must(0x6060, 3);
    for (const std::uint16_t greatest : greatest_values) rig.set(greatest, 0, 0x7FFFFFFF);
    ramp(20000.0);
    EXPECT_TRUE(rig.enable()) << name;
  }
  void must(std::uint16_t index, std::int64_t value) {
    EXPECT_EQ(rig_.set(index, 0, value), dictionary::AbortCode::none) << name_ << std::hex << index;
  }
  void ramp(double rpm_per_s) {
    const double unit = rig_.device.drive().axis().units.acceleration;
    for (const std::uint16_t object : ramps) must(object, std::lround(rpm_per_s / 60.0 * turn_ / unit));
  }
  double user(double rpm) { return rig_.device.drive().axis().units.velocity_to_user(rpm / 60.0 * turn_); }
  void run_at(double rpm) { must(0x60FF, std::lround(user(rpm))); }

  // The greatest deviation of 606Ch from its correct value over `milliseconds`, in user units.
  double noise(double milliseconds) {
    double worst = 0.0;
    turns_.clear();
    for (int i = 0; i < milliseconds * 16.0; ++i) {
      tick();
      const bool full = turns_.size() == ticks(2.0 * lag_ms_);
      if (full && i % 8 == 0) worst = std::max(worst, std::abs(static_cast<double>(rig_.get(0x606C)) - user(shown())));
    }
    return worst;
  }

 private:
  static std::size_t ticks(double ms) { return static_cast<std::size_t>(std::lround(ms * 16.0)); }
  void tick() {
    rig_.tick();
    turn_of_shaft_ += rig_.plant.velocity_rpm() / 60.0 * drive::tick_seconds;
    turns_.push_back(turn_of_shaft_);
    if (turns_.size() > ticks(2.0 * lag_ms_)) turns_.pop_front();
  }
  double shown() const {  // rpm
    const std::size_t half = turns_.size() / 2;
    double sum = 0.0;
    for (std::size_t i = 0; i < half; ++i) sum += turns_[half + i] - turns_[i];
    return sum / static_cast<double>(half) / (1e-3 * lag_ms_) * 60.0;
  }

  const char* name_;
  RigType& rig_;
  double lag_ms_;
  double turn_ = 0.0;
  double turn_of_shaft_ = 0.0;
  std::deque<double> turns_;
};

// At most 0.1 % of the rated speed or one user unit: at standstill, at creep speed, at speed, and on ramps, where a
// wrong delay would be visible.
template <typename RigType>
void expect_quiet(const char* name, RigType& rig, double lag_ms) {
  Watched<RigType> axis(name, rig, lag_ms);
  const double rated_rpm = static_cast<double>(rig.device.drive().configuration().motor.rated_speed_rpm);
  const double most = std::max(1.0, axis.user(0.001 * rated_rpm));
  for (const double rpm : {0.0, 0.2, 0.5, 1.0, 3.0, 10.0, 33.3, 100.0, 333.0, 1000.0, 0.95 * rated_rpm, -20.0, 0.0}) {
    SCOPED_TRACE(testing::Message() << name << " at " << rpm << " rpm");
    axis.run_at(rpm);
    rig.run_ms(300);
    EXPECT_LE(axis.noise(300), most + 0.5);  // an object has whole numbers
  }
  rig.run_ms(300);
  EXPECT_EQ(rig.get(0x606C), 0) << name;
  axis.ramp(2000.0);
  axis.run_at(800.0);
  EXPECT_LE(axis.noise(500), most + 0.5) << name << " on a ramp";
}

plant::Parameters plant_with(std::int32_t counts_per_revolution) {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.counts_per_revolution = counts_per_revolution;
  return parameters;
}

TEST(ShownVelocity, IsQuietAndAsLateAsStated) {
  {
    test::Rig<products::Ismc> rig;
    expect_quiet("ismc", rig, 4.0);
  }
  {
    test::Rig<products::Ismc> rig(plant_with(10000));
    expect_quiet("ismc, 10000", rig, 4.0);
  }
  {
    test::Rig<products::Generic402> rig;
    expect_quiet("generic402", rig, 4.0);
  }
  {
    test::Rig<products::Pronet> rig;
    expect_quiet("pronet", rig, 4.0);
  }
  {
    test::Rig<products::Pronet> rig(plant_with(10000));
    expect_quiet("pronet, 10000", rig, 12.0);
  }
  {
    test::FactoryIsmkRig rig;
    expect_quiet("ismk", rig, 4.0);
  }
  {
    test::IsmkRig rig;
    expect_quiet("ismk, stiff", rig, 4.0);
  }
  {
    test::FactoryJmcRig rig;
    rig.set_panel(8, 19, 0);
    rig.open_limits();
    expect_quiet("jmc_ec", rig, 5.0);
  }
}

// 6070h and 606Eh without a time: noise in a single cycle would be visible.
template <typename RigType>
struct Bits {
  unsigned always = 0xFFFF;
  unsigned ever = 0;
  Bits(RigType& rig, Watched<RigType>& axis, double rpm) {
    axis.run_at(rpm);
    rig.run_ms(400);
    for (int i = 0; i < 2000; ++i) {
      rig.run_ms(0.5);
      always &= rig.status();
      ever |= rig.status();
    }
  }
};

template <typename RigType>
void expect_right_bits(RigType& rig, std::int64_t window, std::int64_t threshold, double slow_rpm, double moving_rpm) {
  Watched<RigType> axis("bits", rig, 4.0);
  axis.must(0x606D, window);
  axis.must(0x606E, 0);
  axis.must(0x606F, threshold);
  axis.must(0x6070, 0);
  EXPECT_EQ(Bits(rig, axis, 0.0).always & (reached | speed_zero), reached | speed_zero);
  EXPECT_EQ(Bits(rig, axis, slow_rpm).always & (reached | speed_zero), reached | speed_zero);
  const Bits moving(rig, axis, moving_rpm);
  EXPECT_EQ(moving.always & reached, reached);
  EXPECT_EQ(moving.ever & speed_zero, 0U);
  const Bits back(rig, axis, -moving_rpm);
  EXPECT_EQ(back.always & reached, reached);
  EXPECT_EQ(back.ever & speed_zero, 0U);
  EXPECT_EQ(Bits(rig, axis, 0.0).always & (reached | speed_zero), reached | speed_zero);
}

TEST(ShownVelocity, BitsAreRightAtLowSpeed) {
  constexpr double counts_per_rpm = 131072.0 / 60.0;
  {
    test::Rig<products::Ismc> rig;
    expect_right_bits(rig, 200, 850, 700.0 / counts_per_rpm, 1000.0 / counts_per_rpm);
  }
  {
    test::Rig<products::Generic402> rig;
    expect_right_bits(rig, 200, 850, 700.0 / counts_per_rpm, 1000.0 / counts_per_rpm);
  }
  {  // 606Ch in 0.1 rpm
    test::Rig<products::Pronet> rig;
    expect_right_bits(rig, 2, 10, 0.7, 1.3);
  }
  {
    test::Rig<products::Pronet> rig(plant_with(10000));
    expect_right_bits(rig, 5, 20, 1.0, 3.0);
  }
}

TEST(ShownVelocity, ARampIsNoSlippage) {  // 60F8h: the delay of the shown value is not a lag of the axis
  test::Rig<products::Generic402> rig;
  Watched axis("slippage", rig, 4.0);
  axis.ramp(2000.0);
  axis.must(0x60F8, std::lround(axis.user(1.5)));
  axis.run_at(600.0);
  unsigned slips = 0;
  for (int i = 0; i < 800; ++i) {
    rig.run_ms(0.5);
    slips += (rig.status() & 0x2000) != 0;
  }
  EXPECT_LE(slips, 40U);  // caused by the controller, where the ramp begins
  rig.plant.set_external_torque_nm(5.0);
  rig.run_ms(50);
  EXPECT_NE(rig.status() & 0x2000, 0);
}

TEST(ShownVelocity, P0819SmoothsSpeedAndItsMonitor) {  // jmc_ec
  const auto spread = [](std::int64_t filter) {
    test::FactoryJmcRig rig;
    rig.set_panel(1, 3, 8);  // slow enough for the additional lag of the filter in the velocity loop
    rig.set_panel(8, 19, filter);
    rig.open_limits();
    Watched<test::FactoryJmcRig> axis("jmc_ec", rig, 5.0);
    axis.run_at(100.0);
    rig.run_ms(600);
    std::array<std::int64_t, 2> least{1 << 30, 1 << 30};
    std::array<std::int64_t, 2> most{-(1 << 30), -(1 << 30)};
    for (int i = 0; i < 1000; ++i) {
      rig.run_ms(0.5);
      const std::array<std::int64_t, 2> shown{rig.get(0x606C), rig.monitor(8)};
      for (std::size_t n = 0; n < 2; ++n) {
        least[n] = std::min(least[n], shown[n]);
        most[n] = std::max(most[n], shown[n]);
      }
    }
    return std::array{most[0] - least[0], most[1] - least[1]};
  };
  const auto quick = spread(0);
  const auto slow = spread(1000);
  EXPECT_LE(3 * slow[0], quick[0]);
  EXPECT_LE(quick[0], 150);
  EXPECT_LE(quick[1], 2);  // rpm
  EXPECT_EQ(slow[1], 0);
}

}  // namespace
}  // namespace shown_velocity_test
}  // namespace servodrome
