#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// No drive shows Switched on or Operation enabled before its DC link has its voltage. A drive that connects the link in
// transition 3 waits for the whole precharge. Other drives precharge from power-on, and wait for the rest of it.
namespace servodrome {
namespace dc_link_wait_test {
namespace {

using drive::PowerState;

// The duration of the precharge and of the detection of under-voltage (README of the ISMC).
constexpr double longest_wait_ms = 306.0;

// Each product on an empty DC link.
struct Generic402Axis : test::Rig<products::Generic402> {
  explicit Generic402Axis(double volts = 310.0) : Rig(plant_of(volts)) {}
  static plant::Parameters plant_of(double volts) {
    plant::Parameters parameters;
    parameters.supply.volts = volts;
    return parameters;
  }
};
struct Generic402EcAxis : test::EthercatRig<products::Generic402Ec> {
  explicit Generic402EcAxis(double volts = 310.0) : EthercatRig(Generic402Axis::plant_of(volts)) {}
};
struct IsmcAxis : test::Rig<products::Ismc> {
  explicit IsmcAxis(double volts = 310.0) : Rig(Generic402Axis::plant_of(volts)) {}
};
struct PronetAxis : test::Rig<products::Pronet> {
  explicit PronetAxis(double volts = 310.0) : Rig(Generic402Axis::plant_of(volts)) {}
};
struct IsmkAxis : test::FactoryIsmkRig {
  explicit IsmkAxis(double volts = 48.0) : FactoryIsmkRig(plant_of(volts), test::ismk_settings()) {}
  static plant::Parameters plant_of(double volts) {
    plant::Parameters parameters = test::ismk_plant();
    parameters.supply.charged_at_start = false;
    parameters.supply.volts = volts;
    return parameters;
  }
};
struct IsmkEaAxis : test::EthercatRig<products::IsmkEa> {
  explicit IsmkEaAxis(double volts = 48.0) : EthercatRig(IsmkAxis::plant_of(volts), test::ismk_settings()) {}
};
struct JmcAxis : test::FactoryJmcRig {
  JmcAxis() : JmcAxis(test::jmc_plant().supply.volts) {}
  explicit JmcAxis(double volts) : FactoryJmcRig(plant_of(volts), test::jmc_settings()) {}
  static plant::Parameters plant_of(double volts) {
    plant::Parameters parameters = test::jmc_plant();
    parameters.supply.charged_at_start = false;
    parameters.supply.volts = volts;
    return parameters;
  }
};

template <typename Axis>
class DcLinkWait : public testing::Test {
 protected:
  static PowerState state(Axis& axis) { return axis.device.drive().state(); }
  static bool switched_on(Axis& axis) {
    return state(axis) == PowerState::switched_on || state(axis) == PowerState::operation_enabled;
  }
  static bool charged(Axis& axis) {
    return axis.plant.dc_link_v() >= static_cast<double>(axis.device.drive().configuration().monitors.under_voltage_v);
  }
  static void command(Axis& axis, std::uint16_t word) { axis.set(0x6040, 0, word); }
  // Brings the drive to Ready to switch on, with an empty link.
  static void make_ready(Axis& axis) {
    command(axis, 0x06);
    axis.run_ms(1);
    ASSERT_EQ(state(axis), PowerState::ready_to_switch_on);
    ASSERT_FALSE(charged(axis));
  }
};
using Axes = testing::Types<Generic402Axis, Generic402EcAxis, IsmcAxis, PronetAxis, IsmkAxis, IsmkEaAxis, JmcAxis>;
TYPED_TEST_SUITE(DcLinkWait, Axes);

TYPED_TEST(DcLinkWait, NothingIsSwitchedOnBelowUnderVoltage) {
  for (const std::uint16_t word : std::to_array<std::uint16_t>({0x07, 0x0F})) {
    SCOPED_TRACE(word);
    TypeParam axis;
    this->make_ready(axis);
    this->command(axis, word);
    const bool direct = axis.device.drive().policy().power.direct_enable;
    const PowerState wanted = word == 0x07 ? PowerState::switched_on
                              : direct     ? PowerState::operation_enabled
                                           : PowerState::ready_to_switch_on;
    for (int tick = 0; tick < 16 * 400; ++tick) {
      axis.tick();
      if (!this->switched_on(axis)) {
        ASSERT_FALSE(axis.actuation.pwm_enabled);
        continue;
      }
      ASSERT_TRUE(this->charged(axis)) << axis.plant.dc_link_v() << " V after " << tick / 16.0 << " ms";
      ASSERT_NE(axis.status() & 0x10, 0) << tick;
    }
    EXPECT_EQ(this->state(axis), wanted);
    EXPECT_EQ(axis.get(0x603F), 0);
  }
}

// A master that does not wait.
TYPED_TEST(DcLinkWait, TheLastCommandDecides) {
  {
    TypeParam axis;
    this->make_ready(axis);
    for (const std::uint16_t word : std::to_array<std::uint16_t>({0x07, 0x0F, 0x0F})) this->command(axis, word);
    axis.run_ms(400);
    EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
  }
  {
    TypeParam axis;
    this->make_ready(axis);
    for (const std::uint16_t word : std::to_array<std::uint16_t>({0x0F, 0x07})) this->command(axis, word);
    axis.run_ms(400);
    EXPECT_EQ(this->state(axis), PowerState::switched_on);
  }
  struct Row {
    std::uint16_t word;
    PowerState ends_in;
  };
  for (const Row& row : {Row{0x06, PowerState::ready_to_switch_on}, Row{0x00, PowerState::switch_on_disabled},
                         Row{0x0D, PowerState::switch_on_disabled}, Row{0x02, PowerState::switch_on_disabled},
                         Row{0x0B, PowerState::switch_on_disabled}, Row{0x8F, PowerState::ready_to_switch_on}}) {
    SCOPED_TRACE(row.word);
    TypeParam axis;
    this->make_ready(axis);
    this->command(axis, 0x07);
    this->command(axis, 0x0F);
    axis.run_ms(5);
    this->command(axis, row.word);
    bool on = false;
    for (int tick = 0; tick < 16 * 600; ++tick) {
      axis.tick();
      on = on || this->switched_on(axis) || axis.actuation.pwm_enabled;
    }
    EXPECT_FALSE(on);
    EXPECT_EQ(this->state(axis), row.ends_in);
    EXPECT_EQ(axis.get(0x603F), 0);
    const bool relay = axis.device.drive().policy().power.dc_link == drive::DcLink::from_switched_on;
    EXPECT_EQ(axis.actuation.dc_link_connected, !relay);
  }
}

TYPED_TEST(DcLinkWait, ASupplyThatNeverComesIsUnderVoltage) {
  TypeParam axis(1.0);
  this->make_ready(axis);
  this->command(axis, 0x07);
  this->command(axis, 0x0F);
  const std::int64_t ticks = axis.run_until([&] { return this->state(axis) == PowerState::fault; }, 1000.0);
  ASSERT_GE(ticks, 0);
  EXPECT_LE(static_cast<double>(ticks) / 16.0, longest_wait_ms);
  const drive::FaultRow* fault = axis.device.drive().row(drive::Cause::under_voltage);
  EXPECT_EQ(axis.get(0x603F), fault->code);
  EXPECT_FALSE(axis.actuation.pwm_enabled);
  // A fault ends the wait: a later supply and the reset do not continue it.
  axis.plant.set_supply_v(TypeParam().plant.parameters().supply.volts);
  axis.run_ms(400);
  this->command(axis, 0x8F);
  axis.run_ms(400);
  EXPECT_FALSE(this->switched_on(axis));
}

// The supply is cut while the drive waits, and returns.
TYPED_TEST(DcLinkWait, APowerCutForgetsTheCommand) {
  TypeParam axis;
  this->make_ready(axis);
  this->command(axis, 0x07);
  axis.run_ms(5);
  axis.device.power_off();
  axis.plant.sample(axis.feedback);
  axis.device.power_on(axis.feedback, axis.now());
  bool on = false;
  for (int tick = 0; tick < 16 * 400; ++tick) {
    axis.tick();
    on = on || this->switched_on(axis);
  }
  EXPECT_FALSE(on);
}

// A set-point that is given while the drive waits is executed when the drive is enabled, if its mode is still selected.
TYPED_TEST(DcLinkWait, ASetPointIsNotLost) {
  struct Row {
    std::vector<std::uint16_t> words;
    std::int64_t mode;  // at the end of the wait
  };
  for (const Row& row : {Row{{0x16, 0x17, 0x0F, 0x2F, 0x3F}, 1}, Row{{0x16, 0x17, 0x0F, 0x2F, 0x3F}, 6},
                         // cancelled by a word with bit 7, which is not a command, and given again
                         Row{{0x07, 0x0F, 0x1F, 0x80, 0x07, 0x0F, 0x1F}, 1}, Row{{0x1F, 0x80, 0x07, 0x0F, 0x1F}, 1},
                         Row{{0x07, 0x1F, 0x9F, 0x07, 0x1F}, 1}}) {
    SCOPED_TRACE(testing::PrintToString(row.words));
    SCOPED_TRACE(row.mode);
    TypeParam axis;
    this->make_ready(axis);
    const drive::Units& units = axis.device.drive().axis().units;
    const double turn = units.counts_per_revolution;
    axis.set(0x6081, 0, std::lround(units.velocity_to_user(2.0 * turn)));
    axis.set(0x6083, 0, std::lround(40.0 * turn / units.acceleration));
    axis.set(0x6084, 0, std::lround(40.0 * turn / units.acceleration));
    axis.set(0x6060, 0, 1);
    axis.set(0x607A, 0, units.to_user(static_cast<drive::Counts>(turn)));
    for (const std::uint16_t word : row.words) this->command(axis, word);
    axis.run_ms(2);
    axis.set(0x6060, 0, row.mode);
    const auto before = static_cast<double>(axis.plant.position_counts());
    axis.run_ms(2500);
    EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
    EXPECT_NEAR((static_cast<double>(axis.plant.position_counts()) - before) / turn, row.mode == 1 ? 1.0 : 0.0, 0.02);
  }
}

// The precharge resistor is bridged by then: full torque immediately must not cause a fault.
TYPED_TEST(DcLinkWait, TheAxisHasItsTorqueWhenItIsEnabled) {
  TypeParam axis;
  this->make_ready(axis);
  axis.set(0x6060, 0, 3);
  this->command(axis, 0x07);
  this->command(axis, 0x0F);
  ASSERT_GE(axis.run_until([&] { return this->state(axis) == PowerState::operation_enabled; }, 400.0), 0);
  for (const std::uint16_t object : std::to_array<std::uint16_t>({0x607F, 0x60C5, 0x60C6, 0x6083, 0x6084}))
    axis.set(object, 0, 0x7FFFFFFF);
  const drive::Units& units = axis.device.drive().axis().units;
  axis.set(0x60FF, 0, std::lround(units.velocity_to_user(20.0 * units.counts_per_revolution)));
  axis.run_ms(500);
  EXPECT_EQ(axis.get(0x603F), 0) << std::hex << axis.get(0x603F);
  EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
}

}  // namespace
}  // namespace dc_link_wait_test
}  // namespace servodrome
