#include <cmath>
#include <gtest/gtest.h>
#include <optional>
#include <string>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// The power drive systems' state machine of both products: CiA 402-2 figure 4 and table 24 (ISMC manual, ch. 3), the
// option codes (ch. 3.4), brake and power stage.
namespace servodrome {
namespace power_state_test {
namespace {

using dictionary::AbortCode;
using drive::PowerState;
using products::Generic402;
using products::Ismc;
using test::Rig;

constexpr double speed = 500000.0;  // counts/s
constexpr double slow_ramp = 1310720.0;
constexpr double quick_ramp = 5242880.0;

// --- Differences between the products, from their documents

struct IsmcFacts {
  using Device = Ismc;
  static constexpr bool leaves_quick_stop_by_enabling = false;  // transition 16 (Table 3-2)
  static constexpr bool switches_dc_link = true;                // table 3-1
};
struct Generic402Facts {
  using Device = Generic402;
  static constexpr bool leaves_quick_stop_by_enabling = true;
  static constexpr bool switches_dc_link = false;
};

template <typename Facts>
struct PowerStates : testing::Test {
  using Axis = Rig<typename Facts::Device>;

  static void must_set(Axis& axis, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    ASSERT_EQ(axis.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub};
  }
  static PowerState state(Axis& axis) { return axis.device.drive().state(); }
  static double demand(Axis& axis) { return axis.device.drive().axis().generator.velocity(); }

  static void turn(Axis& axis, std::int8_t mode = 3) {
    must_set(axis, 0x6060, 0, mode);
    must_set(axis, 0x6081, 0, static_cast<std::int64_t>(speed));
    must_set(axis, 0x60FF, 0, static_cast<std::int64_t>(speed));
    must_set(axis, 0x607A, 0, 500000000);
    ASSERT_TRUE(axis.enable());
    axis.control(0x1F);
    axis.run_ms(600);
    ASSERT_NEAR(static_cast<double>(axis.get(0x606C)), speed, 0.01 * speed);
  }

  static void bring_to(Axis& axis, PowerState wanted) {
    axis.run_ms(1);
    const auto write = [&axis](std::uint16_t word) {
      axis.control(word);
      axis.run_ms(3);  // transition 3 checks the DC link
    };
    switch (wanted) {
      case PowerState::not_ready_to_switch_on:
      case PowerState::switch_on_disabled: break;
      case PowerState::ready_to_switch_on: write(0x06); break;
      case PowerState::switched_on:
        write(0x06);
        write(0x07);
        break;
      case PowerState::operation_enabled: axis.enable(); break;
      case PowerState::quick_stop_active:
        must_set(axis, 0x605A, 0, 6);
        axis.enable();
        write(0x02);
        break;
      case PowerState::fault_reaction_active:
        must_set(axis, 0x605E, 0, 2);
        turn(axis);
        axis.plant.inject(plant::Injection::ambient_hot, true);
        axis.run_ms(1);
        break;
      case PowerState::fault:
        axis.plant.inject(plant::Injection::ambient_hot, true);
        axis.run_ms(1);
        axis.plant.inject(plant::Injection::ambient_hot, false);
        axis.run_ms(1);
        break;
    }
    ASSERT_EQ(state(axis), wanted);
  }

  // Seconds until the demand stands (without a ramp: the shaft).
  static double seconds_to_rest(Axis& axis, bool shaft) {
    const std::int64_t begin = axis.ticks();
    const auto rest = [&] {
      return shaft ? std::abs(axis.plant.velocity_rpm()) < 1.0 : !axis.device.drive().in_motion();
    };
    EXPECT_GE(axis.run_until(rest, 5000.0), 0);
    return static_cast<double>(axis.ticks() - begin) / 16000.0;
  }
};

using Products = testing::Types<IsmcFacts, Generic402Facts>;
TYPED_TEST_SUITE(PowerStates, Products);

// --- Transitions

struct CommandWords {
  const char* name;
  std::vector<std::uint16_t> words;  // every don't-care bit is 0 at least once and 1 at least once
};
const std::vector<CommandWords> commands{
    {"shutdown", {0x06, 0x0E}},
    {"switch on", {0x07}},
    {"enable operation", {0x0F}},
    {"disable voltage", {0x00, 0x01, 0x04, 0x05, 0x08, 0x0C, 0x0D}},
    {"quick stop", {0x02, 0x03, 0x0A, 0x0B}},
};
enum : std::size_t { shutdown, switch_on, enable_operation, disable_voltage, quick_stop };

// CiA 402-2 figure 4, by number; none: the state does not change.
std::optional<PowerState> target(PowerState from, std::size_t command, bool transition_16) {
  using enum PowerState;
  switch (from) {
    case switch_on_disabled:
      if (command == shutdown) return ready_to_switch_on;  // 2
      break;
    case ready_to_switch_on:
      if (command == switch_on) return switched_on;                                        // 3
      if (command == enable_operation) return operation_enabled;                           // 3, 4
      if (command == disable_voltage || command == quick_stop) return switch_on_disabled;  // 7
      break;
    case switched_on:
      if (command == enable_operation) return operation_enabled;                           // 4
      if (command == shutdown) return ready_to_switch_on;                                  // 6
      if (command == disable_voltage || command == quick_stop) return switch_on_disabled;  // 10
      break;
    case operation_enabled:
      if (command == switch_on) return switched_on;               // 5
      if (command == shutdown) return ready_to_switch_on;         // 8
      if (command == disable_voltage) return switch_on_disabled;  // 9
      if (command == quick_stop) return quick_stop_active;        // 11
      break;
    case quick_stop_active:
      if (command == disable_voltage) return switch_on_disabled;                   // 12
      if (command == enable_operation && transition_16) return operation_enabled;  // 16
      break;
    default: break;
  }
  return std::nullopt;
}

struct Pattern {
  std::uint16_t mask;
  std::uint16_t value;
};
Pattern pattern(PowerState state) {  // CiA 402-2 table 27; ISMC manual, Table 3-7
  switch (state) {
    case PowerState::not_ready_to_switch_on: return {0x4F, 0x00};
    case PowerState::switch_on_disabled: return {0x4F, 0x40};
    case PowerState::ready_to_switch_on: return {0x6F, 0x21};
    case PowerState::switched_on: return {0x6F, 0x23};
    case PowerState::operation_enabled: return {0x6F, 0x27};
    case PowerState::quick_stop_active: return {0x6F, 0x07};
    case PowerState::fault_reaction_active: return {0x4F, 0x0F};
    case PowerState::fault: return {0x4F, 0x08};
  }
  return {};
}

constexpr std::array all_states{PowerState::switch_on_disabled,
                                PowerState::ready_to_switch_on,
                                PowerState::switched_on,
                                PowerState::operation_enabled,
                                PowerState::quick_stop_active,
                                PowerState::fault_reaction_active,
                                PowerState::fault};

bool powered(PowerState state) {
  return state == PowerState::operation_enabled || state == PowerState::quick_stop_active ||
         state == PowerState::fault_reaction_active;
}

TYPED_TEST(PowerStates, EveryCommandInEveryState) {
  for (const PowerState from : all_states) {
    for (std::size_t command = 0; command < commands.size(); ++command) {
      for (const std::uint16_t word : commands[command].words) {
        SCOPED_TRACE(std::string(name(from)) + ", " + commands[command].name + " " + std::to_string(word));
        typename TestFixture::Axis axis;
        this->bring_to(axis, from);
        if (from == PowerState::operation_enabled) this->must_set(axis, 0x605A, 0, 6);
        axis.control(word);
        axis.run_ms(3);
        const PowerState expected = target(from, command, TypeParam::leaves_quick_stop_by_enabling).value_or(from);
        EXPECT_EQ(this->state(axis), expected) << name(this->state(axis));
        const Pattern status = pattern(expected);
        EXPECT_EQ(axis.status() & status.mask, status.value) << std::hex << axis.status();
        EXPECT_EQ(axis.actuation.pwm_enabled, powered(expected));
        EXPECT_EQ((axis.status() & 0x10) != 0, axis.actuation.dc_link_connected);  // voltage enabled
        EXPECT_EQ(axis.actuation.brake_released, powered(expected));
        EXPECT_EQ(axis.actuation.dc_link_connected,
                  !TypeParam::switches_dc_link || powered(expected) || expected == PowerState::switched_on);
      }
    }
  }
}

TYPED_TEST(PowerStates, FaultResetIsAnEdgeAndOnlyInFault) {
  for (const PowerState from : all_states) {
    SCOPED_TRACE(name(from));
    typename TestFixture::Axis axis;
    this->bring_to(axis, from);
    const std::uint16_t word = static_cast<std::uint16_t>(axis.get(0x6040));
    axis.control(word | 0x80);
    axis.run_ms(1);
    EXPECT_EQ(this->state(axis), from == PowerState::fault ? PowerState::switch_on_disabled : from);
  }
  // With any other bits: in the table of commands bit 7 is 0 (CiA 402-2 table 9).
  for (const std::uint16_t word : std::to_array<std::uint16_t>({0x86, 0x8F, 0x80})) {
    for (const PowerState from : {PowerState::switch_on_disabled, PowerState::operation_enabled}) {
      typename TestFixture::Axis axis;
      this->bring_to(axis, from);
      axis.control(word);
      axis.run_ms(1);
      EXPECT_EQ(this->state(axis), from) << word;
    }
  }
  typename TestFixture::Axis axis;
  axis.run_ms(1);
  axis.control(0x80);
  this->bring_to(axis, PowerState::fault);
  axis.control(0x80);  // the bit was already set before
  axis.run_ms(1);
  EXPECT_EQ(this->state(axis), PowerState::fault);
}

TYPED_TEST(PowerStates, CommandOfAMasterThatDoesNotWaitForTheDrive) {
  typename TestFixture::Axis axis;
  axis.control(0x06);  // at the same time as the boot-up message
  axis.run_ms(1);
  EXPECT_EQ(this->state(axis), PowerState::ready_to_switch_on);
  axis.control(0x07);
  axis.run_ms(TypeParam::switches_dc_link ? 3 : 0);  // the DC link must be charged before this command
  // All in one cycle, including the mode.
  this->must_set(axis, 0x6060, 0, 1);
  this->must_set(axis, 0x6081, 0, 100000);
  axis.control(0x07);
  axis.control(0x0F);
  this->must_set(axis, 0x607A, 0, 1000);
  axis.control(0x1F);
  axis.control(0x0F);
  axis.run_ms(500);
  EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), 1000.0, 1.0);
}

// --- Option codes

// The duration of a stop from `speed` for a value of the option code: by a ramp, at the current limit (3), by short
// circuit (4), or without a stop because the power is switched off immediately (0).
template <typename Fixture, typename Axis>
void check_stop(Fixture& fixture, Axis& axis, std::int16_t code) {
  // 0.127 Nm brake 0.56 g m2: 10.6 ms from `speed`, minus the effect of friction.
  const double torque_nm = 0.127 + 0.01;
  const double at_limit = speed / 131072.0 * 6.283185307 * 0.56e-4 / torque_nm;
  switch (code) {
    case 1: EXPECT_NEAR(fixture.seconds_to_rest(axis, false), speed / slow_ramp, 0.001); break;
    case 2: EXPECT_NEAR(fixture.seconds_to_rest(axis, false), speed / quick_ramp, 0.001); break;
    case 3: EXPECT_NEAR(fixture.seconds_to_rest(axis, true), at_limit, 0.0015); break;
    case 4: {
      axis.run_ms(1);
      EXPECT_TRUE(axis.actuation.short_circuit);
      EXPECT_FALSE(axis.actuation.pwm_enabled);
      const double seconds = fixture.seconds_to_rest(axis, true);
      EXPECT_GT(seconds, 0.001);
      EXPECT_LT(seconds, 0.1);
      break;
    }
    default: FAIL() << code;
  }
}

template <typename Axis>
void limit_torque(Axis& axis) {
  axis.set(0x60E0, 0, 100);
  axis.set(0x60E1, 0, 100);
}

TYPED_TEST(PowerStates, QuickStopOptionCodes) {
  for (const std::int8_t mode : {std::int8_t{1}, std::int8_t{3}}) {
    for (std::int16_t code = 0; code <= 8; ++code) {
      SCOPED_TRACE("mode " + std::to_string(mode) + ", 605Ah = " + std::to_string(code));
      typename TestFixture::Axis axis;
      if (axis.set(0x605A, 0, code) != AbortCode::none) continue;  // refused values are tested below
      this->turn(axis, mode);
      limit_torque(axis);
      axis.control(0x0B);
      if (code == 0) {
        axis.run_ms(1);
        EXPECT_EQ(this->state(axis), PowerState::switch_on_disabled);
        EXPECT_FALSE(axis.actuation.pwm_enabled);
        continue;
      }
      EXPECT_EQ(axis.status() & 0x6F, 0x07);
      check_stop(*this, axis, static_cast<std::int16_t>((code - 1) % 4 + 1));
      axis.run_ms(20);
      if (code <= 4) {
        EXPECT_EQ(this->state(axis), PowerState::switch_on_disabled);
        EXPECT_FALSE(axis.actuation.pwm_enabled);
        EXPECT_FALSE(axis.actuation.short_circuit);
      } else {
        EXPECT_EQ(this->state(axis), PowerState::quick_stop_active);
        EXPECT_EQ(axis.actuation.pwm_enabled, code != 8);
        EXPECT_NE(axis.status() & 0x0400, 0);  // the axis stands
        axis.run_ms(500);
        EXPECT_EQ(this->state(axis), PowerState::quick_stop_active);
        axis.control(0x00);
        axis.run_ms(1);
        EXPECT_EQ(this->state(axis), PowerState::switch_on_disabled);
        EXPECT_FALSE(axis.actuation.pwm_enabled);
        EXPECT_FALSE(axis.actuation.short_circuit);
      }
    }
  }
}

TYPED_TEST(PowerStates, ShutdownAndDisableOperationOptionCodes) {
  struct Row {
    std::uint16_t object;
    std::uint16_t word;
    PowerState to;
  };
  for (const Row& row :
       {Row{0x605B, 0x06, PowerState::ready_to_switch_on}, Row{0x605C, 0x07, PowerState::switched_on}}) {
    for (std::int16_t code = 0; code <= 1; ++code) {
      SCOPED_TRACE(std::to_string(row.object) + " = " + std::to_string(code));
      typename TestFixture::Axis axis;
      this->must_set(axis, row.object, 0, code);
      this->turn(axis);
      axis.control(row.word);
      if (code == 1) check_stop(*this, axis, 1);
      axis.run_ms(1);
      EXPECT_EQ(this->state(axis), row.to);
      EXPECT_FALSE(axis.actuation.pwm_enabled);
      if (code == 0) {
        EXPECT_GT(axis.plant.velocity_rpm(), 200.0);  // it coasts
      }
    }
  }
}

TYPED_TEST(PowerStates, OptionCodesThatAreNotThere) {
  typename TestFixture::Axis axis;
  axis.run_ms(1);
  constexpr bool ismc = std::is_same_v<TypeParam, IsmcFacts>;
  struct Row {
    std::uint16_t object;
    std::vector<int> legal;
  };
  const std::vector<Row> rows = ismc ? std::vector<Row>{{0x605A, {0, 1, 2, 3, 5, 6, 7}},
                                                        {0x605B, {0, 1}},
                                                        {0x605C, {0, 1}},
                                                        {0x605D, {1, 2, 3}},
                                                        {0x605E, {0, 1, 2, 3}}}
                                     : std::vector<Row>{{0x605A, {0, 1, 2, 3, 4, 5, 6, 7, 8}},
                                                        {0x605B, {0, 1}},
                                                        {0x605C, {0, 1}},
                                                        {0x605D, {1, 2, 3, 4}},
                                                        {0x605E, {0, 1, 2, 3, 4}}};
  for (const Row& row : rows) {
    for (int value = -2; value <= 33; ++value) {
      const bool legal = std::find(row.legal.begin(), row.legal.end(), value) != row.legal.end();
      const std::int64_t before = axis.get(row.object);
      EXPECT_EQ(axis.set(row.object, 0, value), legal ? AbortCode::none : AbortCode::value_invalid)
          << std::hex << row.object << " = " << std::dec << value;
      EXPECT_EQ(axis.get(row.object), legal ? value : before);
    }
  }
}

// --- Interruptions of ramps

TYPED_TEST(PowerStates, DisableVoltageEndsEveryRampAtOnce) {
  for (const std::uint16_t word :
       {std::uint16_t{0x02}, std::uint16_t{0x06}, std::uint16_t{0x07}, std::uint16_t{0x10F}}) {
    SCOPED_TRACE(word);
    typename TestFixture::Axis axis;
    this->must_set(axis, 0x605B, 0, 1);
    this->must_set(axis, 0x605C, 0, 1);
    this->turn(axis);
    axis.control(word);
    axis.run_ms(20);
    EXPECT_TRUE(axis.actuation.pwm_enabled);
    EXPECT_GT(this->demand(axis), 0.1 * speed);
    axis.control(0x00);
    axis.run_ms(0.5);
    EXPECT_FALSE(axis.actuation.pwm_enabled);
    EXPECT_EQ(this->state(axis), PowerState::switch_on_disabled);
  }
}

TYPED_TEST(PowerStates, FaultDuringARampReactsByItsOwnCode) {
  for (const std::int16_t code : {std::int16_t{0}, std::int16_t{2}}) {
    SCOPED_TRACE(code);
    typename TestFixture::Axis axis;
    this->must_set(axis, 0x605E, 0, code);
    this->must_set(axis, 0x605C, 0, 1);
    this->turn(axis);
    axis.control(0x07);
    axis.run_ms(100);
    const double then = this->demand(axis);
    EXPECT_NEAR(then, speed - 0.1 * slow_ramp, 0.01 * speed);
    axis.plant.inject(plant::Injection::ambient_hot, true);
    axis.run_ms(1);
    if (code == 0) {
      EXPECT_EQ(this->state(axis), PowerState::fault);
      EXPECT_FALSE(axis.actuation.pwm_enabled);
    } else {
      EXPECT_EQ(this->state(axis), PowerState::fault_reaction_active);
      EXPECT_NEAR(this->seconds_to_rest(axis, false), then / quick_ramp - 0.001, 0.001);
      axis.run_ms(1);
      EXPECT_EQ(this->state(axis), PowerState::fault);
    }
  }
}

TYPED_TEST(PowerStates, OperationThatWasBeingEndedGoesOn) {
  typename TestFixture::Axis axis;
  this->must_set(axis, 0x605C, 0, 1);
  this->turn(axis);
  axis.control(0x07);
  axis.run_ms(100);
  const double then = this->demand(axis);
  EXPECT_LT(then, 0.9 * speed);
  axis.control(0x0F);
  axis.run_ms(0.5);
  EXPECT_NEAR(this->demand(axis), then, 0.02 * speed);
  axis.run_ms(300);
  EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
  EXPECT_NEAR(this->demand(axis), speed, 1.0);
}

TYPED_TEST(PowerStates, QuickStopTakesPrecedenceOverASlowerEnd) {
  typename TestFixture::Axis axis;
  this->must_set(axis, 0x605B, 0, 1);
  this->turn(axis);
  axis.control(0x06);
  axis.run_ms(10);
  EXPECT_EQ(this->state(axis), PowerState::operation_enabled);
  axis.control(0x02);
  EXPECT_EQ(axis.status() & 0x6F, 0x07);
  EXPECT_NEAR(this->seconds_to_rest(axis, false), (speed - 0.01 * slow_ramp) / quick_ramp, 0.002);
  axis.run_ms(1);
  EXPECT_EQ(this->state(axis), PowerState::switch_on_disabled);
}

TYPED_TEST(PowerStates, EnabledWhileTheShaftTurnsItTakesTheMotionOver) {
  typename TestFixture::Axis axis;
  this->turn(axis);
  axis.control(0x00);
  axis.run_ms(1);
  axis.set(0x60FF, 0, 0);
  axis.control(0x06);
  axis.control(0x07);
  axis.control(0x0F);
  const auto enabled = [&] { return this->state(axis) == PowerState::operation_enabled; };
  ASSERT_GE(axis.run_until(enabled, 5.0), 0);
  EXPECT_NEAR(this->demand(axis), speed, 0.05 * speed);
  EXPECT_NEAR(this->seconds_to_rest(axis, false), speed / slow_ramp, 0.03);
}

// --- Brake and power stage of the reference drive

struct Braked : testing::Test {
  using Axis = Rig<Generic402>;
  static plant::Parameters hanging_load() {
    plant::Parameters parameters = test::default_plant();
    parameters.motor.brake_torque_nm = 3.0;
    parameters.motor.brake_release_ms = 30.0;
    parameters.motor.brake_engage_ms = 20.0;
    parameters.load.gravity_torque_nm = 0.6;
    return parameters;
  }
};

TEST_F(Braked, ReleasesBeforeMotionAndEngagesBeforePowerGoes) {
  Axis axis(hanging_load());
  axis.set(0x2020, 1, 40);
  axis.set(0x2020, 2, 25);
  axis.set(0x605C, 0, 1);
  axis.set(0x6060, 0, 3);
  axis.set(0x60FF, 0, 100000);
  axis.run_ms(1);
  axis.control(0x06);
  axis.control(0x07);
  const std::int64_t before = axis.plant.position_counts();
  axis.control(0x0F);
  const std::int64_t enabled = axis.ticks();
  axis.run_ms(0.5);
  EXPECT_TRUE(axis.actuation.pwm_enabled);
  EXPECT_TRUE(axis.actuation.brake_released);
  ASSERT_GE(axis.run_until([&] { return axis.device.drive().in_motion(); }, 1000.0), 0);
  EXPECT_NEAR(static_cast<double>(axis.ticks() - enabled) / 16.0, 40.0, 1.0);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - before), 0.0, 2000.0)
      << "the load fell";  // 11000 in free fall

  axis.run_ms(300);
  axis.control(0x07);
  ASSERT_GE(axis.run_until([&] { return !axis.actuation.brake_released; }, 1000.0), 0);
  const std::int64_t closing = axis.ticks();
  EXPECT_FALSE(axis.device.drive().in_motion());
  EXPECT_TRUE(axis.actuation.pwm_enabled);
  EXPECT_EQ(axis.device.drive().state(), PowerState::operation_enabled);
  const std::int64_t at_rest = axis.plant.position_counts();
  ASSERT_GE(axis.run_until([&] { return !axis.actuation.pwm_enabled; }, 1000.0), 0);
  EXPECT_NEAR(static_cast<double>(axis.ticks() - closing) / 16.0, 25.0, 1.0);
  EXPECT_EQ(axis.device.drive().state(), PowerState::switched_on);
  axis.run_ms(200);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - at_rest), 0.0, 100.0) << "the load fell";
}

TEST_F(Braked, EnabledAgainWhileTheBrakeClosesItMoves) {
  Axis axis(hanging_load());
  axis.set(0x2020, 1, 40);
  axis.set(0x2020, 2, 50);
  axis.set(0x605C, 0, 1);
  axis.set(0x6060, 0, 3);
  axis.set(0x60FF, 0, 100000);
  ASSERT_TRUE(axis.enable());
  axis.run_ms(300);
  axis.control(0x07);
  ASSERT_GE(axis.run_until([&] { return !axis.actuation.brake_released; }, 1000.0), 0);
  axis.run_ms(10);
  axis.control(0x0F);
  axis.run_ms(300);
  EXPECT_EQ(axis.device.drive().state(), PowerState::operation_enabled);
  EXPECT_TRUE(axis.actuation.brake_released);
  EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), 100000.0, 2000.0);
}

TEST_F(Braked, NoPowerNoWait) {
  Axis axis(hanging_load());
  axis.set(0x2020, 2, 50);
  ASSERT_TRUE(axis.enable());
  axis.run_ms(100);
  axis.control(0x00);
  axis.run_ms(0.5);
  EXPECT_FALSE(axis.actuation.pwm_enabled);
  EXPECT_FALSE(axis.actuation.brake_released);
}

TEST_F(Braked, BrakeThatDoesNotHoldIsAFault) {
  plant::Parameters parameters = hanging_load();
  parameters.motor.brake_torque_nm = 0.55;
  Axis axis(parameters);
  axis.set(0x2020, 2, 25);
  ASSERT_GE(axis.run_until([&] { return axis.device.drive().any_fault(); }, 2000.0), 0);
  EXPECT_EQ(axis.get(0x603F), 0xFF10);
}

// --- Halt

struct Moving {
  std::int8_t mode;
  bool resumes;
  const char* name;
};

TEST(Halt, OfTheReferenceDriveInEveryModeAndBack) {
  for (const Moving& row :
       {Moving{1, true, "profile position"}, Moving{2, true, "velocity"}, Moving{3, true, "profile velocity"},
        Moving{4, true, "profile torque"}, Moving{6, true, "homing"}, Moving{9, true, "cyclic velocity"},
        Moving{10, true, "cyclic torque"}}) {
    for (std::int16_t code = 1; code <= 4; ++code) {
      SCOPED_TRACE(std::string(row.name) + ", 605Dh = " + std::to_string(code));
      Rig<Generic402> axis;
      axis.set(0x605D, 0, code);
      axis.set(0x6060, 0, row.mode);
      axis.set(0x6081, 0, 500000);
      axis.set(0x607A, 0, 1000000);
      axis.set(0x60FF, 0, 500000);
      axis.set(0x6042, 0, 229);
      axis.set(0x6048, 1, 600);
      axis.set(0x6049, 1, 600);
      axis.set(0x6098, 0, 18);
      axis.set(0x6099, 1, 500000);
      axis.set(0x6099, 2, 50000);
      axis.set(0x6071, 0, 30);  // against 10 mNm of friction
      ASSERT_TRUE(axis.enable());
      const std::uint16_t run = row.mode == 2 ? 0x7F : row.mode == 3 || row.mode == 4 || row.mode > 6 ? 0x0F : 0x1F;
      axis.control(run);
      ASSERT_GE(axis.run_until([&] { return axis.plant.velocity_rpm() > 200.0; }, 2000.0), 0);
      axis.control(run | 0x100);
      ASSERT_GE(axis.run_until([&] { return std::abs(axis.plant.velocity_rpm()) < 1.0; }, 3000.0), 0);
      axis.run_ms(60);
      EXPECT_EQ(axis.status() & 0x6F, 0x27);
      if (row.mode < 8) {
        EXPECT_NE(axis.status() & 0x0400, 0) << "halted: the axis stands";
      } else {
        EXPECT_EQ(axis.status() & 0x1000, 0) << "the target is ignored";
      }
      if (row.mode == 3) {
        EXPECT_NE(axis.status() & 0x1000, 0) << "speed is 0";
      }
      const std::int64_t halted = axis.plant.position_counts();
      axis.run_ms(200);
      EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - halted), 0.0, 1000.0);
      axis.control(run);
      // After the halt the axis must start smoothly.
      double highest = 0.0;
      for (int i = 0; i < 200; ++i) {
        axis.run_ms(0.5);
        if (i < 4) highest = std::max(highest, std::abs(axis.plant.velocity_rpm()));
      }
      EXPECT_LT(highest, row.mode == 9 ? 300.0 : 60.0) << "a kick at the start";
      EXPECT_GT(axis.plant.velocity_rpm(), 30.0);
      if (row.mode == 1) {
        ASSERT_GE(axis.run_until([&] { return (axis.status() & 0x400) != 0; }, 10000.0), 0);
        axis.run_ms(50);
        EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), 1000000.0, 1.0);
      }
    }
  }
}

TEST(Halt, TakenBackBeforeTheAxisStandsGoesOnFromItsSpeed) {
  for (const std::int8_t mode : {std::int8_t{1}, std::int8_t{3}, std::int8_t{4}}) {
    for (std::int16_t code = 1; code <= 4; ++code) {
      SCOPED_TRACE("mode " + std::to_string(mode) + ", 605Dh = " + std::to_string(code));
      Rig<Generic402> axis;
      axis.set(0x605D, 0, code);
      axis.set(0x6060, 0, mode);
      axis.set(0x6081, 0, 1000000);
      axis.set(0x6083, 0, 2621440);
      axis.set(0x607A, 0, 500000000);
      axis.set(0x60FF, 0, 1000000);
      axis.set(0x6087, 0, 100000);
      axis.set(0x6071, 0, 30);
      ASSERT_TRUE(axis.enable());
      axis.control(0x1F);
      ASSERT_GE(axis.run_until([&] { return axis.plant.velocity_rpm() > 450.0; }, 2000.0), 0);
      limit_torque(axis);
      axis.control(0x11F);
      const auto slow = [&] { return axis.plant.velocity_rpm() < 250.0; };
      ASSERT_GE(axis.run_until(slow, 2000.0), 0);
      axis.control(0x1F);
      double least = 1000.0;
      for (int i = 0; i < 20; ++i) {
        axis.run_ms(0.5);
        least = std::min(least, axis.plant.velocity_rpm());
      }
      EXPECT_GT(least, code <= 2 ? 235.0 : 150.0);
      axis.run_ms(500);
      EXPECT_GT(axis.plant.velocity_rpm(), 300.0);
    }
  }
}

TEST(Halt, RampsOfTheHaltOptionCode) {
  struct Fixture : PowerStates<Generic402Facts> {
    void TestBody() override {}
  } fixture;
  for (const std::int8_t mode : {std::int8_t{1}, std::int8_t{3}}) {
    for (std::int16_t code = 1; code <= 4; ++code) {
      SCOPED_TRACE("mode " + std::to_string(mode) + ", 605Dh = " + std::to_string(code));
      Rig<Generic402> axis;
      axis.set(0x605D, 0, code);
      fixture.turn(axis, mode);
      limit_torque(axis);
      axis.control(0x10F);
      axis.run_ms(0);
      check_stop(fixture, axis, code);
      EXPECT_EQ(axis.device.drive().state(), PowerState::operation_enabled);
    }
  }
}

TEST(Halt, HaltedIsmcForgetsItsPoints) {
  Rig<Ismc> axis;
  axis.set(0x6060, 0, 1);
  axis.set(0x6081, 0, 500000);
  ASSERT_TRUE(axis.enable());
  for (int i = 0; i < 3; ++i) {
    axis.set(0x607A, 0, 1000000);
    axis.control(0x5F);
    axis.control(0x4F);
  }
  axis.run_ms(500);
  axis.control(0x14F);
  axis.run_ms(1000);
  const std::int64_t halted = axis.get(0x6064);
  axis.control(0x4F);
  axis.run_ms(1000);
  EXPECT_EQ(axis.get(0x6064), halted);
  axis.control(0x5F);
  axis.run_ms(10000);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), static_cast<double>(halted + 1000000), 1.0);
}

// --- Change of mode in motion

TEST(ModeChange, BetweenAllModesWithoutAJumpOfTheDemand) {
  constexpr std::array<std::int8_t, 10> modes{0, 1, 2, 3, 4, 6, 7, 8, 9, 10};
  for (const std::int8_t from : modes) {
    if (from == 0 || from == 6) continue;  // these modes come to rest by themselves
    for (const std::int8_t to : modes) {
      if (from == to) continue;
      SCOPED_TRACE(std::to_string(from) + " to " + std::to_string(to));
      Rig<Generic402> axis;
      axis.set(0x6060, 0, from);
      axis.set(0x6081, 0, 500000);
      axis.set(0x607A, 0, 500000000);
      axis.set(0x60FF, 0, 500000);
      axis.set(0x6042, 0, 229);
      axis.set(0x6048, 1, 600);
      axis.set(0x6049, 1, 600);
      axis.set(0x6071, 0, 20);
      axis.set(0x60C2, 1, 1);
      ASSERT_TRUE(axis.enable());
      double target = 0.0;
      double velocity = 0.0;
      const auto follow = [&] {  // a master's ramp of one point per millisecond
        if (from != 7 && from != 8) return;
        velocity = std::min(velocity + 1310.72, 500000.0);
        target += velocity * 0.001;
        axis.set(from == 8 ? 0x607A : 0x60C1, from == 8 ? 0 : 1, std::lround(target));
        axis.send(0x80, {});
      };
      axis.control(from == 2 ? 0x7F : 0x1F);
      for (int i = 0; i < 3000 && axis.plant.velocity_rpm() < 200.0; ++i) {
        follow();
        axis.run_ms(1);
      }
      ASSERT_GE(axis.plant.velocity_rpm(), 200.0);
      for (int i = 0; i < 10; ++i) {
        follow();
        axis.run_ms(1);
      }
      const auto demand = [&axis] { return static_cast<double>(axis.get(0x606B)); };
      // The present motion; 606Ch is 4 ms late.
      if (to == 9) axis.set(0x60FF, 0, std::lround(axis.device.drive().axis().velocity()));
      double before = demand();
      double shaft = axis.plant.velocity_rpm();
      EXPECT_GT(before, 400000.0);
      axis.set(0x6060, 0, to);
      double most = 0.0;
      double most_rpm = 0.0;
      for (int i = 0; i < 400; ++i) {
        axis.run_ms(0.5);
        if (to != 4 && to != 10) most = std::max(most, std::abs(demand() - before));  // torque has no such demand
        most_rpm = std::max(most_rpm, std::abs(axis.plant.velocity_rpm() - shaft));
        before = demand();
        shaft = axis.plant.velocity_rpm();
      }
      EXPECT_EQ(axis.get(0x6061), to);
      // The steepest ramp here, 1310720 counts/s2, changes the speed by 655 counts/s per cycle; a measured velocity at
      // a change of mode adds its ripple.
      EXPECT_LT(most, 6000.0);
      EXPECT_LT(most_rpm, 6.0);
    }
  }
}

// --- Loss of the master

struct Loss : testing::Test {
  template <typename Axis>
  static void lose_heartbeat(Axis& axis) {
    axis.sent.clear();
    axis.send(0x705, {0x05});
    axis.run_ms(150);
  }
  template <typename Axis>
  static int emergencies(Axis& axis, std::uint16_t code) {
    int count = 0;
    for (const canopen::Frame& frame : axis.sent) {
      if (frame.id == 0x80U + axis.device.node_id() && (frame.data[0] | frame.data[1] << 8) == code) ++count;
    }
    return count;
  }
};

TEST_F(Loss, AbortConnectionOptionCode) {
  for (std::int16_t code = 0; code <= 3; ++code) {
    for (const bool nmt_stop : {false, true}) {
      SCOPED_TRACE("6007h = " + std::to_string(code) + (nmt_stop ? ", NMT stop" : ", heartbeat"));
      Rig<Generic402> axis;
      ASSERT_EQ(axis.set(0x6007, 0, code), AbortCode::none);
      axis.set(0x1016, 1, 0x00050064);
      axis.set(0x6060, 0, 3);
      ASSERT_TRUE(axis.enable());
      axis.set(0x60FF, 0, 1000000);
      axis.run_ms(1000);
      const std::int64_t begin = axis.ticks();
      if (nmt_stop) {
        axis.send(0, {0x01, 0x00});
        axis.send(0, {0x02, 0x00});
      } else {
        lose_heartbeat(axis);
      }
      axis.run_ms(1);
      const PowerState state = axis.device.drive().state();
      switch (code) {
        case 0:
          EXPECT_EQ(state, PowerState::operation_enabled);
          EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), 1000000.0, 10000.0);
          break;
        case 1:
          EXPECT_EQ(state, PowerState::fault_reaction_active);
          EXPECT_EQ(axis.get(0x603F), 0x8130);
          break;
        case 2:
          EXPECT_EQ(state, PowerState::switch_on_disabled);
          EXPECT_FALSE(axis.actuation.pwm_enabled);
          break;
        default:
          EXPECT_EQ(state, PowerState::quick_stop_active);
          ASSERT_GE(axis.run_until([&] { return !axis.actuation.pwm_enabled; }, 1000.0), 0);
          EXPECT_NEAR(static_cast<double>(axis.ticks() - begin) / 16000.0,
                      (nmt_stop ? 0.0 : 0.1) + 1000000.0 / quick_ramp, 0.003);
          EXPECT_EQ(axis.device.drive().state(), PowerState::switch_on_disabled);
      }
      if (!nmt_stop) {
        EXPECT_EQ(emergencies(axis, 0x8130), 1);
      }
    }
  }
  Rig<Generic402> axis;
  EXPECT_NE(axis.set(0x6007, 0, 4), AbortCode::none);
  EXPECT_NE(axis.set(0x6007, 0, -1), AbortCode::none);
}

TEST_F(Loss, OfTheMasterIsAFaultOfTheIsmcWhileEnabled) {  // G4
  Rig<Ismc> axis;
  axis.set(0x1016, 1, 0x00050064);
  axis.set(0x6060, 0, 3);
  axis.set(0x605E, 0, 2);
  axis.send(0, {0x01, 0x00});
  ASSERT_TRUE(axis.enable());
  axis.set(0x60FF, 0, 1000000);
  axis.run_ms(1000);
  lose_heartbeat(axis);
  EXPECT_EQ(axis.device.drive().state(), PowerState::fault_reaction_active);
  EXPECT_EQ(emergencies(axis, 0x8130), 1);
  EXPECT_EQ(axis.get(0x603F), 0x8130);
  EXPECT_EQ(axis.device.node().nmt_state(), canopen::NmtState::pre_operational);
  axis.run_ms(300);
  EXPECT_EQ(axis.device.drive().state(), PowerState::fault);

  Rig<Ismc> idle;
  idle.set(0x1016, 1, 0x00050064);
  idle.run_ms(1);
  lose_heartbeat(idle);
  EXPECT_EQ(idle.device.drive().state(), PowerState::switch_on_disabled);
  EXPECT_EQ(emergencies(idle, 0x8130), 1);
}

TEST(Reset, OfCommunicationLeavesTheOtherObjectsAlone) {
  Rig<Generic402> axis;
  axis.run_ms(1);
  axis.set(0x6092, 1, 1000);
  axis.set(0x6083, 0, 4711);
  axis.send(0, {0x82, 0x00});
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6092, 1), 1000);
  EXPECT_EQ(axis.get(0x6083), 4711);
  axis.send(0, {0x81, 0x00});
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6092, 1), 131072);
  EXPECT_EQ(axis.get(0x6083), 1310720);
}

// CiA 402-2 figure 4.
TEST(PowerStateNames, AreTheStandards) {
  EXPECT_STREQ(name(PowerState::not_ready_to_switch_on), "not ready to switch on");
  EXPECT_STREQ(name(PowerState::switch_on_disabled), "switch on disabled");
  EXPECT_STREQ(name(PowerState::ready_to_switch_on), "ready to switch on");
  EXPECT_STREQ(name(PowerState::switched_on), "switched on");
  EXPECT_STREQ(name(PowerState::operation_enabled), "operation enabled");
  EXPECT_STREQ(name(PowerState::quick_stop_active), "quick stop active");
  EXPECT_STREQ(name(PowerState::fault_reaction_active), "fault reaction active");
  EXPECT_STREQ(name(PowerState::fault), "fault");
  EXPECT_STREQ(name(PowerState{200}), "unknown");
}

// Each name belongs to one cause, and an unknown name to none.
TEST(FaultCauseNames, LeadBackToTheCause) {
  for (unsigned i = 0; i < static_cast<unsigned>(drive::Cause::count_of_causes); ++i) {
    const drive::Cause cause{static_cast<std::uint8_t>(i)};
    EXPECT_EQ(drive::cause_from_name(name(cause)), cause) << name(cause);
    EXPECT_EQ(drive::cause_from_name((std::string(name(cause)) + "s").c_str()), drive::Cause::none);
  }
  EXPECT_STREQ(name(drive::Cause::none), "none");
  EXPECT_STREQ(name(drive::Cause::over_voltage), "over_voltage");
  EXPECT_EQ(drive::cause_from_name("over_volt"), drive::Cause::none);
  EXPECT_EQ(drive::cause_from_name(""), drive::Cause::none);
}

}  // namespace
}  // namespace power_state_test
}  // namespace servodrome
