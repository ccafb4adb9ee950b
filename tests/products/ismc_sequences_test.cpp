// Sequences of commands and events in the use of an ISMC drive: limit switches outside of homing, homing with only one
// of its speeds set, a clipped profile velocity, a failed encoder.
#include <algorithm>
#include <gtest/gtest.h>

#include "products/ismc/ismc.hpp"
#include "rig.hpp"

namespace servodrome {
namespace ismc_sequences_test {
namespace {

using dictionary::AbortCode;
using plant::Injection;
using products::Ismc;
using Axis = test::Rig<Ismc>;

constexpr std::int64_t speed = 500000;  // counts/s
constexpr int negative_limit = 0;       // inputs with the factory assignment (2F12h)
constexpr int positive_limit = 1;
constexpr std::uint16_t state_mask = 0x4F;
constexpr std::uint16_t in_fault = 0x08;

void must_set(Axis& axis, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(axis.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub};
}

bool in_fault_within(Axis& axis, double limit_ms) {
  return axis.run_until([&] { return (axis.status() & state_mask) == in_fault; }, limit_ms) >= 0;
}

void reset_fault(Axis& axis) {
  axis.control(0x00);
  axis.run_ms(1);
  axis.control(0x80);
  axis.run_ms(1);
  axis.control(0x00);
  axis.run_ms(1);
}

bool sent_emergency(const Axis& axis, std::uint16_t code) {
  for (const canopen::Frame& frame : axis.sent) {
    if (frame.id == 0x81 && (frame.data[0] | frame.data[1] << 8) == code) return true;
  }
  return false;
}

// --- Limit switches outside of homing (ch. 5, 8612h)

// How the axis moves towards an end, and away from it.
struct Motion {
  const char* name;
  std::int8_t mode;
  void (*towards)(Axis&, int direction);
};

void point(Axis& axis, int direction) {
  must_set(axis, 0x607A, 0, direction * 100'000'000);
  axis.control(0x0F);
  axis.run_ms(1);
  axis.control(0x3F);
}
void velocity(Axis& axis, int direction) { must_set(axis, 0x60FF, 0, direction * speed); }
void torque(Axis& axis, int direction) { must_set(axis, 0x6071, 0, direction * 200); }
void stream(Axis& axis, int direction) {
  std::int64_t target = axis.get(0x6064);
  for (int i = 1; i <= 450 && (axis.status() & state_mask) != in_fault; ++i) {
    target += direction * std::clamp(10 * (440 - i), 0, 400);  // stops; a step back would lead to the switch
    must_set(axis, 0x607A, 0, target);
    axis.run_ms(1);
  }
}

const Motion motions[] = {
    {"position", 1, point}, {"velocity", 3, velocity}, {"torque", 4, torque}, {"cyclic", 8, stream}};

void prepare(Axis& axis, std::int8_t mode) {
  must_set(axis, 0x605E, 0, 2);  // a ramp, so that the axis does not coast
  must_set(axis, 0x6060, 0, mode);
  must_set(axis, 0x6081, 0, speed);
  must_set(axis, 0x6085, 0, 13107200);
  ASSERT_TRUE(axis.enable());
}

TEST(IsmcLimitSwitch, OneThatIsMetOutsideOfHomingIsFault8612) {
  for (const Motion& motion : motions) {
    for (const int direction : {-1, 1}) {
      SCOPED_TRACE(std::string(motion.name) + (direction < 0 ? " negative" : " positive"));
      const int ahead = direction < 0 ? negative_limit : positive_limit;
      Axis axis;
      prepare(axis, motion.mode);
      motion.towards(axis, direction);
      axis.run_ms(100);
      ASSERT_EQ(axis.status() & 0x6F, 0x27);
      if (motion.mode == 8) {  // the master continues to send targets while the switch closes
        axis.plant.force_input(ahead, true);
        stream(axis, direction);
      } else {
        axis.plant.force_input(ahead, true);
      }
      ASSERT_TRUE(in_fault_within(axis, 2000.0));  // with the ramp from up to 4000 rpm
      EXPECT_EQ(axis.get(0x603F), 0x8612);
      EXPECT_TRUE(sent_emergency(axis, 0x8612));
      axis.run_ms(300);
      EXPECT_FALSE(axis.actuation.pwm_enabled);

      // After a reset on the switch, a motion towards it causes the fault again before the axis moves; a motion away is
      // possible.
      must_set(axis, 0x60FF, 0, 0);
      must_set(axis, 0x6071, 0, 0);
      must_set(axis, 0x607A, 0, axis.get(0x6064));
      reset_fault(axis);
      ASSERT_TRUE(axis.enable()) << "a switch that is active is no fault by itself";
      const std::int64_t from = axis.plant.position_counts();
      motion.towards(axis, direction);
      ASSERT_TRUE(in_fault_within(axis, 500.0));
      EXPECT_LT(std::abs(axis.plant.position_counts() - from), 300);
      must_set(axis, 0x60FF, 0, 0);
      must_set(axis, 0x6071, 0, 0);
      must_set(axis, 0x607A, 0, axis.get(0x6064));
      reset_fault(axis);
      ASSERT_TRUE(axis.enable());
      motion.towards(axis, -direction);
      axis.run_ms(200);
      EXPECT_EQ(axis.status() & 0x6F, 0x27) << std::hex << axis.get(0x603F);
      EXPECT_GT(static_cast<double>(axis.plant.position_counts() - from) * -direction, 1000.0);
    }
  }
}

TEST(IsmcLimitSwitch, TheOtherEndAndHomingAreLeftAlone) {
  Axis axis;
  prepare(axis, 3);
  axis.plant.force_input(negative_limit, true);
  velocity(axis, 1);
  axis.run_ms(300);
  EXPECT_EQ(axis.status() & 0x6F, 0x27);
  velocity(axis, 0);
  axis.run_ms(300);
  // Method 17 looks for the switch.
  axis.plant.force_input(negative_limit, false);
  must_set(axis, 0x6098, 0, 17);
  must_set(axis, 0x6099, 1, 100000);
  must_set(axis, 0x6099, 2, 20000);
  must_set(axis, 0x609A, 0, 1310720);
  must_set(axis, 0x6060, 0, 6);
  axis.run_ms(1);
  axis.control(0x1F);
  axis.run_ms(200);
  axis.plant.force_input(negative_limit, true);
  axis.run_ms(500);
  axis.plant.force_input(negative_limit, false);
  axis.run_ms(500);
  EXPECT_EQ(axis.status() & 0x1400, 0x1400);
}

TEST(IsmcLimitSwitch, AStopOnItsWayIsNotDisturbed) {
  Axis axis;
  prepare(axis, 3);
  velocity(axis, 1);
  axis.run_ms(300);
  axis.control(0x010F);  // halt
  axis.run_ms(2);
  axis.plant.force_input(positive_limit, true);
  axis.run_ms(1000);
  EXPECT_EQ(axis.status() & 0x6F, 0x27);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 1.0);
  axis.control(0x000F);  // released: towards the switch
  ASSERT_TRUE(in_fault_within(axis, 100.0));
  EXPECT_EQ(axis.get(0x603F), 0x8612);
}

// --- Homing needs the speeds that its method uses (ch. 4.7.6)

TEST(IsmcHoming, ASpeedThatTheMethodDoesNotUseMayBeZero) {
  struct Row {
    std::int8_t method;
    bool uses_fast, uses_slow;
  };
  for (const Row& row : {Row{33, false, true}, Row{34, false, true}, Row{-1, true, false}, Row{-2, true, false},
                         Row{-3, true, true}, Row{35, false, false}, Row{17, true, true}, Row{19, true, true}}) {
    for (const bool fast : {false, true}) {
      for (const bool slow : {false, true}) {
        SCOPED_TRACE("method " + std::to_string(row.method) + (fast ? " fast" : "") + (slow ? " slow" : ""));
        Axis axis;
        must_set(axis, 0x6098, 0, row.method);
        must_set(axis, 0x6099, 1, fast ? 100000 : 0);
        must_set(axis, 0x6099, 2, slow ? 20000 : 0);
        must_set(axis, 0x609A, 0, 1310720);
        must_set(axis, 0x6060, 0, 6);
        ASSERT_TRUE(axis.enable());
        axis.control(0x1F);
        axis.run_ms(5);
        const bool enough = (fast || !row.uses_fast) && (slow || !row.uses_slow);
        EXPECT_EQ((axis.status() & state_mask) != in_fault, enough);
        if (!enough) {
          EXPECT_EQ(axis.get(0x603F), 0x6280);
        }
      }
    }
  }
}

TEST(IsmcHoming, ARetractionNeedsTheSlowSpeed) {
  Axis axis;
  must_set(axis, 0x2F10, 0, 1000);
  must_set(axis, 0x6098, 0, -1);
  must_set(axis, 0x6099, 1, 100000);
  must_set(axis, 0x6099, 2, 0);
  must_set(axis, 0x609A, 0, 1310720);
  must_set(axis, 0x6060, 0, 6);
  ASSERT_TRUE(axis.enable());
  axis.control(0x1F);
  ASSERT_TRUE(in_fault_within(axis, 5.0));
  EXPECT_EQ(axis.get(0x603F), 0x6280);
}

// --- Writes of masters, and their answers

TEST(IsmcObjects, TheInterpolationTimeIndexIsMilliseconds) {
  Axis axis;
  EXPECT_EQ(axis.get(0x60C2, 0), 2);
  EXPECT_EQ(axis.get(0x60C2, 2), -3);
  EXPECT_EQ(axis.set(0x60C2, 2, -3), AbortCode::none);
  EXPECT_NE(axis.set(0x60C2, 2, -4), AbortCode::none);
  EXPECT_NE(axis.set(0x60C2, 2, 0), AbortCode::none);
  EXPECT_EQ(axis.get(0x60C2, 2), -3);
}

TEST(IsmcProfilePosition, Bit11TellsThatTheVelocityIsClamped) {
  Axis axis;
  must_set(axis, 0x6060, 0, 1);
  must_set(axis, 0x6081, 0, speed);
  ASSERT_TRUE(axis.enable());
  const auto move = [&axis](std::int64_t distance) {
    must_set(axis, 0x607A, 0, distance);
    axis.control(0x5F);
    axis.run_ms(2);
    axis.control(0x0F);
  };
  must_set(axis, 0x607F, 0, speed / 2);
  move(400000);
  axis.run_ms(400);
  EXPECT_EQ(axis.status() & 0x0800, 0x0800);
  EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), speed / 2.0, 0.05 * speed);
  axis.run_ms(3000);
  ASSERT_EQ(axis.status() & 0x0400, 0x0400);
  must_set(axis, 0x607F, 0, speed);
  move(400000);
  axis.run_ms(500);
  EXPECT_EQ(axis.status() & 0x0800, 0) << "as fast as asked for";
}

// --- A failed encoder is reported until it loses its supply (ch. 5)

TEST(IsmcEncoder, AnInternalErrorStaysUntilPowerOff) {
  struct Row {
    std::uint16_t code;
    Injection injection;
    bool latched;
  };
  for (const Row& row :
       {Row{0x7383, Injection::encoder_multi_turn, true}, Row{0x7385, Injection::encoder_count, true},
        Row{0x7389, Injection::encoder_overflow, true}, Row{0x738B, Injection::encoder_delimiter, true},
        Row{0x7380, Injection::encoder_loss, false}, Row{0x738A, Injection::encoder_crc, false}}) {
    SCOPED_TRACE(row.code);
    Axis axis;
    ASSERT_TRUE(axis.enable());
    axis.plant.inject(row.injection, true);
    ASSERT_TRUE(in_fault_within(axis, 10.0));
    axis.plant.inject(row.injection, false);
    axis.run_ms(20);
    reset_fault(axis);
    EXPECT_EQ((axis.status() & state_mask) == in_fault, row.latched);
    // NMT reset node restarts the firmware, not the encoder.
    for (const std::uint8_t command : {std::uint8_t{0x81}, std::uint8_t{0x82}}) {
      axis.sent.clear();
      axis.send(0, {command, 0});
      axis.run_ms(20);
      EXPECT_EQ((axis.status() & state_mask) == in_fault, row.latched) << int{command};
      EXPECT_EQ(axis.get(0x603F), row.latched ? row.code : 0);
      EXPECT_EQ((axis.get(0x1001) & 0x20) != 0, row.latched);
      if (command == 0x81) {
        EXPECT_EQ(sent_emergency(axis, row.code), row.latched);
      }
      reset_fault(axis);
      EXPECT_EQ((axis.status() & state_mask) == in_fault, row.latched);
    }
    axis.device.power_off();
    axis.control(0);
    axis.device.power_on(axis.feedback, axis.now());
    axis.run_ms(5);
    EXPECT_EQ(axis.status() & state_mask, 0x40);
    EXPECT_EQ(axis.get(0x603F), 0);
  }
}

}  // namespace
}  // namespace ismc_sequences_test
}  // namespace servodrome
