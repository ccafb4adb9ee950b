#include <functional>
#include <gtest/gtest.h>
#include <map>

#include "ismk_rig.hpp"

// The functions of the iSMK's digital inputs (manual, ch. 7.9): every code has a test case here.
namespace servodrome {
namespace ismk_inputs_test {
namespace {

using dictionary::AbortCode;
using drive::PowerState;
using products::ismk::input_functions;
using products::ismk::velocity_dec_from_rpm;
using test::IsmkRig;

constexpr std::uint8_t di1 = 0;
constexpr std::uint8_t di2 = 1;

void set(IsmkRig& rig, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub} << " = " << value;
}

void assign(IsmkRig& rig, std::uint8_t input, std::uint16_t code) {
  set(rig, 0x2010, static_cast<std::uint8_t>(3 + input), code);
}

void wire(IsmkRig& rig, std::uint8_t input, bool level) {
  rig.plant.force_input(input, level);
  rig.run_ms(3);
}

PowerState state(IsmkRig& rig) { return rig.device.drive().state(); }
double rpm(IsmkRig& rig) { return rig.plant.velocity_rpm(); }
std::int64_t dec(double rpm) { return std::llround(velocity_dec_from_rpm(rpm)); }

// Turns at `rpm` in mode 3.
void turn(IsmkRig& rig, double target_rpm) {
  set(rig, 0x6060, 0, 3);
  set(rig, 0x60FF, 0, dec(target_rpm));
  ASSERT_TRUE(rig.enable());
  rig.run_ms(400);
  ASSERT_NEAR(rpm(rig), target_rpm, 0.02 * std::abs(target_rpm));
}

// Homes at the present position.
void home(IsmkRig& rig) {
  set(rig, 0x6060, 0, 6);
  set(rig, 0x6098, 0, 35);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(5);
  ASSERT_TRUE(rig.device.drive().homed());
  rig.control(0x06);
  rig.run_ms(5);
}

void enable(IsmkRig& rig) {
  set(rig, 0x6060, 0, 3);
  rig.run_ms(3);
  EXPECT_NE(rig.status() & 0x200, 0) << "the bus enables";
  assign(rig, di1, 0x0001);
  rig.run_ms(3);
  EXPECT_EQ(rig.status() & 0x200, 0) << "an input enables";
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6040), 0x2F);
  EXPECT_EQ(state(rig), PowerState::operation_enabled);
  // It acts on a change; between changes the bus can command.
  rig.control(0x3F);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x6040), 0x3F);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x6040), 0x06);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
  set(rig, 0x2020, 0x0F, 0x4F);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6040), 0x4F);
  // A function that is removed acts like an input that is switched off.
  assign(rig, di1, 0);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
}

void reset_errors(IsmkRig& rig) {
  assign(rig, di1, 0x0002);
  ASSERT_TRUE(rig.enable());
  rig.device.drive().inject(drive::Cause::current_sensor, true);
  rig.run_ms(5);
  ASSERT_EQ(state(rig), PowerState::fault);
  wire(rig, di1, true);
  EXPECT_EQ(state(rig), PowerState::fault) << "the cause is there";
  rig.device.drive().inject(drive::Cause::current_sensor, false);
  rig.run_ms(5);
  EXPECT_EQ(state(rig), PowerState::fault) << "no edge";
  wire(rig, di1, false);
  rig.control(0x06);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6040), 0x86);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x6040), 0x06);
}

// The release of an input clears its bit only. The rest of the stored controlword is an old command, which must not act
// again: here the enabling that the drive refused because of the quick stop.
void expect_release_commands_nothing(std::uint16_t code, std::int64_t mode, std::int64_t speed) {
  IsmkRig rig;
  assign(rig, di1, 0x1000);
  assign(rig, di2, code);
  set(rig, 0x605A, 0, 5);
  set(rig, 0x6060, 0, mode);
  set(rig, 0x60FF, 0, speed);
  wire(rig, di1, true);
  rig.control(0x06);
  rig.run_ms(300);
  rig.control(0x0F);
  rig.run_ms(300);
  ASSERT_EQ(state(rig), PowerState::quick_stop_active);
  wire(rig, di1, false);
  wire(rig, di2, true);
  wire(rig, di2, false);
  rig.run_ms(300);
  EXPECT_EQ(state(rig), PowerState::quick_stop_active) << std::hex << code;
  EXPECT_EQ(rig.get(0x6040), 0x0F);
  EXPECT_NEAR(rpm(rig), 0.0, 0.5);
  rig.control(0x0F);
  rig.run_ms(50);
  EXPECT_EQ(state(rig), PowerState::operation_enabled) << "a command of the master";
}

TEST(IsmkInputsRelease, CommandsNothing) {
  expect_release_commands_nothing(0x0002, 3, dec(100));  // reset errors
  expect_release_commands_nothing(0x4000, 1, 0);         // activate
}

void mode_control(IsmkRig& rig) {
  EXPECT_EQ(rig.get(0x2020, 0x0D), -3);
  EXPECT_EQ(rig.get(0x2020, 0x0E), -4);
  assign(rig, di1, 0x0004);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x6060), -3);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6060), -4);
  set(rig, 0x2020, 0x0E, 1);
  wire(rig, di1, false);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6060), 1);
  EXPECT_EQ(rig.device.drive().mode(), drive::Mode::profile_position);
}

// Under a load torque a velocity loop without integral runs slower than commanded.
void integral_off(IsmkRig& rig) {
  assign(rig, di1, 0x0008);
  turn(rig, 300.0);
  rig.plant.set_external_torque_nm(0.3);
  rig.run_ms(500);
  EXPECT_NEAR(rpm(rig), 300.0, 1.0);
  wire(rig, di1, true);
  rig.run_ms(500);
  const double slow = rpm(rig);
  EXPECT_LT(slow, 298.0);
  wire(rig, di1, false);
  rig.run_ms(500);
  EXPECT_NEAR(rpm(rig), 300.0, 1.0);
}

// Normally closed: 0 is the limit (ch. 5.6.1). That direction is blocked, the other is not.
void limit(IsmkRig& rig, std::uint16_t code, int sign, std::int64_t bit_of_60fd, std::uint8_t latched) {
  set(rig, 0x605A, 0, 6);
  wire(rig, di1, true);
  assign(rig, di1, code);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x60FD), 0);
  turn(rig, sign * 300.0);
  rig.plant.force_input(di1, false);
  const std::int64_t met = rig.plant.position_counts();
  rig.run_ms(60);
  EXPECT_EQ(rig.get(0x60FD), bit_of_60fd);
  EXPECT_NEAR(rpm(rig), 0.0, 0.5);
  EXPECT_EQ(state(rig), PowerState::operation_enabled);
  EXPECT_NE(rig.status() & 0x800, 0) << "internal limit";
  EXPECT_EQ(rig.status() & 0x400, 0) << "the target speed is not reached (ch. 5.2.1.2)";
  EXPECT_EQ(rig.get(0x2010, latched), met);
  // By 6085h: 300 rpm at 610 rps/s is 8 ms and 1340 counts, begun within two cycles of 330 counts.
  EXPECT_NEAR(static_cast<double>(std::abs(rig.plant.position_counts() - met)), 1670.0, 340.0);
  set(rig, 0x60FF, 0, dec(-sign * 300.0));
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), -sign * 300.0, 6.0);
  EXPECT_EQ(rig.status() & 0x800, 0) << "on the way back (Table 5-5)";
  // Back on the free side of the switch.
  wire(rig, di1, true);
  set(rig, 0x60FF, 0, dec(sign * 300.0));
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), sign * 300.0, 6.0);
  EXPECT_EQ(rig.get(0x2010, latched), met) << "released, not met";
  // Off the switch the direction is free, but a switch that opens does not count as a command; a new target does.
  wire(rig, di1, false);
  rig.run_ms(60);
  EXPECT_NEAR(rpm(rig), 0.0, 0.5);
  wire(rig, di1, true);
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), 0.0, 0.5);
  set(rig, 0x60FF, 0, dec(sign * 299.0));
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), sign * 299.0, 6.0);
}

void positive_limit(IsmkRig& rig) { limit(rig, 0x0010, 1, 2, 0x1B); }
void negative_limit(IsmkRig& rig) { limit(rig, 0x0020, -1, 1, 0x1C); }

void home_signal(IsmkRig& rig) {
  assign(rig, di1, 0x0040);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x60FD), 4);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x60FD), 0);
  // The switch's edge is home (method 19: leaves positive, comes back on it, home at the edge).
  set(rig, 0x6060, 0, 6);
  set(rig, 0x6098, 0, 19);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(200);
  wire(rig, di1, true);
  rig.run_ms(300);
  wire(rig, di1, false);
  rig.run_ms(400);
  EXPECT_TRUE(rig.device.drive().homed());
}

void invert_direction(IsmkRig& rig) {
  assign(rig, di1, 0x0080);
  turn(rig, 300.0);
  wire(rig, di1, true);
  rig.run_ms(400);
  EXPECT_NEAR(rpm(rig), -300.0, 6.0);
  EXPECT_EQ(rig.get(0x60FF), dec(300.0));
  wire(rig, di1, false);
  rig.run_ms(400);
  EXPECT_NEAR(rpm(rig), 300.0, 6.0);
  set(rig, 0x6060, 0, -3);
  rig.run_ms(100);
  EXPECT_NEAR(rpm(rig), 300.0, 6.0);
  wire(rig, di1, true);
  rig.run_ms(200);
  EXPECT_NEAR(rpm(rig), -300.0, 6.0) << "immediate speed";
  wire(rig, di1, false);
  rig.control(0x06);
  rig.run_ms(500);
  rig.plant.lock_rotor(true);
  set(rig, 0x6060, 0, 4);
  set(rig, 0x6071, 0, 200);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(200);
  const double torque = rig.plant.torque_nm();
  EXPECT_GT(torque, 0.1);
  wire(rig, di1, true);
  rig.run_ms(200);
  EXPECT_NEAR(rig.plant.torque_nm(), -torque, 0.05 * torque) << "torque";
}

// The index bits select from the tables; the tables have a separate test.
void speed_index(IsmkRig& rig, std::uint16_t code, std::size_t bit) {
  constexpr std::array<std::uint8_t, 3> table{0x06, 0x07, 0x14};  // Din_Speed[1], [2], [4]
  set(rig, 0x2020, 0x05, dec(100.0));
  set(rig, 0x2020, table[bit], dec(-200.0));
  assign(rig, di1, code);
  set(rig, 0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(300);
  EXPECT_NEAR(rpm(rig), 100.0, 2.0);
  wire(rig, di1, true);
  rig.run_ms(300);
  EXPECT_NEAR(rpm(rig), -200.0, 4.0);
}

void position_index(IsmkRig& rig, std::uint16_t code, std::size_t bit) {
  constexpr std::array<std::uint8_t, 3> position{0x02, 0x03, 0x10};  // Din_Pos[1], [2], [4]
  constexpr std::array<std::uint8_t, 3> speed{0x06, 0x07, 0x14};
  set(rig, 0x2020, position[bit], 20000);
  set(rig, 0x2020, speed[bit], dec(300.0));
  assign(rig, di1, code);
  set(rig, 0x6060, 0, 1);
  set(rig, 0x6040, 0, 0x06);
  rig.run_ms(3);
  set(rig, 0x6040, 0, 0x2F);
  rig.run_ms(200);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 0.0, 2.0) << "nothing has changed";
  wire(rig, di1, true);
  rig.run_ms(400);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 20000.0, 2.0);
}

void quick_stop(IsmkRig& rig) {
  set(rig, 0x605A, 0, 6);
  assign(rig, di1, 0x1000);
  turn(rig, 300.0);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6040) & 0x04, 0);
  EXPECT_EQ(state(rig), PowerState::quick_stop_active);
  rig.run_ms(50);
  EXPECT_NEAR(rpm(rig), 0.0, 0.5);
  wire(rig, di1, false);
  EXPECT_EQ(state(rig), PowerState::quick_stop_active);
  rig.control(0x06);
  rig.run_ms(5);
  rig.control(0x0F);
  rig.run_ms(300);
  EXPECT_NEAR(rpm(rig), 300.0, 6.0);
}

void start_homing(IsmkRig& rig) {
  set(rig, 0x6060, 0, 3);
  set(rig, 0x6098, 0, 33);
  assign(rig, di1, 0x2000);
  rig.plant.force_input(di1, true);
  for (int i = 0; i < 32; ++i) {
    rig.tick();
    EXPECT_EQ(rig.get(0x6060), 3) << "not enabled";
  }
  wire(rig, di1, false);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(20);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6060), 6);
  EXPECT_EQ(rig.get(0x6040) & 0x10, 0x10);
  ASSERT_GE(rig.run_until([&] { return rig.get(0x6060) == 3; }, 5000.0), 0);
  EXPECT_TRUE(rig.device.drive().homed());
  EXPECT_EQ(rig.get(0x6040) & 0x10, 0);
  rig.run_ms(5);
  EXPECT_EQ(state(rig), PowerState::operation_enabled);
  EXPECT_EQ(rig.device.drive().mode(), drive::Mode::profile_velocity);
  EXPECT_NE(rig.status() & 0x8000, 0);
  // Cancelled when the drive is switched off.
  wire(rig, di1, false);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6060), 6);
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x6060), 3);
  // ... and completed when the function is removed.
  wire(rig, di1, false);
  ASSERT_TRUE(rig.enable());
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6060), 6);
  assign(rig, di1, 0);
  ASSERT_GE(rig.run_until([&] { return rig.get(0x6060) == 3; }, 5000.0), 0);
  // The bus may select another mode meanwhile.
  assign(rig, di1, 0x2000);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x6060), 6);
  set(rig, 0x6060, 0, 1);
  rig.run_ms(20);
  EXPECT_EQ(rig.get(0x6060), 1);
}

void activate(IsmkRig& rig) {
  assign(rig, di1, 0x4000);
  set(rig, 0x6060, 0, 1);
  set(rig, 0x6081, 0, dec(300.0));
  set(rig, 0x607A, 0, 10000);
  ASSERT_TRUE(rig.enable());
  rig.control(0x2F);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x6040), 0x3F);
  rig.run_ms(300);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 10000.0, 2.0);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x6040), 0x2F);
  set(rig, 0x607A, 0, -10000);
  wire(rig, di1, true);
  rig.run_ms(400);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), -10000.0, 2.0);
}

// The function has no effect in this drive: the input is only read.
void without_effect(IsmkRig& rig, std::uint16_t code) {
  assign(rig, di1, code);
  turn(rig, 300.0);
  wire(rig, di1, true);
  rig.run_ms(100);
  EXPECT_EQ(rig.get(0x2010, 0x0A), 1);
  EXPECT_NEAR(rpm(rig), 300.0, 6.0);
  EXPECT_EQ(rig.get(0x6040), 0x0F);
}

// The pointer to the active set of gains (ch. 7.9); the sets have a separate test.
void gain_index(IsmkRig& rig, std::uint16_t code, std::int64_t pointer) {
  assign(rig, di1, code);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x60F9, 0x28), 0);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x60F9, 0x28), pointer);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x60F9, 0x28), 0);
}

void motor_error(IsmkRig& rig) {
  assign(rig, di1, 0x8100);
  turn(rig, 300.0);
  wire(rig, di1, true);
  EXPECT_EQ(state(rig), PowerState::fault);
  EXPECT_EQ(rig.get(0x2601), 0x2000);
  rig.control(0x86);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::fault) << "still there";
  wire(rig, di1, false);
  rig.control(0x06);
  rig.control(0x86);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
}

void pre_enable(IsmkRig& rig) {
  assign(rig, di1, 0x8200);
  set(rig, 0x6060, 0, 3);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x60FD), 0x10) << "interlock";
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on) << "no alarm before it is to be enabled";
  rig.control(0x0F);
  for (int i = 0; i < 32; ++i) {
    rig.tick();
    EXPECT_FALSE(rig.actuation.pwm_enabled);
  }
  EXPECT_EQ(state(rig), PowerState::fault);
  EXPECT_EQ(rig.get(0x2602), 0x0100);
  rig.control(0x06);
  rig.control(0x86);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
  wire(rig, di1, true);
  EXPECT_EQ(rig.get(0x60FD), 0);
  turn(rig, 300.0);
  wire(rig, di1, false);
  EXPECT_EQ(state(rig), PowerState::fault);
}

void fast_capture(IsmkRig& rig, std::uint16_t code, std::size_t unit) {
  const auto caught = [&] { return rig.device.capture(unit); };
  assign(rig, di1, code);
  turn(rig, 300.0);
  EXPECT_FALSE(caught().rising || caught().falling);
  rig.plant.force_input(di1, true);
  const std::int64_t rose = rig.plant.position_counts();
  rig.run_ms(3);
  EXPECT_TRUE(caught().rising);
  EXPECT_FALSE(caught().falling);
  EXPECT_EQ(caught().rising_position, rose);
  rig.plant.force_input(di1, false);
  const std::int64_t fell = rig.plant.position_counts();
  rig.run_ms(3);
  EXPECT_TRUE(caught().falling);
  EXPECT_EQ(caught().falling_position, fell);
  wire(rig, di1, true);
  wire(rig, di1, false);
  EXPECT_EQ(caught().rising_position, rose) << "not before it is set to 0";
  rig.device.rearm_capture(unit, true);
  EXPECT_FALSE(caught().rising);
  EXPECT_TRUE(caught().falling);
  rig.plant.force_input(di1, true);
  const std::int64_t again = rig.plant.position_counts();
  rig.run_ms(3);
  wire(rig, di1, false);
  EXPECT_TRUE(caught().rising);
  EXPECT_EQ(caught().rising_position, again);
  EXPECT_EQ(caught().falling_position, fell);
  const auto other = rig.device.capture(1 - unit);
  EXPECT_FALSE(other.rising || other.falling);
}

using Case = std::function<void(IsmkRig&)>;
template <typename... Arguments>
Case with(void (*function)(IsmkRig&, Arguments...), std::type_identity_t<Arguments>... arguments) {
  return [=](IsmkRig& rig) { function(rig, arguments...); };
}

const std::map<std::uint16_t, Case> cases{
    {0x0001, enable},
    {0x0002, reset_errors},
    {0x0004, mode_control},
    {0x0008, integral_off},
    {0x0010, positive_limit},
    {0x0020, negative_limit},
    {0x0040, home_signal},
    {0x0080, invert_direction},
    {0x0100, with(speed_index, 0x0100, 0)},
    {0x0200, with(speed_index, 0x0200, 1)},
    {0x8001, with(speed_index, 0x8001, 2)},
    {0x0400, with(position_index, 0x0400, 0)},
    {0x0800, with(position_index, 0x0800, 1)},
    {0x8002, with(position_index, 0x8002, 2)},
    {0x1000, quick_stop},
    {0x2000, start_homing},
    {0x4000, activate},
    {0x8004, with(without_effect, 0x8004)},
    {0x8008, with(without_effect, 0x8008)},
    {0x8010, with(without_effect, 0x8010)},
    {0x8020, with(gain_index, 0x8020, 1)},
    {0x8040, with(gain_index, 0x8040, 2)},
    {0x8080, with(without_effect, 0x8080)},
    {0x8100, motor_error},
    {0x8200, pre_enable},
    {0x8400, with(fast_capture, 0x8400, 0)},
    {0x8800, with(fast_capture, 0x8800, 1)},
};

// The codes in the order of the manual (ch. 7.9).
constexpr auto printed = std::to_array<std::uint16_t>(
    {0x0001, 0x0002, 0x0004, 0x0008, 0x0010, 0x0020, 0x0040, 0x0080, 0x0100, 0x0200, 0x0400, 0x0800, 0x1000, 0x2000,
     0x4000, 0x8001, 0x8002, 0x8004, 0x8008, 0x8010, 0x8020, 0x8040, 0x8080, 0x8100, 0x8200, 0x8400, 0x8800});

TEST(IsmkInputs, EveryFunctionOfTheManual) {
  EXPECT_EQ(input_functions.size(), printed.size());
  for (const std::uint16_t code : printed) {
    const drive::InputFunctionRow* row = drive::find_function(input_functions, code);
    ASSERT_NE(row, nullptr) << std::hex << code;
    SCOPED_TRACE(testing::Message() << std::hex << code);
    const auto found = cases.find(code);
    ASSERT_NE(found, cases.end()) << "no test";
    IsmkRig rig;
    rig.run_ms(3);
    found->second(rig);
  }
}

TEST(IsmkInputs, OnlyCodesOfTheManual) {
  IsmkRig rig;
  for (std::uint32_t code = 0; code <= 0xFFFF; ++code) {
    const bool known = code == 0 || std::find(printed.begin(), printed.end(), code) != printed.end();
    if (!known && (code & 0xFF) > 0x12 && std::popcount(code) > 2) continue;
    EXPECT_EQ(rig.set(0x2010, 3, code), known ? AbortCode::none : AbortCode::value_invalid) << std::hex << code;
  }
}

// Result = (input XNOR polarity) OR simulation, for each input separately.
TEST(IsmkInputs, PolarityAndSimulation) {
  IsmkRig rig;
  for (std::uint8_t input = 0; input < 8; ++input) {
    const std::int64_t bit = std::int64_t{1} << input;
    for (int i = 0; i < 8; ++i) {
      const bool level = (i & 1) != 0;
      const bool direct = (i & 2) != 0;
      const bool simulated = (i & 4) != 0;
      set(rig, 0x2010, 1, direct ? 0xFFFF : 0xFFFF & ~bit);
      set(rig, 0x2010, 2, simulated ? bit : 0);
      wire(rig, input, level);
      EXPECT_EQ(rig.get(0x2010, 0x0A), (level == direct) || simulated ? bit : 0) << int{input} << " " << i;
    }
    set(rig, 0x2010, 1, 0xFFFF);
    wire(rig, input, false);
  }
}

TEST(IsmkInputs, AFunctionSeesTheResult) {
  IsmkRig rig;
  set(rig, 0x6060, 0, 3);
  assign(rig, di1, 0x0001);
  rig.run_ms(3);
  set(rig, 0x2010, 2, 1);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::operation_enabled) << "simulated";
  set(rig, 0x2010, 2, 0);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
  set(rig, 0x2010, 1, 0xFFFE);
  rig.run_ms(3);
  EXPECT_EQ(state(rig), PowerState::operation_enabled) << "inverted";
  wire(rig, di1, true);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
  // A normally closed limit that is inverted: high is the limit.
  assign(rig, di1, 0x0010);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x60FD), 2);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x60FD), 0);
}

// Simulated edges act like real ones, for example those of a limit switch whose position is latched.
TEST(IsmkInputs, SimulationCatchesLimitPositions) {
  IsmkRig rig;
  assign(rig, di1, 0x0010);
  set(rig, 0x2010, 2, 1);
  turn(rig, 300.0);
  set(rig, 0x2010, 2, 0);
  const std::int64_t here = rig.plant.position_counts();
  rig.run_ms(20);
  EXPECT_NEAR(static_cast<double>(rig.get(0x2010, 0x1B)), static_cast<double>(here), 330.0);  // a cycle is 327 counts
  EXPECT_NE(rig.get(0x2010, 0x1B), 0);
}

TEST(IsmkInputs, WithoutFunctionNothingIsBlocked) {
  IsmkRig rig;  // Din4 and Din5 are not limit switches by factory setting (C11)
  turn(rig, 300.0);
  EXPECT_EQ(rig.get(0x60FD), 0);
}

// 605Ah has no effect on limit switches except for the ramp of 6085h: 2 would switch the motor off (ch. 7.12).
TEST(IsmkInputs, TwoInputsOfOneFunctionAreOrEd) {
  IsmkRig rig;
  set(rig, 0x6060, 0, 3);
  assign(rig, di1, 0x0001);
  assign(rig, di2, 0x0001);
  wire(rig, di1, true);
  wire(rig, di2, true);
  wire(rig, di1, false);
  EXPECT_EQ(state(rig), PowerState::operation_enabled);
  wire(rig, di2, false);
  EXPECT_EQ(state(rig), PowerState::ready_to_switch_on);
}

// After homing, a limit switch that is met is an alarm if 2010h sub 19h is 0 (Table 5-16); during homing it is not.
TEST(IsmkInputs, LimitAlarmOnlyAfterHoming) {
  for (const bool homed : {false, true}) {
    for (const int limit_function : {0, 1}) {
      IsmkRig rig;
      set(rig, 0x2010, 0x19, limit_function);
      wire(rig, di1, true);
      assign(rig, di1, 0x0010);
      rig.run_ms(3);
      if (homed) home(rig);
      turn(rig, 300.0);
      wire(rig, di1, false);
      rig.run_ms(100);
      const bool alarm = homed && limit_function == 0;
      EXPECT_EQ(rig.get(0x2602), alarm ? 0x0200 : 0);
      EXPECT_EQ(state(rig) == PowerState::fault, alarm);
      if (!alarm) continue;
      // The axis can leave it: the alarm is for the moment at which the switch is met, not for its level.
      rig.control(0x06);
      rig.control(0x86);
      rig.run_ms(3);
      turn(rig, -300.0);
    }
  }
}

// Homing is expected to meet the switch: no alarm, even if home was known before.
TEST(IsmkInputs, NoLimitAlarmWhileHoming) {
  IsmkRig rig;
  set(rig, 0x2010, 0x19, 0);
  wire(rig, di1, true);
  assign(rig, di1, 0x0020);
  rig.run_ms(3);
  home(rig);
  set(rig, 0x6098, 0, 17);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(300);
  ASSERT_LT(rpm(rig), -50.0);
  wire(rig, di1, false);
  EXPECT_EQ(rig.get(0x2602), 0);
  EXPECT_EQ(state(rig), PowerState::operation_enabled);
  rig.run_ms(200);
  wire(rig, di1, true);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().homed(); }, 3000.0), 0);
  EXPECT_EQ(rig.get(0x2602), 0);
}

}  // namespace
}  // namespace ismk_inputs_test
}  // namespace servodrome
