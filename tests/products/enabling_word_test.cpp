#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Bit 4 in the controlword that enables, with a charged DC link: its edge counts from the previous word, in any state.
// dc_link_wait_test has the case that the drive waits for the link.
namespace servodrome {
namespace enabling_word_test {
namespace {

using drive::PowerState;

struct Generic402Axis : test::Rig<products::Generic402> {};
struct Generic402EcAxis : test::EthercatRig<products::Generic402Ec> {};
struct IsmcAxis : test::Rig<products::Ismc> {};
struct PronetAxis : test::Rig<products::Pronet> {};
struct IsmkAxis : test::FactoryIsmkRig {};
struct IsmkEaAxis : test::EthercatRig<products::IsmkEa> {
  IsmkEaAxis() : EthercatRig(test::ismk_plant(), test::ismk_settings()) {}
};
struct JmcAxis : test::FactoryJmcRig {};

// Sends the words one after the other, up to the one that enables. In between, the DC link charges, and a brake that
// opens in Switched on has opened.
template <typename Axis>
struct Enabled : Axis {
  Enabled(std::int64_t mode, const std::vector<std::uint16_t>& words) {
    this->set(0x6060, 0, mode);
    this->run_ms(2);
    const drive::Units& units = this->device.drive().axis().units;
    turn = units.counts_per_revolution;
    this->set(0x6081, 0, std::lround(units.velocity_to_user(2.0 * turn)));
    for (const std::uint16_t ramp : std::to_array<std::uint16_t>({0x6083, 0x6084}))
      this->set(ramp, 0, std::lround(40.0 * turn / units.acceleration));
    for (const std::uint16_t word : words) {
      if (word == words.back())
        this->set(0x607A, 0, units.to_user(this->device.drive().axis().position() + std::llround(turn)));
      before = static_cast<double>(this->plant.position_counts());
      this->set(0x6040, 0, word);
      if (word != words.back()) this->run_ms(500);
    }
    EXPECT_EQ(this->device.drive().state(), PowerState::operation_enabled) << "in the very word";
  }
  double turns() const { return (static_cast<double>(this->plant.position_counts()) - before) / turn; }
  bool shows_bit_12() { return (this->status() & 0x1000) != 0; }
  double turn = 0.0;
  double before = 0.0;
};

template <typename Axis>
class EnablingWord : public testing::Test {};
using Axes = testing::Types<Generic402Axis, Generic402EcAxis, IsmcAxis, PronetAxis, IsmkAxis, IsmkEaAxis, JmcAxis>;
TYPED_TEST_SUITE(EnablingWord, Axes);

using Words = std::vector<std::uint16_t>;

const std::vector<Words> with_an_edge{{0x06, 0x07, 0x1F}, {0x06, 0x17, 0x07, 0x1F}, {0x06, 0x07, 0x3F}};
const std::vector<Words> without_an_edge{{0x06, 0x17, 0x1F}, {0x16, 0x17, 0x1F}, {0x06, 0x17, 0x3F}};

TYPED_TEST(EnablingWord, BringsASetPoint) {
  for (const Words& words : with_an_edge) {
    SCOPED_TRACE(testing::PrintToString(words));
    Enabled<TypeParam> axis(1, words);
    axis.run_ms(1);
    EXPECT_TRUE(axis.shows_bit_12());
    axis.run_ms(2500);
    EXPECT_NEAR(axis.turns(), 1.0, 0.02);
    EXPECT_TRUE(axis.shows_bit_12()) << "as long as bit 4 is set";
    axis.control(0x0F);
    axis.run_ms(1);
    EXPECT_FALSE(axis.shows_bit_12());
  }
}

TYPED_TEST(EnablingWord, BringsNoSetPointWhereBit4WasSetBefore) {
  for (const Words& words : without_an_edge) {
    SCOPED_TRACE(testing::PrintToString(words));
    Enabled<TypeParam> axis(1, words);
    axis.run_ms(1);
    EXPECT_FALSE(axis.shows_bit_12());
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns(), 0.0, 0.02);
    axis.control(0x0F);
    axis.run_ms(1);
    axis.control(0x1F);
    axis.run_ms(2500);
    EXPECT_NEAR(axis.turns(), 1.0, 0.02);
  }
}

// Directly from Ready to switch on, where the link is already charged.
TYPED_TEST(EnablingWord, BringsASetPointFromReadyToSwitchOn) {
  TypeParam axis;
  ASSERT_TRUE(axis.device.drive().policy().power.direct_enable);
  if (axis.device.drive().policy().power.dc_link == drive::DcLink::from_switched_on)
    return;  // not charged in that state
  Enabled<TypeParam> edge(1, {0x06, 0x1F});
  edge.run_ms(2500);
  EXPECT_NEAR(edge.turns(), 1.0, 0.02);
  Enabled<TypeParam> none(1, {0x16, 0x1F});
  none.run_ms(1000);
  EXPECT_NEAR(none.turns(), 0.0, 0.02);
}

// Homing to the present position, which ends immediately.
TYPED_TEST(EnablingWord, StartsHoming) {
  for (const bool edge : {true, false}) {
    for (const Words& words : edge ? with_an_edge : without_an_edge) {
      SCOPED_TRACE(testing::PrintToString(words));
      Enabled<TypeParam> homing(6, {0x06, 0x07, 0x0F});
      EXPECT_EQ(homing.set(0x6098, 0, 35), dictionary::AbortCode::none);
      homing.control(0x06);
      homing.run_ms(1000);
      ASSERT_FALSE(homing.device.drive().axis().homed);
      for (const std::uint16_t word : words) {
        homing.control(word);
        homing.run_ms(500);
      }
      EXPECT_EQ(homing.device.drive().axis().homed, edge);
      homing.control(0x0F);
      homing.run_ms(1);
      homing.control(0x1F);
      homing.run_ms(500);
      EXPECT_TRUE(homing.device.drive().axis().homed);
    }
  }
}

// Interpolation uses the level of bit 4, not its edge.
TYPED_TEST(EnablingWord, LetsInterpolationRunByItsLevel) {
  TypeParam axis;
  if ((axis.device.drive().policy().modes.supported & mode_bit(drive::Mode::interpolated_position)) == 0) return;
  for (const std::uint16_t word : std::to_array<std::uint16_t>({0x07, 0x17})) {
    SCOPED_TRACE(word);
    Enabled<TypeParam> runs(7, {0x06, word, 0x1F});
    runs.run_ms(500);
    EXPECT_TRUE(runs.shows_bit_12());
    Enabled<TypeParam> rests(7, {0x06, word, 0x0F});
    rests.run_ms(500);
    EXPECT_FALSE(rests.shows_bit_12());
  }
}

}  // namespace
}  // namespace enabling_word_test
}  // namespace servodrome
