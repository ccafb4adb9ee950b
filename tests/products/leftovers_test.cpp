#include <cmath>
#include <gtest/gtest.h>
#include <set>
#include <tuple>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// State of an earlier mode, stop, power cycle or polarity must not act on later actions (reference drive, CiA 402).
namespace servodrome {
namespace leftovers_test {
namespace {

using drive::PowerState;
using products::Generic402;
using test::Rig;

constexpr std::uint16_t target_reached = 1u << 10;
constexpr std::uint16_t internal_limit = 1u << 11;
constexpr std::uint16_t bit_12 = 1u << 12;

class Leftovers : public ::testing::Test {
 protected:
  PowerState state() { return rig.device.drive().state(); }
  std::int64_t counts() const { return rig.plant.position_counts(); }
  void run_in_profile_velocity(std::int64_t velocity, double milliseconds) {
    rig.set(0x6060, 0, 3);
    ASSERT_TRUE(rig.enable());
    rig.set(0x60FF, 0, velocity);
    rig.run_ms(milliseconds);
  }

  Rig<Generic402> rig;
};

// Data that waited for SYNC belong to the configuration in which they arrived.
TEST_F(Leftovers, RpdoThatWaitsForSyncDoesNotSurviveReconfiguration) {
  for (const std::int64_t value : {0x6083, 0x6084, 0x6085}) rig.set(static_cast<std::uint16_t>(value), 0, 2000000);
  rig.set(0x6060, 0, 3);
  ASSERT_EQ(rig.set(0x1403, 2, 1), dictionary::AbortCode::none);
  rig.send(0, {1, 0});
  ASSERT_TRUE(rig.enable());
  rig.send(0x502, {0x0F, 0, 0, 0, 0x10, 0});  // 6040h, 60FFh; waits for SYNC
  rig.run_ms(50);
  ASSERT_EQ(rig.set(0x1403, 2, 255), dictionary::AbortCode::none);
  rig.send(0x502, {0x06, 0, 0, 0, 0, 0});
  rig.run_ms(300);
  EXPECT_EQ(state(), PowerState::ready_to_switch_on);
  rig.send(0x80, {});
  rig.run_ms(300);
  EXPECT_EQ(state(), PowerState::ready_to_switch_on);
  EXPECT_EQ(rig.get(0x60FF), 0);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
}

TEST_F(Leftovers, HomingThatWasGivenUpInHaltDoesNotGoOn) {
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 34);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(20);
  rig.control(0x11F);  // halt ...
  rig.run_ms(200);
  rig.control(0x10F);  // ... and the start bit is reset
  rig.run_ms(10);
  rig.control(0x0F);
  rig.run_ms(10);
  const std::int64_t stood = counts();
  rig.run_ms(500);
  EXPECT_NEAR(static_cast<double>(counts()), static_cast<double>(stood), 2.0);
  EXPECT_EQ(rig.status() & (target_reached | bit_12), target_reached) << "interrupted";
}

TEST_F(Leftovers, HaltAndReleaseWithoutHomingMovesNothing) {
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 34);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(50);
  rig.control(0x06);  // cancelled by shutdown
  rig.run_ms(500);
  rig.control(0x07);
  rig.control(0x0F);
  rig.run_ms(20);
  rig.control(0x10F);
  rig.run_ms(20);
  rig.control(0x0F);
  const std::int64_t stood = counts();
  rig.run_ms(300);
  EXPECT_NEAR(static_cast<double>(counts()), static_cast<double>(stood), 2.0);
}

TEST_F(Leftovers, AMotorWithoutBrakeMayCoast) {
  run_in_profile_velocity(2000000, 1600);
  ASSERT_GT(rig.get(0x606C), 1900000);
  rig.control(0x00);
  const std::int64_t released_at = counts();
  rig.run_ms(200);
  EXPECT_GT(counts() - released_at, 131072);
  EXPECT_EQ(state(), PowerState::switch_on_disabled);
  EXPECT_EQ(rig.get(0x603F), 0);
}

TEST_F(Leftovers, NothingIsDemandedOfAMotorWithoutPower) {
  run_in_profile_velocity(2000000, 1600);
  rig.control(0x00);
  rig.run_ms(50);
  EXPECT_FALSE(rig.device.drive().in_motion());
  EXPECT_EQ(rig.get(0x606B), 0);
  EXPECT_EQ(rig.get(0x6062), rig.get(0x6064)) << "the demand follows the shaft";
}

TEST_F(Leftovers, QuickStopThatEndsInSwitchOnDisabledIsNotCalledOff) {
  rig.set(0x605A, 0, 2);
  run_in_profile_velocity(2000000, 1600);
  rig.control(0x0B);
  rig.run_ms(20);
  ASSERT_EQ(state(), PowerState::quick_stop_active);
  rig.control(0x0F);
  rig.run_ms(5);
  EXPECT_EQ(state(), PowerState::quick_stop_active) << "transition 16 belongs to 605Ah = 5 to 8";
  rig.run_ms(1000);
  EXPECT_EQ(state(), PowerState::switch_on_disabled);
}

TEST_F(Leftovers, QuickStopThatStaysMayBeLeftAtOnce) {
  rig.set(0x605A, 0, 6);
  run_in_profile_velocity(2000000, 1600);
  rig.control(0x0B);
  rig.run_ms(20);
  rig.control(0x0F);
  rig.run_ms(5);
  EXPECT_EQ(state(), PowerState::operation_enabled);
}

// Methods 1 to 14 and 17 to 37 of CiA 402-2 without 31 and 32, which are reserved; the maker's methods below 0 use a
// hard stop.
TEST_F(Leftovers, EveryHomingMethodOfferedIsAccepted) {
  std::set<std::int64_t> methods{-4, -3, -2, -1};
  for (std::int64_t method = 1; method <= 37; ++method) {
    if (method != 15 && method != 16 && method != 31 && method != 32 && method != 36) methods.insert(method);
  }
  std::set<std::int64_t> offered;
  const std::int64_t count = rig.get(0x60E3, 0);
  for (std::int64_t sub = 1; sub <= count; ++sub) offered.insert(rig.get(0x60E3, static_cast<std::uint8_t>(sub)));
  EXPECT_EQ(offered, methods);
  for (std::int64_t method = -128; method < 128; ++method) {
    const bool accepted = rig.set(0x6098, 0, method) == dictionary::AbortCode::none;
    EXPECT_EQ(accepted, methods.count(method) == 1) << method;
  }
}

TEST_F(Leftovers, ALossOfTheMasterIsNamedAlikeInEmergencyAndErrorCode) {
  rig.set(0x1400, 5, 10);  // event timer: deadline of the RPDO
  rig.set(0x1400, 2, 255);
  ASSERT_TRUE(rig.enable());
  rig.send(0x000, {0x01, 0x00});
  rig.send(0x202, {0x0F, 0x00});
  rig.sent.clear();
  rig.run_ms(100);
  std::uint16_t emergency = 0;
  for (const canopen::Frame& frame : rig.sent) {
    if (frame.id == 0x82) emergency = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
  }
  EXPECT_EQ(emergency, 0x8250);
  EXPECT_EQ(rig.get(0x603F), 0x8250);
}

TEST_F(Leftovers, ResettingTheNodeClearsTheErrorRegister) {
  ASSERT_TRUE(rig.enable());
  rig.device.drive().inject(drive::Cause::external, true);
  rig.run_ms(2);
  ASSERT_EQ(state(), PowerState::fault);
  ASSERT_NE(rig.get(0x1001), 0);
  rig.device.drive().inject(drive::Cause::external, false);
  rig.send(0x000, {0x81, 0x00});
  rig.run_ms(20);
  EXPECT_EQ(state(), PowerState::switch_on_disabled);
  EXPECT_EQ(rig.get(0x603F), 0);
  EXPECT_EQ(rig.get(0x1001), 0);
}

TEST(LeftoversIsmc, LimitsOfTheCurrentActWhenTheyAreWritten) {
  Rig<products::Ismc> rig;
  rig.set(0x2017, 0, 2);
  rig.set(0x6060, 0, 4);
  ASSERT_TRUE(rig.enable());
  rig.set(0x2F16, 0, 100);  // the peak current for 100 ms only
  rig.plant.lock_rotor(true);
  rig.set(0x6071, 0, 3000);
  const std::int64_t ticks = rig.run_until([&] { return rig.get(0x603F) == 0x8900; }, 5000);
  EXPECT_GT(ticks, 50 * 16);
  EXPECT_LT(ticks, 200 * 16);
}

TEST_F(Leftovers, StartBitTakenAwayInHaltLeavesTheHaltsRamp) {
  rig.set(0x605D, 0, 2);
  rig.set(0x609A, 0, 1000000);  // the quick stop ramp 5242880 is steeper
  rig.set(0x6099, 1, 1000000);
  rig.set(0x6099, 2, 1000000);
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 17);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(1100);
  rig.control(0x11F);
  rig.run_ms(10);
  rig.control(0x10F);
  const std::int64_t ticks = rig.run_until([&] { return (rig.status() & target_reached) != 0; }, 3000);
  EXPECT_NEAR(static_cast<double>(ticks) / 16.0, 1000.0 * 1000000.0 / 5242880.0 - 10.0, 3.0);
}

// 5 turns of the motor are 2 of the shaft; a turn of the shaft is 360000 units; the encoder's 131072 counts are written
// as 262144 in 2 turns.
TEST_F(Leftovers, FactorGroupWithEveryDivisor) {
  for (const auto& [index, sub, value] : std::initializer_list<std::tuple<std::uint16_t, std::uint8_t, int>>{
           {0x608F, 1, 262144}, {0x608F, 2, 2}, {0x6091, 1, 5}, {0x6091, 2, 2}, {0x6092, 1, 720000}, {0x6092, 2, 2}}) {
    ASSERT_EQ(rig.set(index, sub, value), dictionary::AbortCode::none);
  }
  rig.set(0x6081, 0, 360000);
  rig.set(0x6083, 0, 3600000);
  rig.set(0x6084, 0, 3600000);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.set(0x607A, 0, 1080000);
  rig.control(0x1F);
  rig.run_ms(1500);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), 360000.0, 2000.0);
  EXPECT_EQ(rig.get(0x606B), 360000);
  rig.run_ms(3000);
  EXPECT_EQ(rig.get(0x6062), 1080000);
  EXPECT_NEAR(static_cast<double>(counts()), 3.0 * 2.5 * 131072.0, 2.0);
  EXPECT_EQ(rig.set(0x6091, 2, 3), dictionary::AbortCode::device_state);
}

// Velocity in rpm and acceleration in turns per second squared, only by the factors.
TEST_F(Leftovers, VelocityAndAccelerationFactorsLeadToTheUsersUnit) {
  rig.set(0x6096, 1, 60);
  rig.set(0x6096, 2, 131072);
  rig.set(0x6097, 2, 60);
  rig.set(0x6083, 0, 2);
  run_in_profile_velocity(600, 2500);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606B)), 2.5 * 2.0 * 60.0, 1.0);
  rig.run_ms(3000);
  EXPECT_EQ(rig.get(0x606B), 600);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 600.0, 2.0);
}

// The rounding of units to counts must not add up: moves by a unit that is
// 1/7 of a turn.
TEST_F(Leftovers, RelativeMovesInUnitsThatAreNoWholeCountsDoNotDrift) {
  rig.set(0x6092, 1, 7);
  rig.set(0x6081, 0, 100);
  rig.set(0x6083, 0, 10000);
  rig.set(0x6084, 0, 10000);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  for (int move = 1; move <= 100; ++move) {
    rig.set(0x607A, 0, 1);
    rig.control(0x4F);
    rig.control(0x5F);
    rig.run_ms(60);
  }
  EXPECT_EQ(rig.get(0x6062), 100);
  EXPECT_EQ(rig.get(0x60FC), std::llround(100.0 * 131072.0 / 7.0));
}

TEST_F(Leftovers, ParametersAreSavedAndProcessDataAreNot) {
  const std::set<std::uint32_t> process_data{0x6040'00, 0x6042'00, 0x6060'00, 0x6071'00, 0x607A'00,
                                             0x60B0'00, 0x60B1'00, 0x60B2'00, 0x60B8'00, 0x60C1'01,
                                             0x60C4'04, 0x60C4'05, 0x60C4'06, 0x60FE'01, 0x60FF'00};
  for (const dictionary::Entry& entry : Generic402::table) {
    if (entry.index < 0x6000 || entry.access == dictionary::Access::ro ||
        entry.access == dictionary::Access::constant) {
      continue;
    }
    const std::uint32_t key = std::uint32_t{entry.index} << 8 | entry.sub;
    EXPECT_EQ(entry.saved, process_data.count(key) == 0) << std::hex << key;
  }
}

TEST_F(Leftovers, LongTimesDoNotOverflow) {
  drive::Axis axis = rig.device.drive().axis();
  EXPECT_EQ(axis.cycles(1), 2u);
  EXPECT_EQ(axis.cycles(4294967295u), 4294967295u);
}

TEST_F(Leftovers, VelocityUnitActsWhenItIsWritten) {
  rig.set(0x60A9, 0, 0x00B44700);  // rpm
  run_in_profile_velocity(60, 1000);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), 60.0, 1.0);
  const std::int64_t before = counts();
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(counts() - before), 131072.0, 1500.0);
  EXPECT_EQ(rig.set(0x60A9, 0, 0), dictionary::AbortCode::device_state);
}

TEST_F(Leftovers, PolarityTurnsTheVelocityModeRoundEverywhere) {
  rig.set(0x607E, 0, 0x40);
  rig.set(0x6060, 0, 2);
  ASSERT_TRUE(rig.enable());
  rig.set(0x6042, 0, 300);
  rig.control(0x7F);
  rig.run_ms(1500);
  const std::int64_t before = counts();
  rig.run_ms(100);
  EXPECT_LT(counts(), before);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6044)), 300.0, 2.0);
  EXPECT_EQ(rig.get(0x6043), 300);
}

TEST_F(Leftovers, VelocityModeLimitsAreInItsOwnUnit) {
  rig.set(0x604C, 2, 10);  // ten user units per rpm
  rig.set(0x6046, 2, 2000);
  rig.set(0x6060, 0, 2);
  ASSERT_TRUE(rig.enable());
  rig.set(0x6042, 0, 5000);
  rig.control(0x7F);
  rig.run_ms(1500);
  EXPECT_EQ(rig.get(0x6043), 2000);
  EXPECT_NE(rig.status() & internal_limit, 0);
  const std::int64_t before = counts();
  rig.run_ms(100);
  EXPECT_NEAR(static_cast<double>(counts() - before), 200.0 / 60.0 * 0.1 * 131072.0, 200.0);
  EXPECT_EQ(rig.set(0x604C, 2, 0), dictionary::AbortCode::value_invalid);
  EXPECT_EQ(rig.set(0x604B, 2, 0), dictionary::AbortCode::value_invalid);
}

TEST_F(Leftovers, ASetPointGivenInHaltIsRunAfterwards) {
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.control(0x10F);
  rig.run_ms(5);
  rig.set(0x607A, 0, 10000);
  rig.control(0x11F);
  rig.run_ms(2);
  EXPECT_NE(rig.status() & bit_12, 0) << "the handshake goes on in halt";
  rig.control(0x10F);
  rig.run_ms(50);
  EXPECT_EQ(rig.get(0x6062), 0);
  rig.control(0x0F);
  rig.run_ms(1000);
  EXPECT_EQ(rig.get(0x6062), 10000);
}

TEST_F(Leftovers, StopWithoutAJerkIsLinear) {
  rig.set(0x6086, 0, 3);
  rig.set(0x6081, 0, 1000000);
  rig.set(0x607A, 0, 100000000);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(1600);
  ASSERT_GT(rig.get(0x606C), 900000);
  rig.set(0x60A4, 1, 0);
  rig.control(0x11F);
  rig.run_ms(1);
  EXPECT_GE(rig.run_until([&] { return (rig.status() & target_reached) != 0; }, 1000), 0);
  rig.run_ms(5);  // the delay of 606Ch
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), 0.0, 3000.0);
}

TEST_F(Leftovers, QuickStopInTheCycleOfEnablingHoldsTheAxis) {
  rig.set(0x605A, 0, 6);
  rig.run_ms(1);
  rig.control(0x06);
  rig.control(0x07);
  rig.run_ms(200);
  rig.control(0x0F);
  rig.control(0x0B);
  rig.run_ms(5);
  ASSERT_EQ(state(), PowerState::quick_stop_active);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_NE(rig.device.drive().axis().demand.loop, drive::Loop::off);
}

TEST_F(Leftovers, PowerCycleForgetsThatHomingWasAttained) {
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 37);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(20);
  ASSERT_NE(rig.status() & bit_12, 0);
  rig.device.power_on(rig.feedback, rig.now());
  rig.set(0x6060, 0, 6);
  ASSERT_TRUE(rig.enable());
  EXPECT_EQ(rig.status() & bit_12, 0);
}

TEST_F(Leftovers, PowerCycleLeavesNothingOfTheLifeBefore) {
  Rig<Generic402> other;
  for (int i = 0; i < 3; ++i) other.tick();
  other.device.power_on(other.feedback, other.now());
  for (Rig<Generic402>* each : {&rig, &other}) {
    each->set(0x6060, 0, 1);
    ASSERT_TRUE(each->enable());
    each->set(0x607A, 0, 50000);
    each->control(0x1F);
  }
  for (int tick = 0; tick < 4000; ++tick) {
    rig.tick();
    other.tick();
    ASSERT_EQ(rig.actuation.phase_voltage_v, other.actuation.phase_voltage_v) << "tick " << tick;
  }
}

TEST_F(Leftovers, ShortCircuitEndsWithTheHaltItBelongedTo) {
  rig.set(0x605D, 0, 4);
  run_in_profile_velocity(500000, 800);
  rig.control(0x10F);
  rig.run_ms(100);
  ASSERT_TRUE(rig.actuation.short_circuit);
  rig.set(0x6060, 0, 1);
  rig.control(0x0F);
  rig.run_ms(10);
  EXPECT_FALSE(rig.actuation.short_circuit);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
}

TEST_F(Leftovers, TorqueModeTakesTheTorqueOverUnderInvertedPolarity) {
  rig.set(0x607E, 0, 0x40);
  rig.set(0x6087, 0, 100);  // 10 % per second
  rig.set(0x6071, 0, 300);
  rig.set(0x6060, 0, 10);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(20);
  const std::int64_t before = rig.get(0x6074);
  ASSERT_NEAR(static_cast<double>(before), 300.0, 5.0);
  rig.set(0x6060, 0, 4);
  rig.run_ms(2);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6074)), static_cast<double>(before), 10.0);
}

TEST_F(Leftovers, HaltOnARotaryAxisDoesNotShortenTheWay) {
  rig.set(0x607B, 1, 0);
  rig.set(0x607B, 2, 131071);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.set(0x607A, 0, 3 * 131072 + 1000);
  rig.control(0x5F);
  rig.run_ms(400);
  rig.control(0x14F);
  rig.run_ms(400);
  ASSERT_LT(counts(), 131072);
  rig.control(0x0F);
  rig.run_ms(5000);
  EXPECT_NEAR(static_cast<double>(counts()), 3.0 * 131072 + 1000, 2.0);
  EXPECT_EQ(rig.get(0x6062), 1000);
}

TEST_F(Leftovers, PositionsBeyond32BitsAreAddressedInTheirTurn) {
  rig.device.drive().set_position_offset(std::int64_t{1} << 32);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), 0.0, 2.0);
  rig.set(0x607A, 0, 5000);
  rig.control(0x1F);
  rig.run_ms(1000);
  EXPECT_EQ(rig.get(0x6062), 5000);
  EXPECT_NEAR(static_cast<double>(counts()), 5000.0, 2.0);
}

// 6007h: reset communication counts as a loss of the master, like a stopped node.
TEST(LeftoversConnection, ResetCommunicationIsALossOfConnection) {
  for (const std::int64_t option : {0, 1, 2, 3}) {
    Rig<Generic402> rig;
    rig.set(0x6060, 0, 3);
    ASSERT_TRUE(rig.enable());
    rig.set(0x6007, 0, option);
    rig.run_ms(1);
    // 6007h belongs to the profile's area, which reset communication does not change.
    rig.send(0x000, {0x82, 0x00});
    rig.run_ms(10);
    constexpr std::array after{drive::PowerState::operation_enabled, drive::PowerState::fault,
                               drive::PowerState::switch_on_disabled, drive::PowerState::switch_on_disabled};
    EXPECT_EQ(rig.device.drive().state(), after[static_cast<std::size_t>(option)]) << option;
    EXPECT_EQ(rig.get(0x603F), option == 1 ? 0x8130 : 0);
  }
}

}  // namespace
}  // namespace leftovers_test
}  // namespace servodrome
