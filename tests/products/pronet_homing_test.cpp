#include <gtest/gtest.h>

#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Homing of the ProNet drive on a plant: every method from every side, the refusals, and switches connected by wires or
// over the bus (60FEh:01).
namespace servodrome {
namespace pronet_homing_test {
namespace {

using products::Pronet;
using Axis = test::Rig<Pronet>;

constexpr std::int64_t turn = 10000;  // the incremental encoder, which has an index
constexpr std::int64_t index_at = 2500;
constexpr std::int64_t low_limit = -8 * turn - 300;
constexpr std::int64_t high_limit = 8 * turn + 700;
constexpr std::int64_t switch_from = turn + 1234;  // a little more than one turn of the travel
constexpr std::int64_t switch_to = 2 * turn + 4321;

// Inputs by the factory values of Pn509 and Pn510 (README.md of the product): POT CN1_16, NOT CN1_17, HmRef CN1_39.
constexpr std::uint8_t pot_wire = 2;
constexpr std::uint8_t not_wire = 3;
constexpr std::uint8_t home_wire = 4;

plant::Parameters travel(std::int64_t start, std::int32_t counts = turn) {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.counts_per_revolution = counts;
  parameters.encoder.start_position_counts = start;
  parameters.encoder.index_position_counts = index_at;
  parameters.switches[0] = {.wire = not_wire, .to_counts = low_limit};
  parameters.switches[1] = {.wire = pot_wire, .from_counts = high_limit};
  parameters.switches[2] = {.wire = home_wire, .from_counts = switch_from, .to_counts = switch_to};
  parameters.switch_count = 3;
  return parameters;
}

void prepare(Axis& axis, int method) {
  axis.run_ms(1);
  EXPECT_EQ(axis.set(0x6060, 0, 6), dictionary::AbortCode::none);
  EXPECT_EQ(axis.set(0x6098, 0, method), dictionary::AbortCode::none);
  EXPECT_EQ(axis.set(0x6099, 1, 3000), dictionary::AbortCode::none);  // 300 rpm
  EXPECT_EQ(axis.set(0x6099, 2, 100), dictionary::AbortCode::none);   // 10 rpm
  EXPECT_EQ(axis.set(0x609A, 0, 20000), dictionary::AbortCode::none);
  ASSERT_TRUE(axis.enable());
}

// Statusword bits 13, 12 and 10 at the end.
std::uint16_t home(Axis& axis) {
  axis.control(0x1F);
  axis.run_ms(2);
  EXPECT_GE(
      axis.run_until([&] { return (axis.status() & 0x3400) != 0x1000 && (axis.status() & 0x3400) != 0; }, 60000.0), 0);
  axis.run_ms(20);
  return axis.status() & 0x3400;
}

struct Way {
  int method;
  std::int64_t start;
  std::int64_t found;      // true position of home
  bool finishes_negative;  // the direction in which home is crossed
};

const std::vector<Way> ways{
    {1, 0, -8 * turn + index_at, false},  // the first index on the positive side of NOT
    {1, 7 * turn, -8 * turn + index_at, false},
    {1, low_limit - 500, -8 * turn + index_at, false},  // on the switch
    {2, 0, 7 * turn + index_at, true},                  // the first one on the negative side of POT
    {2, -7 * turn, 7 * turn + index_at, true},
    {2, high_limit + 500, 7 * turn + index_at, true},
    {3, 0, index_at, true},  // outside the switch
    {3, switch_from + 500, index_at, true},
    {4, 0, turn + index_at, false},  // inside
    {4, switch_from + 500, turn + index_at, false},
    {17, 0, low_limit + 1, false},
    {17, 7 * turn, low_limit + 1, false},
    {17, low_limit - 500, low_limit + 1, false},
    {18, 0, high_limit, true},
    {18, high_limit + 500, high_limit, true},
    {19, 0, switch_from, true},
    {19, switch_from + 500, switch_from, true},
    {20, 0, switch_from, false},
    {20, switch_from + 500, switch_from, false},
    {35, 4711, 4711, false},
};

TEST(PronetHoming, EveryMethodFromEverySide) {
  for (const Way& way : ways) {
    for (const std::int64_t offset : {std::int64_t{0}, std::int64_t{5000}, std::int64_t{-777}}) {
      SCOPED_TRACE("method " + std::to_string(way.method) + " from " + std::to_string(way.start) + " offset " +
                   std::to_string(offset));
      Axis axis(travel(way.start));
      prepare(axis, way.method);
      axis.set(0x607C, 0, offset);
      axis.sent.clear();
      EXPECT_EQ(home(axis), 0x1400);
      // 6064h at home is -607Ch: zero is 607Ch further in positive direction (ch. 7.2 and 7.2.3).
      const std::int64_t true_position = axis.plant.position_counts();
      EXPECT_NEAR(static_cast<double>(axis.get(0x6064) - true_position), static_cast<double>(-offset - way.found), 2.0);
      // No motion back: the axis stands where the ramp ended, beyond home by less than the distance of a stop from 10
      // rpm.
      if (way.method != 35) {
        const std::int64_t beyond = way.finishes_negative ? way.found - true_position : true_position - way.found;
        EXPECT_GE(beyond, -2);
        EXPECT_LE(beyond, 100);
      } else {
        EXPECT_NEAR(static_cast<double>(true_position), static_cast<double>(way.start), 2.0);
      }
      for (const canopen::Frame& frame : axis.sent) {
        EXPECT_NE(frame.id, 0x81U) << "the limit switches raise no alarm during homing";
      }
      EXPECT_EQ(axis.get(0x603F), 0);
    }
  }
}

// "Afterwards the drive slowly returns" (ch. 7.2.4): only the search for the switch is fast.
TEST(PronetHoming, OnlyTheSearchIsFast) {
  for (const int method : {1, 2, 3, 4, 17, 18, 19, 20}) {
    for (const std::int64_t start : {std::int64_t{0}, switch_from + 2000, low_limit - 500}) {
      if (start < low_limit && method != 1 && method != 17) continue;
      SCOPED_TRACE(testing::Message() << "method " << method << " from " << start);
      Axis axis(travel(start));
      prepare(axis, method);
      axis.control(0x1F);
      const bool on_switch = start != 0;
      const bool searches_positive = method == 2 || method == 18 || (method % 16 >= 3 && !on_switch);
      const bool searches_negative = method == 1 || method == 17;
      double most = 0.0;
      double least = 0.0;
      for (int i = 0; i < 60000 && (axis.status() & 0x1400) != 0x1400; ++i) {
        axis.run_ms(1);
        most = std::max(most, axis.device.drive().axis().generator.velocity());
        least = std::min(least, axis.device.drive().axis().generator.velocity());
      }
      EXPECT_EQ(axis.status() & 0x3400, 0x1400);
      constexpr double slow = 10.0 / 60.0 * turn * 1.001;
      if (!searches_positive) {
        EXPECT_LE(most, slow);
      }
      if (!searches_negative) {
        EXPECT_GE(least, -slow);
      }
    }
  }
}

// Any event while methods 4 and 20 search, return and look for the edge: the axis rests, and homing can be repeated
// with the same home.
TEST(PronetHoming, InterruptedAtEachLegItIsDoneAgain) {
  const auto reenable = [](Axis& axis) { axis.control(0x06), axis.run_ms(1), axis.control(0x0F), axis.run_ms(5); };
  const std::vector<std::pair<const char*, std::function<void(Axis&)>>> interruptions{
      {"bit 4 away", [](Axis& axis) { axis.control(0x0F), axis.run_ms(400); }},
      {"halt", [](Axis& axis) { axis.control(0x11F), axis.run_ms(400), axis.control(0x0F), axis.run_ms(400); }},
      {"disabled", [&](Axis& axis) { axis.control(0x07), axis.run_ms(3000), reenable(axis); }},
      {"quick stop",
       [&](Axis& axis) { axis.control(0x02), axis.run_ms(3000), axis.control(0x00), axis.run_ms(5), reenable(axis); }},
      {"another mode",
       [](Axis& axis) {
         axis.set(0x6060, 0, 3), axis.run_ms(400), axis.control(0x0F), axis.set(0x6060, 0, 6), axis.run_ms(5);
       }},
      {"NMT stop",
       [](Axis& axis) {
         axis.send(0x000, {0x02, 0x01}), axis.run_ms(50), axis.send(0x000, {0x01, 0x01}), axis.control(0x0F),
             axis.run_ms(400);
       }},
      {"enabled twice",
       [&](Axis& axis) {
         for (int i = 0; i < 2; ++i) axis.control(0x00), axis.run_ms(1000), reenable(axis);
       }},
      {"power",
       [](Axis& axis) {
         axis.plant.sample(axis.feedback);
         axis.device.power_off();
         axis.device.power_on(axis.feedback, axis.now());
         axis.run_ms(3000);
       }},
  };
  for (const int method : {4, 20}) {
    for (const double after_ms : {100.0, 420.0, 700.0, 1500.0}) {
      for (const auto& [what, interrupt] : interruptions) {
        SCOPED_TRACE(testing::Message() << "method " << method << ", " << what << " after " << after_ms << " ms");
        Axis axis(travel(0));
        prepare(axis, method);
        axis.control(0x1F);
        axis.run_ms(after_ms);
        ASSERT_EQ(axis.status() & 0x3400, 0);
        interrupt(axis);
        EXPECT_EQ(axis.status() & 0x1000, 0);
        EXPECT_FALSE(axis.device.drive().in_motion());
        EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 3.0);
        EXPECT_EQ(axis.get(0x603F), 0);
        const std::int64_t stands = axis.plant.position_counts();
        axis.run_ms(100);
        EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stands), 3.0);
        if (axis.device.drive().state() != drive::PowerState::operation_enabled) prepare(axis, method);
        ASSERT_EQ(home(axis), 0x1400);
        const std::int64_t found = axis.plant.position_counts() - axis.get(0x6064);
        EXPECT_NEAR(static_cast<double>(found), static_cast<double>(method == 4 ? turn + index_at : switch_from), 2.0);
      }
    }
  }
}

// "The error cause is found by reading the error code" (ch. 7.2.2): the code is shown while bit 13 is set, and
// afterwards until homing starts again or the mode changes. It is not an alarm.
TEST(PronetHoming, AnErrorTellsItsCode) {
  struct Failure {
    const char* what;
    int method;
    std::int64_t start;
    std::int64_t code;
    std::function<void(Axis&)> spoil;
  };
  const std::vector<Failure> failures{
      {"POT before the switch", 19, 3 * turn, 0x8681, [](Axis&) {}},
      {"POT at the start", 20, high_limit + 500, 0x8681, [](Axis&) {}},
      {"NOT instead of the switch's edge", 19, -7 * turn, 0x8682,
       [](Axis& axis) { axis.plant.force_input(home_wire, true); }},
      {"no speed", 17, 0, 0x6320, [](Axis& axis) { axis.set(0x6099, 2, 0); }},
      {"no ramp", 17, 0, 0x6320, [](Axis& axis) { axis.set(0x609A, 0, 0); }},
  };
  for (const Failure& failure : failures) {
    SCOPED_TRACE(failure.what);
    const auto fail = [&](Axis& axis) {
      prepare(axis, failure.method);
      failure.spoil(axis);
      axis.sent.clear();
      EXPECT_EQ(home(axis) & 0x3000, 0x2000);
      EXPECT_EQ(axis.get(0x603F), failure.code);
      EXPECT_EQ(axis.status() & 0x6F, 0x27) << "no alarm";
    };
    {
      Axis axis(travel(failure.start));
      fail(axis);
      axis.control(0x0F);
      axis.run_ms(5);
      EXPECT_EQ(axis.get(0x603F), failure.code);
      axis.set(0x6098, 0, 35);
      EXPECT_EQ(home(axis), 0x1400);
      EXPECT_EQ(axis.get(0x603F), 0) << "homing started again";
    }
    {
      Axis axis(travel(failure.start));
      fail(axis);
      axis.set(0x6060, 0, 3);
      axis.run_ms(5);
      EXPECT_EQ(axis.get(0x603F), 0) << "another mode";
    }
    {
      Axis axis(travel(failure.start));
      fail(axis);
      axis.control(0x00);
      axis.run_ms(5);
      EXPECT_EQ(axis.get(0x603F), failure.code) << "can still be read without power";
      ASSERT_TRUE(axis.enable());
      EXPECT_EQ(axis.get(0x603F), 0);
      EXPECT_EQ(axis.status() & 0x2000, 0);
    }
    {
      Axis axis(travel(failure.start));
      fail(axis);
      axis.device.drive().inject(drive::Cause::current_sensor, true);
      axis.run_ms(2);
      EXPECT_EQ(axis.get(0x603F), 0x5210) << "an alarm comes first";
      axis.set(0x6060, 0, 3);
      axis.run_ms(2);
      EXPECT_EQ(axis.get(0x603F), 0x5210);
      axis.device.drive().inject(drive::Cause::current_sensor, false);
      axis.control(0x00);
      axis.run_ms(2);
      axis.control(0x80);
      axis.run_ms(2);
      EXPECT_EQ(axis.get(0x603F), 0);
    }
    {
      Axis axis(travel(failure.start));
      fail(axis);
      axis.send(0x000, {0x81, 0x01});
      axis.run_ms(5);
      EXPECT_EQ(axis.get(0x603F), 0) << "reset node";
    }
  }
}

// The incremental encoder counts from the shaft's position at power-on (ch. 4 and 7.2); the others have an absolute
// position within a turn.
TEST(PronetHoming, AnIncrementalEncoderBeginsAtZero) {
  for (const std::int32_t counts : {10000, 131072, 65536}) {
    SCOPED_TRACE(counts);
    const bool incremental = counts == turn;
    constexpr std::int64_t start = 34711;
    plant::Parameters parameters = travel(start, counts);
    parameters.switch_count = 0;
    Axis axis(parameters);
    axis.run_ms(5);
    EXPECT_EQ(axis.get(0x6064), incremental ? 0 : start);
    EXPECT_EQ(axis.get(0x6062), incremental ? 0 : start);
    EXPECT_EQ(axis.get(0x6063), incremental ? 0 : start);
    EXPECT_EQ(axis.get(0x3300), incremental ? 0 : start / counts);
    EXPECT_EQ(axis.get(0x3301), incremental ? 0 : start % counts);
    axis.set(0x6060, 0, 3);
    ASSERT_TRUE(axis.enable());
    axis.set(0x60FF, 0, 1000);
    axis.run_ms(1000);
    const std::int64_t before = axis.get(0x6064);
    EXPECT_NEAR(static_cast<double>(before), counts * 1.66 + static_cast<double>(incremental ? 0 : start),
                counts * 0.1);
    axis.send(0x000, {0x81, 0x01});  // the axis coasts
    axis.run_ms(10);
    EXPECT_GT(axis.get(0x6064), before) << "NMT resets no encoder";
    axis.run_ms(3000);
    const std::int64_t stands = axis.plant.position_counts();
    axis.plant.sample(axis.feedback);
    axis.device.power_off();
    axis.device.power_on(axis.feedback, axis.now());
    axis.run_ms(5);
    EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), static_cast<double>(incremental ? 0 : stands), 1.0);
  }
}

TEST(PronetHoming, HomeIsLostWithThePowerOfAnIncrementalEncoder) {
  Axis axis(travel(switch_from + 500));
  prepare(axis, 19);
  EXPECT_EQ(home(axis), 0x1400);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), 0.0, 100.0);
  axis.plant.sample(axis.feedback);
  axis.device.power_off();
  axis.device.power_on(axis.feedback, axis.now());
  axis.run_ms(5);
  EXPECT_EQ(axis.get(0x6064), 0);
  prepare(axis, 19);
  EXPECT_EQ(home(axis), 0x1400) << "and is found again";
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - axis.get(0x6064)), static_cast<double>(switch_from),
              2.0);
}

// Serial encoders and resolvers have no index: 1 to 4 start no motion (ch. 7.2).
TEST(PronetHoming, IndexMethodsNeedAnIncrementalEncoder) {
  for (const std::int32_t counts : {131072, 65536}) {
    for (const int method : {1, 2, 3, 4}) {
      Axis axis(travel(0, counts));
      prepare(axis, method);
      EXPECT_EQ(home(axis) & 0x3000, 0x2000) << counts << " " << method;
      EXPECT_EQ(axis.get(0x603F), 0x6320) << "the cause (ch. 7.2.2)";
      EXPECT_EQ(axis.plant.position_counts(), 0);
      EXPECT_EQ(axis.status() & 0x6F, 0x27) << "no fault";
    }
    Axis axis(travel(0, counts));
    prepare(axis, 17);
    EXPECT_EQ(home(axis), 0x1400);
  }
}

TEST(PronetHoming, WithoutSpeedOrAccelerationNothingMoves) {
  for (const auto& [index, sub] : {std::pair{0x6099, 1}, std::pair{0x6099, 2}, std::pair{0x609A, 0}}) {
    Axis axis(travel(0));
    prepare(axis, 17);
    axis.set(static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), 0);
    axis.control(0x1F);
    axis.run_ms(500);
    EXPECT_EQ(axis.plant.position_counts(), 0);
    EXPECT_EQ(axis.status() & 0x1400, 0);
    EXPECT_EQ(axis.status() & 0x6F, 0x27);
  }
}

TEST(PronetHoming, BitFourInterruptsAndHaltStops) {
  Axis axis(travel(0));
  prepare(axis, 17);
  axis.control(0x1F);
  axis.run_ms(300);
  EXPECT_TRUE(axis.device.drive().in_motion());
  axis.control(0x11F);  // halt
  axis.run_ms(300);
  EXPECT_FALSE(axis.device.drive().in_motion());
  EXPECT_EQ(axis.status() & 0x3400, 0x0400);  // speed 0 under halt
  axis.control(0x1F);
  axis.run_ms(300);
  EXPECT_TRUE(axis.device.drive().in_motion());
  axis.control(0x0F);
  axis.run_ms(300);
  EXPECT_FALSE(axis.device.drive().in_motion());
  EXPECT_EQ(axis.status() & 0x3400, 0);
  EXPECT_EQ(home(axis), 0x1400) << "and may be started again";
}

// --- Inputs (ch. 10.1, 60FEh)

std::uint32_t inputs(Axis& axis) {
  axis.run_ms(1);
  return static_cast<std::uint32_t>(axis.get(0x60FD));
}

// The digit of input `terminal` in the pair of parameters that the eight inputs share.
void set_digit(Axis& axis, std::uint16_t first, int terminal, unsigned value) {
  const auto index = static_cast<std::uint16_t>(first + terminal / 4);
  const unsigned shift = 4U * (static_cast<unsigned>(terminal) % 4U);
  const auto word = static_cast<unsigned>(axis.get(index));
  axis.set(index, 0, (word & ~(0xFU << shift)) | value << shift);
}

TEST(PronetInputs, EachTerminalCanHaveEachFunctionFromWireAndBus) {
  constexpr std::pair<unsigned, std::uint32_t> functions[] = {{0x3, 1U}, {0x2, 2U}, {0xC, 4U}};  // NOT, POT, HmRef
  for (int terminal = 0; terminal < 8; ++terminal) {
    for (const auto& [code, bit] : functions) {
      SCOPED_TRACE("terminal " + std::to_string(terminal) + " function " + std::to_string(code));
      Axis axis;
      axis.run_ms(1);
      axis.set(0x3081, 0, 0);  // Pn509, Pn510: nothing assigned
      axis.set(0x3082, 0, 0);
      EXPECT_EQ(inputs(axis), 0U);
      set_digit(axis, 0x3081, terminal, code);
      axis.plant.force_input(terminal, true);
      EXPECT_EQ(inputs(axis), bit) << "wire";
      set_digit(axis, 0x3088, terminal, 1);  // Pn516, Pn517: inverted
      EXPECT_EQ(inputs(axis), 0U);
      axis.plant.force_input(terminal, false);
      EXPECT_EQ(inputs(axis), bit);
      set_digit(axis, 0x3088, terminal, 0);
      EXPECT_EQ(inputs(axis), 0U);

      const std::int64_t bus_bit = std::int64_t{1} << (24 + terminal);  // CN1_14 is bit 24 (ch. 10.1)
      axis.set(0x60FE, 1, bus_bit);
      EXPECT_EQ(inputs(axis), 0U) << "the bus commits nothing that Pn512 and Pn513 do not enable";
      set_digit(axis, 0x3084, terminal, 1);
      EXPECT_EQ(inputs(axis), bit) << "bus";
      axis.set(0x60FE, 1, ~bus_bit & 0xFFFFFFFF);
      EXPECT_EQ(inputs(axis), 0U);
      axis.plant.force_input(terminal, true);
      EXPECT_EQ(inputs(axis), 0U) << "the wire is not looked at any more";
      set_digit(axis, 0x3088, terminal, 1);
      EXPECT_EQ(inputs(axis), bit) << "inversion comes after the bus";
    }
  }
}

// Pn514 in 0.2 ms: shorter pulses have no effect, from a wire or the bus; edges come together with the level.
TEST(PronetInputs, FilteredLevelsAreSeenLate) {
  Axis axis;
  axis.run_ms(1);
  axis.set(0x3086, 0, 25);  // 5 ms
  axis.plant.force_input(home_wire, true);
  axis.run_ms(4);
  axis.plant.force_input(home_wire, false);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(inputs(axis), 0U);
  axis.plant.force_input(home_wire, true);
  axis.run_ms(4.5);
  EXPECT_EQ(axis.get(0x60FD), 0);
  axis.run_ms(1.5);
  EXPECT_EQ(axis.get(0x60FD), 4);
  axis.plant.force_input(home_wire, false);
  axis.run_ms(4.5);
  EXPECT_EQ(axis.get(0x60FD), 4);
  axis.run_ms(1.5);
  EXPECT_EQ(axis.get(0x60FD), 0);
}

TEST(PronetInputs, HomingWithFilteredSwitches) {
  Axis axis(travel(0));
  prepare(axis, 19);
  axis.set(0x3086, 0, 25);
  EXPECT_EQ(home(axis), 0x1400);
  // 5 to 6 ms at 10 rpm, which is 9 counts, when crossing the edge in negative direction.
  const std::int64_t found = axis.plant.position_counts() - axis.get(0x6064);
  EXPECT_NEAR(static_cast<double>(found), static_cast<double>(switch_from - 9), 4.0);
}

// A controller that has the reference switch on its own inputs homes the drive over the bus (ch. 10.1).
TEST(PronetInputs, HomingByASwitchOfTheMaster) {
  plant::Parameters parameters = travel(0);
  parameters.switch_count = 0;
  for (const int method : {17, 18, 19, 20}) {
    SCOPED_TRACE(method);
    Axis axis(parameters);
    prepare(axis, method);
    axis.set(0x3084, 0, 0x1100);  // CN1_16, CN1_17
    axis.set(0x3085, 0, 0x0001);  // CN1_39
    axis.control(0x1F);
    for (int cycle = 0; cycle < 60000 && (axis.status() & 0x1400) != 0x1400; ++cycle) {
      axis.run_ms(1);
      const std::int64_t position = axis.plant.position_counts();
      std::int64_t bits = 0;
      if (position <= -turn) bits |= std::int64_t{1} << 27;
      if (position >= turn) bits |= std::int64_t{1} << 26;
      if (position >= 3000 && position <= 6000) bits |= std::int64_t{1} << 28;
      axis.set(0x60FE, 1, bits);
    }
    EXPECT_EQ(axis.status() & 0x3400, 0x1400);
    const std::int64_t home = axis.plant.position_counts() - axis.get(0x6064);
    const std::int64_t expected = method == 17 ? -turn : method == 18 ? turn : 3000;
    // 10 rpm are 1.7 counts in the millisecond between the switch and the bus, plus one position cycle.
    EXPECT_NEAR(static_cast<double>(home), static_cast<double>(expected), 4.0);
  }
}

// Outside homing a limit switch stops the axis and blocks its direction (README.md of the product).
TEST(PronetInputs, LimitSwitchStopsAndBlocksOneDirection) {
  Axis axis(travel(7 * turn));
  axis.run_ms(1);
  axis.set(0x6060, 0, 3);
  ASSERT_TRUE(axis.enable());
  EXPECT_EQ(axis.status() & 0x0880, 0);
  axis.set(0x60FF, 0, 3000);
  axis.run_ms(2000);
  EXPECT_FALSE(axis.device.drive().in_motion());
  EXPECT_EQ(axis.status() & 0x08EF, 0x08A7) << "bits 11 and 7, no fault";
  EXPECT_EQ(axis.get(0x60FD), 2);
  const std::int64_t stopped = axis.plant.position_counts();
  EXPECT_GT(stopped, high_limit);
  EXPECT_LT(stopped, high_limit + turn / 2);
  axis.run_ms(200);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), static_cast<double>(stopped), 3.0);
  axis.set(0x60FF, 0, -3000);
  axis.run_ms(500);
  EXPECT_LT(axis.plant.position_counts(), high_limit);
  EXPECT_EQ(axis.status() & 0x0880, 0);
}

}  // namespace
}  // namespace pronet_homing_test
}  // namespace servodrome
