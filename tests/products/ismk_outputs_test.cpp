#include <functional>
#include <gtest/gtest.h>
#include <map>

#include "ismk_rig.hpp"

// The functions of the iSMK's digital outputs (manual, ch. 7.9): every code has a test case here.
namespace servodrome {
namespace ismk_outputs_test {
namespace {

using dictionary::AbortCode;
using products::ismk::output_functions;
using products::ismk::velocity_dec_from_rpm;
using test::IsmkRig;

constexpr std::array<std::int8_t, 2> speed_modes{3, -3};

void set(IsmkRig& rig, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub} << " = " << value;
}
std::int64_t dec(double rpm) { return std::llround(velocity_dec_from_rpm(rpm)); }

// OUT1, which has the function of the case; 2010h sub 14h shows the same.
bool out(IsmkRig& rig) {
  const bool level = (rig.actuation.outputs & 1) != 0;
  EXPECT_EQ(rig.get(0x2010, 0x14) & 1, level ? 1 : 0);
  return level;
}

void enable_in(IsmkRig& rig, std::int8_t mode) {
  set(rig, 0x6060, 0, mode);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(5);
}

void ready(IsmkRig& rig) {
  EXPECT_TRUE(out(rig));
  enable_in(rig, 3);
  EXPECT_TRUE(out(rig));
  rig.device.drive().inject(drive::Cause::current_sensor, true);
  rig.run_ms(5);
  EXPECT_FALSE(out(rig));
  EXPECT_EQ(rig.actuation.outputs & 0x0C, 0x08U) << "OUT3, the lamp RUN, and OUT4, the lamp ERR";
}

void error(IsmkRig& rig) {
  EXPECT_FALSE(out(rig));
  rig.device.drive().inject(drive::Cause::current_sensor, true);
  rig.run_ms(5);
  EXPECT_TRUE(out(rig));
  rig.device.drive().inject(drive::Cause::current_sensor, false);
  rig.run_ms(5);
  EXPECT_TRUE(out(rig));
  rig.control(0x86);
  rig.run_ms(3);
  EXPECT_FALSE(out(rig));
}

// |error| < 6067h for the time 2508h sub 9.
void position_reached(IsmkRig& rig) {
  set(rig, 0x6081, 0, dec(300.0));
  set(rig, 0x2508, 9, 40);
  enable_in(rig, 1);
  set(rig, 0x607A, 0, 20000);
  rig.control(0x3F);
  rig.run_ms(20);
  EXPECT_FALSE(out(rig));
  ASSERT_GE(rig.run_until([&] { return !rig.device.drive().in_motion(); }, 1000.0), 0);
  rig.run_ms(30);
  EXPECT_FALSE(out(rig)) << "not for so long";
  rig.run_ms(20);
  EXPECT_TRUE(out(rig));
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_FALSE(out(rig));
  enable_in(rig, 6);
  EXPECT_FALSE(out(rig)) << "homing has no target position";
}

void zero_speed(IsmkRig& rig) {
  rig.run_ms(20);
  EXPECT_TRUE(out(rig)) << "standing, without power";
  enable_in(rig, 3);
  set(rig, 0x60FF, 0, dec(60.0));
  rig.run_ms(300);
  EXPECT_FALSE(out(rig));
  // 3 inc/ms is 2.75 rpm (ch. 5.2.1.3, 2010.18).
  set(rig, 0x60FF, 0, dec(4.0));
  rig.run_ms(300);
  EXPECT_FALSE(out(rig));
  set(rig, 0x60F9, 0x14, 50);
  set(rig, 0x60FF, 0, dec(1.5));
  rig.run_ms(40);
  EXPECT_FALSE(out(rig)) << "not for 60F9h sub 14h";
  rig.run_ms(300);
  EXPECT_TRUE(out(rig));
  set(rig, 0x2010, 0x18, 0);
  rig.run_ms(20);
  EXPECT_FALSE(out(rig));
}

void brake(IsmkRig& rig) {
  EXPECT_FALSE(out(rig));
  enable_in(rig, 3);
  EXPECT_TRUE(out(rig)) << "open";
  EXPECT_EQ(rig.actuation.outputs & 0x10, 0x10U) << "OUT5";
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.control(0x06);
  rig.run_ms(400);
  EXPECT_FALSE(out(rig));
  EXPECT_FALSE(rig.actuation.brake_released);
  set(rig, 0x2010, 0x0E, 0x10);
  rig.run_ms(3);
  EXPECT_TRUE(rig.actuation.brake_released) << "opened by simulating OUT5 (ch. 5.6.2.1)";
  EXPECT_FALSE(out(rig));
  set(rig, 0x2010, 0x0E, 0);
  set(rig, 0x2010, 0x0D, 0xFFEF);
  rig.run_ms(3);
  EXPECT_TRUE(rig.actuation.brake_released) << "OUT5 inverted";
}

void speed_reached(IsmkRig& rig) {
  for (const std::int8_t mode : speed_modes) {
    enable_in(rig, mode);
    set(rig, 0x60FF, 0, dec(600.0));
    rig.run_ms(3);
    EXPECT_FALSE(out(rig)) << int{mode};
    rig.run_ms(500);
    EXPECT_TRUE(out(rig)) << int{mode};
    rig.plant.lock_rotor(true);
    rig.run_ms(20);
    EXPECT_FALSE(out(rig)) << int{mode};
    rig.plant.lock_rotor(false);
    set(rig, 0x60FF, 0, 0);
    rig.control(0x06);
    rig.run_ms(1000);
  }
}

// One pulse of the index per turn.
void index(IsmkRig& rig) {
  enable_in(rig, 3);
  set(rig, 0x60FF, 0, dec(600.0));
  rig.run_ms(400);
  int pulses = 0;
  bool before = false;
  const std::int64_t start = rig.plant.position_counts();
  while (rig.plant.position_counts() - start < 5 * 65536) {
    rig.tick();
    const bool now = (rig.actuation.outputs & 1) != 0;
    if (now && !before) ++pulses;
    before = now;
  }
  EXPECT_EQ(pulses, 5);
}

void speed_limit(IsmkRig& rig) {
  set(rig, 0x607F, 0, dec(500.0));
  enable_in(rig, 4);
  set(rig, 0x6071, 0, 100);
  rig.run_ms(5);
  EXPECT_FALSE(out(rig));
  rig.run_ms(1000);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 500.0, 10.0);
  EXPECT_TRUE(out(rig));
  set(rig, 0x6071, 0, -100);
  rig.run_ms(20);
  EXPECT_FALSE(out(rig));
  // Only in torque mode: a position loop that corrects an error with a higher speed does not count.
  rig.control(0x06);
  rig.run_ms(1000);
  set(rig, 0x6065, 0, 0x7FFFFFFF);
  set(rig, 0x6081, 0, dec(500.0));
  enable_in(rig, 1);
  rig.plant.lock_rotor(true);
  set(rig, 0x607A, 0, rig.get(0x6063) + 600000);
  rig.control(0x1F);
  rig.run_ms(400);
  EXPECT_TRUE(rig.device.drive().loops().velocity_limited);
  EXPECT_FALSE(out(rig));
}

void enabled(IsmkRig& rig) {
  EXPECT_FALSE(out(rig));
  enable_in(rig, 1);
  EXPECT_TRUE(out(rig));
  rig.control(0x06);
  rig.run_ms(400);
  EXPECT_FALSE(out(rig));
}

void position_limit(IsmkRig& rig) {
  rig.plant.force_input(0, true);
  rig.plant.force_input(1, true);
  set(rig, 0x2010, 3, 0x0010);
  set(rig, 0x2010, 4, 0x0020);
  rig.run_ms(3);
  EXPECT_FALSE(out(rig));
  for (const int input : {0, 1}) {
    rig.plant.force_input(input, false);
    rig.run_ms(3);
    EXPECT_TRUE(out(rig));
    rig.plant.force_input(input, true);
    rig.run_ms(3);
    EXPECT_FALSE(out(rig));
  }
  // A software limit, after home is known (ch. 5.6.1).
  set(rig, 0x607D, 1, 5000);
  set(rig, 0x607D, 2, -5000);
  set(rig, 0x6081, 0, dec(300.0));
  set(rig, 0x6098, 0, 35);
  enable_in(rig, 6);
  rig.control(0x1F);
  rig.run_ms(10);
  ASSERT_TRUE(rig.device.drive().homed());
  EXPECT_FALSE(out(rig));
  rig.control(0x0F);
  set(rig, 0x6060, 0, 1);
  set(rig, 0x607A, 0, 9000);
  rig.run_ms(3);
  rig.control(0x3F);
  rig.run_ms(500);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 5000.0, 3.0);
  EXPECT_TRUE(out(rig));
}

void home_found(IsmkRig& rig) {
  set(rig, 0x6098, 0, 33);
  enable_in(rig, 6);
  EXPECT_FALSE(out(rig));
  rig.control(0x1F);
  rig.run_ms(10);
  EXPECT_FALSE(out(rig));
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().homed(); }, 3000.0), 0);
  rig.run_ms(3);
  EXPECT_TRUE(out(rig));
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_TRUE(out(rig));
}

void torque_reached(IsmkRig& rig) {
  rig.plant.lock_rotor(true);
  enable_in(rig, 4);
  // A tenth of the peak current, 204.8 DEC, is 0.3 of the rated torque of a motor whose rated torque is a third of it.
  set(rig, 0x6071, 0, 300);
  rig.run_ms(300);
  EXPECT_FALSE(out(rig)) << "60F5h sub 6 is 0";
  set(rig, 0x60F5, 6, 195);
  rig.run_ms(95);
  EXPECT_FALSE(out(rig)) << "not for 60F5h sub 7 = 100 ms";
  rig.run_ms(10);
  EXPECT_TRUE(out(rig));
  set(rig, 0x60F5, 6, 215);
  rig.run_ms(3);
  EXPECT_FALSE(out(rig));
  set(rig, 0x60F5, 6, 195);
  set(rig, 0x60F5, 7, 0);
  set(rig, 0x6071, 0, -300);
  rig.run_ms(50);
  EXPECT_TRUE(out(rig)) << "its amount";
}

// The tables have a separate test.
void reached_index(IsmkRig& rig, std::size_t bit) {
  constexpr std::array<std::uint16_t, 3> input{0x0400, 0x0800, 0x8002};
  constexpr std::array<std::uint8_t, 3> position{0x02, 0x03, 0x10};  // Din_Pos[1], [2], [4]
  constexpr std::array<std::uint8_t, 3> speed{0x06, 0x07, 0x14};
  set(rig, 0x2010, 3, input[bit]);
  set(rig, 0x2020, position[bit], 10000);
  set(rig, 0x2020, speed[bit], dec(300.0));
  set(rig, 0x2020, 0x05, dec(300.0));
  enable_in(rig, 1);
  EXPECT_FALSE(out(rig));
  rig.plant.force_input(0, true);
  rig.run_ms(10);
  EXPECT_FALSE(out(rig)) << "on the way";
  rig.run_ms(400);
  EXPECT_TRUE(out(rig));
  rig.plant.force_input(0, false);
  rig.run_ms(10);
  EXPECT_FALSE(out(rig)) << "leaves for Din_Pos[0]";
}

// There are no inputs for safe torque off.
void safe_torque_off(IsmkRig& rig) {
  EXPECT_FALSE(out(rig));
  enable_in(rig, 3);
  EXPECT_FALSE(out(rig));
}

using Case = std::function<void(IsmkRig&)>;

const std::map<std::uint16_t, Case> cases{
    {0x0001, ready},
    {0x0002, error},
    {0x0004, position_reached},
    {0x0008, zero_speed},
    {0x0010, brake},
    {0x0020, speed_reached},
    {0x0040, index},
    {0x0080, speed_limit},
    {0x0100, enabled},
    {0x0200, position_limit},
    {0x0400, home_found},
    {0x0800, torque_reached},
    {0x1000, [](IsmkRig& rig) { reached_index(rig, 0); }},
    {0x2000, [](IsmkRig& rig) { reached_index(rig, 1); }},
    {0x4000, [](IsmkRig& rig) { reached_index(rig, 2); }},
    {0x8001, safe_torque_off},
};

// The codes in the order of the manual (ch. 7.9).
constexpr auto printed = std::to_array<std::uint16_t>({0x0001, 0x0002, 0x0004, 0x0008, 0x0010, 0x0020, 0x0040, 0x0080,
                                                       0x0100, 0x0200, 0x0400, 0x0800, 0x1000, 0x2000, 0x4000, 0x8001});

TEST(IsmkOutputs, EveryFunctionOfTheManual) {
  EXPECT_EQ(output_functions.size(), printed.size());
  for (const std::uint16_t code : printed) {
    const drive::OutputFunctionRow* row = drive::find_function(output_functions, code);
    ASSERT_NE(row, nullptr) << std::hex << code;
    SCOPED_TRACE(testing::Message() << std::hex << code);
    const auto found = cases.find(code);
    ASSERT_NE(found, cases.end()) << "no test";
    IsmkRig rig;
    set(rig, 0x2010, 0x0F, code);
    rig.run_ms(3);
    found->second(rig);
  }
}

TEST(IsmkOutputs, OnlyCodesOfTheManual) {
  IsmkRig rig;
  for (const int code : {0x0003, 0x8000, 0x8002, 0x6000, 0xFFFF}) {
    EXPECT_EQ(rig.set(0x2010, 0x0F, code), AbortCode::value_invalid);
    EXPECT_EQ(rig.set(0x2010, 0x10, code), AbortCode::value_invalid);
  }
}

// A normal start shows ready on OUT1 and OUT3, not the 000Ah of the manual's drive, which has an alarm (C1).
TEST(IsmkOutputs, AtStart) {
  IsmkRig rig;
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x2010, 0x14), 0x05);
  EXPECT_EQ(rig.actuation.outputs, 0x05U);
  rig.device.drive().inject(drive::Cause::current_sensor, true);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x2010, 0x14), 0x0A);
}

TEST(IsmkOutputs, PolarityAndSimulation) {
  IsmkRig rig;
  for (unsigned output = 0; output < 5; ++output) {
    const std::int64_t bit = std::int64_t{1} << output;
    const bool on = output == 0 || output == 2;
    for (int i = 0; i < 4; ++i) {
      const bool direct = (i & 1) != 0;
      const bool simulated = (i & 2) != 0;
      set(rig, 0x2010, 0x0D, direct ? 0xFFFF : 0xFFFF & ~bit);
      set(rig, 0x2010, 0x0E, simulated ? bit : 0);
      rig.run_ms(3);
      const std::int64_t expected = (on == direct) || simulated ? 0x05 | bit : 0x05 & ~bit;
      EXPECT_EQ(rig.get(0x2010, 0x14), expected) << output << " " << i;
      EXPECT_EQ(rig.actuation.outputs, static_cast<std::uint32_t>(expected)) << output << " " << i;
    }
    set(rig, 0x2010, 0x0D, 0xFFFF);
    set(rig, 0x2010, 0x0E, 0);
  }
}

}  // namespace
}  // namespace ismk_outputs_test
}  // namespace servodrome
