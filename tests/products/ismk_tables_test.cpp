#include <gtest/gtest.h>

#include "ismk_rig.hpp"

// The iSMK's tables of speeds and positions, selected by inputs (manual, ch. 5.2.1.1 and 5.4.1.1).
namespace servodrome {
namespace ismk_tables_test {
namespace {

using dictionary::AbortCode;
using drive::PowerState;
using products::ismk::velocity_dec_from_rpm;
using test::IsmkRig;

constexpr std::array<std::uint8_t, 8> position{0x01, 0x02, 0x03, 0x04, 0x10, 0x11, 0x12, 0x13};
constexpr std::array<std::uint8_t, 8> speed{0x05, 0x06, 0x07, 0x08, 0x14, 0x15, 0x16, 0x17};

constexpr std::array<std::int8_t, 2> speed_modes{3, -3};

void set(IsmkRig& rig, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub} << " = " << value;
}
std::int64_t dec(double rpm) { return std::llround(velocity_dec_from_rpm(rpm)); }

// Inputs 1 to 3 are the bits of the index.
void assign(IsmkRig& rig, std::array<std::uint16_t, 3> codes) {
  for (std::uint8_t i = 0; i < 3; ++i) set(rig, 0x2010, static_cast<std::uint8_t>(3 + i), codes[i]);
}
void select(IsmkRig& rig, unsigned index) {
  for (int i = 0; i < 3; ++i) rig.plant.force_input(i, (index >> i & 1) != 0);
}
constexpr std::array<std::uint16_t, 3> speed_index{0x0100, 0x0200, 0x8001};
constexpr std::array<std::uint16_t, 3> position_index{0x0400, 0x0800, 0x8002};

void enable_in(IsmkRig& rig, std::int8_t mode) {
  set(rig, 0x6060, 0, mode);
  ASSERT_TRUE(rig.enable());
}

TEST(IsmkSpeedTable, EverySpeedInBothModes) {
  for (const std::int8_t mode : speed_modes) {
    IsmkRig rig;
    assign(rig, speed_index);
    for (unsigned i = 0; i < 8; ++i) set(rig, 0x2020, speed[i], dec(i % 2 == 0 ? 100.0 + 50.0 * i : -50.0 * i));
    enable_in(rig, mode);
    for (const unsigned i : {0U, 1U, 2U, 3U, 7U, 6U, 5U, 4U}) {
      select(rig, i);
      rig.run_ms(300);
      const double wanted = i % 2 == 0 ? 100.0 + 50.0 * i : -50.0 * i;
      EXPECT_NEAR(rig.plant.velocity_rpm(), wanted, 5.0) << "mode " << int{mode} << " index " << i;
      EXPECT_EQ(rig.get(0x60FF), dec(wanted));
    }
  }
}

TEST(IsmkSpeedTable, OnlyWithAnIndexInput) {
  IsmkRig rig;
  set(rig, 0x2020, speed[0], dec(300.0));
  enable_in(rig, 3);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
  set(rig, 0x2010, 4, 0x0200);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 5.0) << "entry 0 is valid (C28)";
  set(rig, 0x60FF, 0, 0);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 5.0) << "the table rules over 60FFh";
}

TEST(IsmkSpeedTable, OnlyInTheSpeedModes) {
  IsmkRig rig;
  assign(rig, speed_index);
  set(rig, 0x2020, speed[0], dec(300.0));
  for (const int mode : {1, 4, 6, -4}) {
    set(rig, 0x6060, 0, mode);
    rig.run_ms(5);
    EXPECT_EQ(rig.get(0x60FF), 0) << mode;
  }
}

TEST(IsmkSpeedTable, NotWithoutRampsOrWithAnalogueControl) {
  for (const std::uint16_t ramp : std::array<std::uint16_t, 2>{0x6083, 0x6084}) {
    IsmkRig rig;
    assign(rig, speed_index);
    set(rig, 0x2020, speed[0], dec(300.0));
    set(rig, ramp, 0, 0);
    set(rig, 0x6060, 0, 3);
    rig.run_ms(5);
    EXPECT_EQ(rig.get(0x60FF), 0) << "mode 3 needs both ramps (Table 5-7, 6084h)";
    set(rig, 0x6060, 0, -3);
    rig.run_ms(5);
    EXPECT_EQ(rig.get(0x60FF), dec(300.0)) << "mode -3 has none";
  }
  IsmkRig rig;
  assign(rig, speed_index);
  set(rig, 0x2020, speed[0], dec(300.0));
  set(rig, 0x2502, 7, 1);
  set(rig, 0x6060, 0, 3);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x60FF), 0) << "ch. 5.2.1.1";
}

// --- Positions

IsmkRig& with_positions(IsmkRig& rig) {
  assign(rig, position_index);
  for (unsigned i = 0; i < 8; ++i) {
    set(rig, 0x2020, position[i], 5000 * (static_cast<int>(i) - 3));
    set(rig, 0x2020, speed[i], dec(i == 5 ? -300.0 : 300.0));  // its absolute value counts
  }
  return rig;
}

double place(IsmkRig& rig) { return static_cast<double>(rig.get(0x6063)); }

// Multi-function signals 0 to 2 on OUT1, one after the other.
unsigned reached(IsmkRig& rig) {
  unsigned index = 0;
  for (unsigned i = 0; i < 3; ++i) {
    set(rig, 0x2010, 0x0F, 0x1000 << i);
    rig.run_ms(3);
    index |= (rig.actuation.outputs & 1) << i;
  }
  return index;
}

TEST(IsmkPositionTable, EveryPositionByALevelChange) {
  IsmkRig rig;
  with_positions(rig);
  enable_in(rig, 1);
  rig.control(0x2F);
  rig.run_ms(100);
  EXPECT_NEAR(place(rig), 0.0, 2.0) << "position 0 has had no change of level (ch. 5.4.1.1)";
  for (const unsigned i : {1U, 3U, 2U, 6U, 7U, 5U, 4U, 0U}) {
    select(rig, i);
    rig.run_ms(10);
    EXPECT_EQ(reached(rig), 0U) << "on the way";
    rig.run_ms(500);
    EXPECT_NEAR(place(rig), 5000.0 * (static_cast<int>(i) - 3), 2.0) << i;
    EXPECT_EQ(reached(rig), i);
    EXPECT_EQ(rig.get(0x607A), 5000 * (static_cast<int>(i) - 3));
    EXPECT_EQ(rig.get(0x6081), dec(300.0));
    EXPECT_EQ(rig.get(0x6040), 0x2F) << "the start bit is taken back";
  }
}

TEST(IsmkPositionTable, PositionZeroByTheActivateInput) {
  IsmkRig rig;
  with_positions(rig);
  set(rig, 0x2010, 6, 0x4000);
  enable_in(rig, 1);
  rig.control(0x2F);
  rig.plant.force_input(3, true);
  rig.run_ms(400);
  EXPECT_NEAR(place(rig), -15000.0, 2.0);
  EXPECT_EQ(rig.get(0x6040), 0x3F);
  rig.plant.force_input(3, false);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x6040), 0x2F);
}

TEST(IsmkPositionTable, ByControlwordBit4) {
  IsmkRig rig;
  with_positions(rig);
  select(rig, 6);
  enable_in(rig, 1);
  rig.control(0x2F);
  rig.run_ms(10);
  rig.control(0x3F);
  rig.run_ms(500);
  EXPECT_NEAR(place(rig), 15000.0, 2.0);
  EXPECT_EQ(reached(rig), 6U);
}

TEST(IsmkPositionTable, WithoutIndexInputsNothingIsShown) {
  IsmkRig rig;
  with_positions(rig);
  enable_in(rig, 1);
  rig.control(0x2F);
  rig.run_ms(5);
  select(rig, 5);
  rig.run_ms(500);
  EXPECT_EQ(reached(rig), 5U);
  assign(rig, {0, 0, 0});
  EXPECT_EQ(reached(rig), 0U);
  set(rig, 0x607A, 0, 1000);
  rig.control(0x3F);
  rig.run_ms(500);
  EXPECT_NEAR(place(rig), 1000.0, 2.0) << "607Ah is the master's again";
  EXPECT_EQ(reached(rig), 0U);
}

// The whole procedure of the manual (Tables 5-12 and 5-13): inputs select mode, enable and start.
TEST(IsmkPositionTable, EverythingByInputs) {
  IsmkRig rig;
  set(rig, 0x2020, 0x0E, 1);
  set(rig, 0x2020, position[1], 30000);
  set(rig, 0x2020, speed[1], dec(500.0));
  set(rig, 0x2010, 3, 0x0001);
  set(rig, 0x2010, 4, 0x0004);
  set(rig, 0x2010, 5, 0x0400);
  set(rig, 0x2010, 6, 0x4000);
  rig.plant.force_input(1, true);  // mode
  rig.plant.force_input(2, true);  // index 1
  rig.run_ms(5);
  rig.plant.force_input(0, true);  // enable
  rig.run_ms(20);
  ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  EXPECT_NEAR(place(rig), 0.0, 2.0);
  rig.plant.force_input(3, true);  // start
  rig.run_ms(500);
  EXPECT_NEAR(place(rig), 30000.0, 2.0);
  EXPECT_EQ(reached(rig), 1U);
}

// 2020h sub 0Fh = 4Fh: each start moves by the position of the table (ch. 7.1).
TEST(IsmkPositionTable, RelativeMoves) {
  IsmkRig rig;
  with_positions(rig);
  set(rig, 0x2020, 0x0F, 0x4F);
  set(rig, 0x2010, 6, 0x4000);
  set(rig, 0x2010, 7, 0x0001);
  set(rig, 0x6060, 0, 1);
  select(rig, 5);  // 10000
  rig.run_ms(3);
  rig.plant.force_input(4, true);
  rig.run_ms(5);
  for (int i = 1; i <= 3; ++i) {
    rig.plant.force_input(3, true);
    rig.run_ms(400);
    EXPECT_NEAR(place(rig), 10000.0 * i, 2.0);
    rig.plant.force_input(3, false);
    rig.run_ms(3);
  }
}

TEST(IsmkPositionTable, NotWhileDisabledAndNotLater) {
  IsmkRig rig;
  with_positions(rig);
  set(rig, 0x6060, 0, 1);
  rig.run_ms(3);
  select(rig, 7);
  rig.run_ms(10);
  enable_in(rig, 1);
  rig.control(0x2F);
  rig.run_ms(100);
  EXPECT_NEAR(place(rig), 0.0, 2.0);
  EXPECT_EQ(reached(rig), 0U);
}

// 2FF1h: L = 2, M = 3, N = -14 is Din_Pos[2] = 29986 (Table 5-11).
TEST(IsmkPositionTable, QuickEntry) {
  IsmkRig rig;
  for (unsigned i = 0; i < 8; ++i) {
    set(rig, 0x2FF1, 1, i);
    set(rig, 0x2FF1, 2, 3);
    set(rig, 0x2FF1, 3, -14 - static_cast<int>(i));
    EXPECT_EQ(rig.get(0x2020, position[i]), 29986 - static_cast<int>(i));
  }
  EXPECT_EQ(rig.get(0x2020, position[0]), 29986);
  set(rig, 0x2FF1, 1, 4);
  set(rig, 0x2FF1, 2, -32768);
  EXPECT_EQ(rig.get(0x2020, position[4]), -32768 * 10000 - 21);
  EXPECT_EQ(rig.set(0x2FF1, 1, 8), AbortCode::value_too_high);
}

}  // namespace
}  // namespace ismk_tables_test
}  // namespace servodrome
