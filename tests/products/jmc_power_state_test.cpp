#include <functional>
#include <gtest/gtest.h>
#include <vector>

#include "jmc_bus.hpp"

// The state machine of the JMC EC drives ('CiA402 Protocol state machine', objects 6040h and 6041h), their option
// codes, limits and the brake's output.
namespace servodrome {
namespace jmc_power_state_test {
namespace {

using dictionary::AbortCode;
using drive::PowerState;
using test::JmcBus;
using test::JmcRig;
using Out = JmcBus::Out;
using In = JmcBus::In;

struct Step {
  std::uint16_t controlword;
  int state;  // statusword bits 0 to 3, 5, 6
};

TEST(JmcPowerState, TheTableOfTransitions) {
  const std::vector<std::vector<Step>> walks{
      {{0x06, 0x21}, {0x07, 0x23}, {0x0F, 0x27}, {0x07, 0x23}, {0x06, 0x21}, {0x00, 0x40}},
      {{0x0F, 0x40}, {0x07, 0x40}, {0x06, 0x21}, {0x0F, 0x27}},  // only 06h leaves disabled (D-08)
      {{0x06, 0x21}, {0x0F, 0x27}, {0x06, 0x21}},
      {{0x06, 0x21}, {0x0F, 0x27}, {0x00, 0x40}},
      {{0x06, 0x21}, {0x0F, 0x27}, {0x02, 0x40}},  // a quick stop ends in disabled (C-31)
      {{0x06, 0x21}, {0x07, 0x23}, {0x02, 0x40}},
      {{0x06, 0x21}, {0x07, 0x23}, {0x00, 0x40}},
      {{0x06, 0x21}, {0x02, 0x40}},
  };
  for (const auto& walk : walks) {
    JmcRig rig;
    rig.run_ms(2);
    EXPECT_EQ(rig.status() & 0x6F, 0x40);
    for (const Step& step : walk) {
      rig.control(step.controlword);
      rig.run_ms(400);  // the brake's times
      EXPECT_EQ(rig.status() & 0x6F, step.state) << std::hex << step.controlword;
    }
  }
}

// A master sends its controlword in every cycle: the brake's time starts only once.
TEST(JmcPowerState, AControlwordInEveryCycleDisables) {
  JmcRig rig;
  rig.run_ms(2);
  ASSERT_TRUE(rig.enable());
  for (int ms = 0; ms < 200; ++ms) {
    rig.control(0x00);
    rig.run_ms(1);
  }
  EXPECT_EQ(rig.status() & 0x6F, 0x40);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
}

// "Ready holds the brake; can be started releases it and enables the shaft" (Chart 129, C-30).
TEST(JmcPowerState, EnergisedInSwitchedOn) {
  plant::Parameters parameters = test::jmc_plant();
  parameters.load.gravity_torque_nm = 0.15;
  parameters.motor.brake_torque_nm = 2.0;
  JmcRig rig(parameters, test::jmc_settings());
  rig.run_ms(2);
  rig.control(0x06);
  rig.run_ms(50);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.brake_released);
  rig.control(0x07);
  rig.run_ms(2);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_TRUE(rig.actuation.brake_released);
  const std::int64_t before = rig.get(0x6063);
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), static_cast<double>(before), 5.0) << "held against the load";
  EXPECT_NEAR(rig.plant.torque_nm(), 0.15, 0.03);
  EXPECT_EQ(rig.status() & 0x6F, 0x23);
  // The drive follows targets from Operation enabled on.
  rig.open_limits();
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, 20000);
  rig.run_ms(100);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 3.0);
  rig.control(0x0F);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 8.0);
  // 605Ch = 1: slows down, then holds in Switched on with the brake open.
  rig.control(0x07);
  bool closed = false;
  ASSERT_GE(rig.run_until(
                [&] {
                  closed |= !rig.actuation.brake_released;
                  return (rig.status() & 0x6F) == 0x23;
                },
                500.0),
            0);
  rig.run_ms(300);
  EXPECT_FALSE(closed);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
}

struct StopCase {
  std::uint16_t object;
  int code;
  std::uint16_t controlword;
  double deceleration;  // 0: no ramp
  int state;
};

// 605Ah to 605Ch at 300 rpm; 400000 is 6084h, 800000 6085h (Tables 158 to 160).
TEST(JmcPowerState, OptionCodes) {
  for (const StopCase& stop : {
           StopCase{0x605A, 1, 0x02, 400000.0, 0x40},
           StopCase{0x605A, 2, 0x02, 800000.0, 0x40},
           StopCase{0x605B, 1, 0x06, 400000.0, 0x21},
           StopCase{0x605C, 1, 0x07, 400000.0, 0x23},
       }) {
    SCOPED_TRACE(testing::Message() << std::hex << stop.object << "h = " << stop.code);
    JmcRig rig;
    rig.open_limits();
    rig.set(stop.object, 0, stop.code);
    rig.set(0x6060, 0, 3);
    rig.set(0x60FF, 0, 20000);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(400);
    rig.control(stop.controlword);
    rig.run_ms(1);
    if (stop.object == 0x605A) {
      EXPECT_EQ(rig.status() & 0x6F, 0x07);
    }
    const std::int64_t begin = rig.ticks();
    ASSERT_GE(rig.run_until([&] { return rig.device.drive().axis().generator.standing(); }, 1000.0), 0);
    EXPECT_NEAR(static_cast<double>(rig.ticks() - begin) / 16000.0, 20000.0 / stop.deceleration, 0.003);
    rig.run_ms(400);
    EXPECT_EQ(rig.status() & 0x6F, stop.state);
  }
  // From 3 on "at once": as fast as the current allows.
  for (const int code : {3, 4, 1000, 32767}) {
    JmcRig rig;
    rig.open_limits();
    rig.set(0x605A, 0, code);
    rig.set(0x6060, 0, 3);
    rig.set(0x60FF, 0, 20000);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(400);
    rig.control(0x02);
    const std::int64_t begin = rig.ticks();
    ASSERT_GE(rig.run_until([&] { return std::abs(rig.plant.velocity_rpm()) < 3.0; }, 1000.0), 0);
    EXPECT_LT(static_cast<double>(rig.ticks() - begin) / 16000.0, 0.018) << code;
    rig.run_ms(400);
    EXPECT_EQ(rig.status() & 0x6F, 0x40) << code;
  }
}

// In Switched on the motor has power (C-30) and may still turn: 605Ch = 0 goes there without a ramp. The commands that
// end it brake by their own option codes.
TEST(JmcPowerState, StopsInSwitchedOn) {
  struct Case {
    const char* name;
    std::function<void(JmcRig&)> stop;
    double deceleration;
    int state;
  };
  const std::vector<Case> cases{
      {"quick stop", [](JmcRig& rig) { rig.control(0x02); }, 800000.0, 0x40},
      {"quick stop, and commands that come too late",
       [](JmcRig& rig) {
         for (const int word : {0x02, 0x06, 0x07, 0x0F, 0x02}) rig.control(static_cast<std::uint16_t>(word));
       },
       800000.0, 0x40},
      {"communication lost",
       [](JmcRig& rig) {
         rig.set(0x6007, 0, 3);
         rig.device.drive().communication_lost();
       },
       800000.0, 0x40},
      {"shutdown",
       [](JmcRig& rig) {
         rig.set(0x605B, 0, 1);
         rig.control(0x06);
       },
       200000.0, 0x21},
      {"shutdown that is taken back",
       [](JmcRig& rig) {
         rig.set(0x605B, 0, 1);
         rig.control(0x06);
         for (int tick = 0; tick < 16; ++tick) {
           rig.tick();
           EXPECT_TRUE(rig.actuation.pwm_enabled) << tick;
         }
         rig.control(0x07);
       },
       200000.0, 0x23},
  };
  for (const Case& stop : cases) {
    SCOPED_TRACE(stop.name);
    JmcRig rig;
    rig.open_limits();
    rig.set(0x605C, 0, 0);
    rig.set(0x6084, 0, 200000);
    rig.set(0x6060, 0, 3);
    rig.set(0x60FF, 0, 60000);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(600);
    ASSERT_NEAR(rig.plant.velocity_rpm(), 900.0, 10.0);
    rig.control(0x07);
    rig.run_ms(1);
    ASSERT_EQ(rig.status() & 0x6F, 0x23);
    stop.stop(rig);
    const double speed = rig.device.drive().axis().generator.velocity();
    rig.run_ms(20);
    EXPECT_NEAR(rig.device.drive().axis().generator.velocity(), speed - 0.02 * stop.deceleration, 0.1 * speed);
    EXPECT_TRUE(rig.actuation.pwm_enabled);
    rig.run_ms(800);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
    EXPECT_EQ(rig.status() & 0x6F, stop.state);
  }
}

// 605Bh = 0, 605Eh = 0: without a ramp.
TEST(JmcPowerState, DisableWithoutRamp) {
  JmcRig rig;
  rig.open_limits();
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, 20000);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(400);
  rig.control(0x06);  // 605Bh is 0
  ASSERT_GE(rig.run_until([&] { return !rig.actuation.pwm_enabled; }, 300.0), 0);
  EXPECT_FALSE(rig.device.drive().energised());
}

// --- Limits

// 607Dh: alarm and stop (Table 228), statusword bit 11 in CSP and PP (Table 156).
TEST(JmcPowerState, SoftwareLimits) {
  for (const std::int8_t mode : std::to_array<std::int8_t>({1, 8})) {
    SCOPED_TRACE(int{mode});
    JmcBus rig;
    rig.open_limits();
    rig.set(0x607D, 1, -1000);
    rig.set(0x607D, 2, 1000);
    rig.connect();
    rig.enable_in(mode);
    const auto go = [&rig, mode](std::int32_t target) {
      if (mode == 1) {
        rig.put<std::int32_t>(Out::position, target);
        rig.word(0x0F, 2);
        rig.word(0x1F, 2);
      } else {
        const std::int32_t from = rig.position();
        rig.cycles(std::abs(target - from) / 10 + 1, [&](int i) {
          const std::int32_t step = 10 * (i + 1);
          rig.put<std::int32_t>(Out::position,
                                target > from ? std::min(from + step, target) : std::max(from - step, target));
        });
      }
    };
    go(1000);
    rig.settle();
    EXPECT_EQ(rig.state(), 0x27U) << "the limit itself is allowed";
    EXPECT_NEAR(rig.position(), 1000, 3);
    go(990);
    rig.settle();
    EXPECT_FALSE(rig.bit(11));
    go(1001);
    rig.cycles(200);
    EXPECT_EQ(rig.state() & 0x4FU, 0x08U);
    EXPECT_EQ(rig.input<std::uint16_t>(In::error), 0x8612);
    EXPECT_LE(rig.position(), 1005) << "not gone there";
  }
  // Beyond the limit, moved by hand or by a new limit: bit 11.
  JmcBus rig;
  rig.connect();
  rig.enable_in(8);
  rig.set(0x607D, 2, -10);
  rig.cycles(3);
  EXPECT_TRUE(rig.bit(11));
  rig.set(0x607D, 2, 100);
  rig.cycles(3);
  EXPECT_FALSE(rig.bit(11));
}

// 607Eh: bit 7 inverts positions, bit 6 speeds, and the limit switches change places (Table 229).
TEST(JmcPowerState, Polarity) {
  for (const bool inverted : {false, true}) {
    JmcBus rig;
    rig.open_limits();
    ASSERT_EQ(rig.set(0x607E, 0, inverted ? 0xC0 : 0x00), AbortCode::none);
    rig.connect();
    const int sign = inverted ? -1 : 1;
    rig.enable_in(3);
    rig.put<std::int32_t>(Out::velocity, 20000);
    rig.cycles(300);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0 * sign, 8.0);
    EXPECT_NEAR(rig.velocity(), 20000, 400) << "feedback keeps the sign of the command";
    EXPECT_GT(rig.position(), 1000);
    rig.put<std::int32_t>(Out::velocity, 0);
    rig.cycles(200);
    EXPECT_EQ(rig.set(0x607E, 0, 0), AbortCode::device_state) << "not with the motor enabled";
    rig.plant.force_input(0, true);  // CW
    rig.cycles(3);
    EXPECT_EQ(rig.input<std::uint16_t>(In::inputs) & 3, inverted ? 1 : 2);
    // The direction towards the switch is blocked, the other is free.
    rig.put<std::int32_t>(Out::velocity, 4000 * sign);
    rig.cycles(200);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 3.0);
    rig.put<std::int32_t>(Out::velocity, -4000 * sign);
    rig.cycles(300);
    EXPECT_NEAR(rig.plant.velocity_rpm(), -60.0, 6.0);
  }
}

// 6065h and 6066h: 4000 units and 1 ms; FFFFFFFFh is off (Table 167), and so is 0 (C-26).
TEST(JmcPowerState, FollowingError) {
  for (const std::int64_t window : {std::int64_t{4000}, std::int64_t{0xFFFFFFFF}, std::int64_t{0}}) {
    JmcBus rig;
    rig.open_limits();
    rig.set(0x6065, 0, window);
    rig.connect();
    rig.enable_in(8);
    rig.plant.lock_rotor(true);
    const std::int32_t from = rig.position();
    rig.cycles(300, [&](int i) { rig.put<std::int32_t>(Out::position, from + 20 * (i + 1)); });
    rig.cycles(50);
    if (window == 4000) {
      EXPECT_EQ(rig.input<std::uint16_t>(In::error), 0x5006);
      EXPECT_TRUE(rig.bit(13)) << "Table 222";
      EXPECT_STREQ(rig.device.alarm().data(), "AL.501");
    } else {
      EXPECT_EQ(rig.state(), 0x27U) << window;
      EXPECT_FALSE(rig.bit(13));
    }
  }
}

// 60FEh: bit 0 closes the brake if its mask bit is set (Table 216).
TEST(JmcPowerState, BrakeByTheBus) {
  JmcRig rig;
  ASSERT_TRUE(rig.enable());
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.set(0x60FE, 1, 1);
  rig.run_ms(1);
  EXPECT_TRUE(rig.actuation.brake_released) << "not enabled";
  rig.set(0x60FE, 2, 1);
  rig.run_ms(1);
  EXPECT_FALSE(rig.actuation.brake_released);
  rig.set(0x60FE, 1, 0);
  rig.run_ms(1);
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.control(0x00);
  rig.run_ms(500);
  EXPECT_TRUE(rig.actuation.brake_released) << "opened by hand";
  rig.set(0x60FE, 2, 0);
  rig.run_ms(1);
  EXPECT_FALSE(rig.actuation.brake_released);
}

// 60FDh (Table 215).
TEST(JmcPowerState, DigitalInputs) {
  JmcRig rig;
  rig.run_ms(2);
  for (const auto& [wire, bit] :
       {std::pair{0, 1}, std::pair{1, 2}, std::pair{2, 0}, std::pair{3, 9}, std::pair{4, 10}}) {
    rig.plant.force_input(wire, true);
    rig.run_ms(1);
    EXPECT_EQ(rig.get(0x60FD), 1 << bit);
    rig.plant.force_input(wire, false);
  }
}

// Homing with 607Ch: the axis moves away from home at 6099h:02, and home is 0 (Chart 42, D-25).
TEST(JmcPowerState, HomeOffsetIsTravelled) {
  for (const std::int32_t offset : {0, 2000, 1500}) {
    plant::Parameters parameters = test::jmc_plant();
    parameters.encoder.start_position_counts = 10000;
    parameters.switches[0] = {.wire = 2, .from_counts = plant::no_low_limit, .to_counts = 5000};  // CCW
    parameters.switch_count = 1;
    JmcBus rig(parameters, test::jmc_settings());
    rig.open_limits();
    rig.set(0x6098, 0, 17);
    rig.set(0x6099, 1, 20000);
    rig.set(0x6099, 2, 4000);
    rig.set(0x609A, 0, 400000);
    rig.set(0x607C, 0, offset);
    rig.connect();
    rig.enable_in(6);
    EXPECT_EQ(rig.status_in() & 0x3400U, 0x0400U) << "not started, standing";
    rig.word(0x1F, 5);
    EXPECT_EQ(rig.status_in() & 0x3400U, 0x0000U);
    double fastest = 0.0;
    bool attained = false;
    ASSERT_GE(rig.run_bus_until(
                  [&] {
                    const bool now = rig.bit(12);
                    if (attained && now) {
                      fastest = std::max(fastest, std::abs(rig.device.drive().axis().generator.velocity()));
                    }
                    attained = now;
                    return (rig.status_in() & 0x3400U) == 0x1400U;
                  },
                  8000.0),
              0);
    rig.settle();
    EXPECT_NEAR(rig.position(), 0, 4);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 5001.0 + offset, 4.0);
    EXPECT_LE(fastest, 4001.0);
  }
}

// 0, 15, 16, 31 and 32 are allowed, without motion (HM 2.15 and 2.31); methods that use 6099h:01 are refused if it is 0
// (D-24).
TEST(JmcPowerState, HomingThatDoesNothing) {
  for (const int method : {0, 15, 16, 31, 32}) {
    JmcBus rig;
    rig.set(0x6099, 1, 20000);
    rig.connect();
    ASSERT_EQ(rig.download(0x6098, 0, method, 1), AbortCode::none);
    rig.enable_in(6);
    const std::int32_t before = rig.position();
    rig.word(0x1F, 300);
    EXPECT_EQ(rig.status_in() & 0x3400U, 0x0400U) << method;
    EXPECT_NEAR(rig.position(), before, 2);
  }
  JmcBus rig;
  rig.set(0x6098, 0, 17);
  rig.connect();
  rig.enable_in(6);
  rig.word(0x1F, 50);
  EXPECT_EQ(rig.status_in() & 0x3400U, 0x2400U) << "error, standing";
  EXPECT_EQ(rig.state(), 0x27U);
}

}  // namespace
}  // namespace jmc_power_state_test
}  // namespace servodrome
