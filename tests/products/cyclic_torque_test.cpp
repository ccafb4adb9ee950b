#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "rig.hpp"

// Bit 12 of cyclic synchronous torque: "drive follows the command value" (CiA 402-2), which means that 6071h reaches
// the torque loop. A limit of torque or speed does not clear it; it is 0 only if 6071h has no effect.
namespace servodrome {
namespace cyclic_torque_test {
namespace {

struct Generic402Axis : test::Rig<products::Generic402> {
  static constexpr bool shows_limits = true;
};
struct Generic402EcAxis : test::EthercatRig<products::Generic402Ec> {
  static constexpr bool shows_limits = true;
};
struct JmcAxis : test::FactoryJmcRig {
  static constexpr bool shows_limits = false;  // bit 11 of CSP and PP only (Table 156)
};

template <typename Axis>
class CyclicTorque : public testing::Test {
 protected:
  void enable() {
    axis.set(0x6060, 0, 10);
    ASSERT_TRUE(axis.enable());
    axis.run_ms(200);  // with a brake: until it is open
    ASSERT_EQ(axis.get(0x6061), 10);
  }
  bool bit(unsigned number) { return (axis.status() >> number & 1U) != 0; }
  Axis axis;
};
using Axes = testing::Types<Generic402Axis, Generic402EcAxis, JmcAxis>;
TYPED_TEST_SUITE(CyclicTorque, Axes);

TYPED_TEST(CyclicTorque, IsFollowedUpToTheLimitOfTorque) {
  this->axis.plant.lock_rotor(true);
  this->enable();
  this->axis.set(0x6072, 0, 200);
  this->axis.set(0x6071, 0, 150);
  this->axis.run_ms(50);
  EXPECT_NEAR(static_cast<double>(this->axis.get(0x6077)), 150, 10);
  EXPECT_FALSE(this->bit(11));
  EXPECT_TRUE(this->bit(12));
  this->axis.set(0x6071, 0, 400);
  this->axis.run_ms(50);
  EXPECT_NEAR(static_cast<double>(this->axis.get(0x6077)), 200, 10);
  EXPECT_EQ(this->bit(11), TypeParam::shows_limits);
  EXPECT_TRUE(this->bit(12));
}

TYPED_TEST(CyclicTorque, IsFollowedUpToTheLimitOfSpeed) {
  this->axis.set(0x6080, 0, 300);
  this->enable();
  this->axis.set(0x6071, 0, 100);
  this->axis.run_ms(1500);
  EXPECT_NEAR(this->axis.plant.velocity_rpm(), 300.0, 15.0);
  EXPECT_LT(this->axis.get(0x6077), 60) << "the rest of 6071h is taken back";
  EXPECT_EQ(this->bit(11), TypeParam::shows_limits);
  EXPECT_TRUE(this->bit(12));
}

TYPED_TEST(CyclicTorque, IsNotFollowedInAHalt) {
  this->axis.plant.lock_rotor(true);
  this->enable();
  this->axis.set(0x6071, 0, 100);
  this->axis.run_ms(50);
  EXPECT_TRUE(this->bit(12));
  this->axis.set(0x6040, 0, 0x010F);
  this->axis.run_ms(5);
  EXPECT_FALSE(this->bit(12));
}

// The iSMK-EA has mode 8 in addition to its manual, but no mode 10.
TEST(CyclicTorqueOfTheIsmkEa, IsRefused) {
  test::EthercatRig<products::IsmkEa> axis(test::ismk_plant(), test::ismk_settings());
  EXPECT_EQ(axis.set(0x6060, 0, 10), dictionary::AbortCode::value_too_high);
  EXPECT_EQ(axis.get(0x6502) & 1 << 9, 0);
}

}  // namespace
}  // namespace cyclic_torque_test
}  // namespace servodrome
