// Enabling must not move the axis, whatever targets remain from before; with every product on every bus it has.
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"
#include "axis/cia402_words.hpp"
#include "drive/drive.hpp"
#include "master/forwarded_objects.hpp"

namespace servodrome::master::test {
namespace enable_test {
namespace {

using testing::HasSubstr;

constexpr std::uint16_t quick_stop_word = 0x0002;

class Enabling : public testing::TestWithParam<RigCase> {
 protected:
  static constexpr double nothing = 0.01;  // tolerance in revolutions, for the change from brake to control loop

  double shaft() { return rig.shaft_counts() / rig.drive().plant().parameters().encoder.counts_per_revolution; }
  std::int32_t revolutions(double number) const { return static_cast<std::int32_t>(number * units.position); }
  std::int32_t speed(double rps) const { return static_cast<std::int32_t>(rps * units.velocity); }
  MotionProfile profile() const {
    const auto ramp = static_cast<std::uint32_t>(50 * units.acceleration);
    return {.velocity = static_cast<std::uint32_t>(speed(2)), .acceleration = ramp, .deceleration = ramp};
  }
  bool has_mode(OperationMode mode) {
    return problem_of([&] { axis.set_mode(mode); }).empty();
  }
  // Like the STOP button of the page: writes only the controlword, and then waits until the axis stands.
  void big_stop() {
    rig.objects().write<std::uint16_t>(0x6040, 0, quick_stop_word);
    rig.objects().wait(2s);
  }
  void expect_enabling_moves_nothing(const char* after) {
    const double before = shaft();
    axis.enable();
    rig.objects().wait(1s);
    EXPECT_EQ(axis.state(), PowerState::operation_enabled) << after;
    EXPECT_NEAR(shaft(), before, nothing) << after;
    axis.disable();
  }

  AxisRig rig{GetParam()};
  Axis402 axis{rig.objects(), rig.options()};
  AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
};
INSTANTIATE_TEST_SUITE_P(Every, Enabling, testing::ValuesIn(every_product),
                         [](const auto& row) { return row.param.name(); });

TEST_P(Enabling, ARunThatWasStoppedIsNotRevived) {
  axis.enable();
  axis.run_at(speed(2), profile(), 5s);
  big_stop();
  expect_enabling_moves_nothing("STOP");
}

TEST_P(Enabling, ARunThatLostItsPowerIsNotRevived) {
  axis.enable();
  axis.run_at(speed(2), profile(), 5s);
  rig.objects().write<std::uint16_t>(0x6040, 0, 0);
  rig.objects().wait(5s);
  expect_enabling_moves_nothing("disable voltage");
}

TEST_P(Enabling, AMoveThatWasStoppedIsNotRevived) {
  axis.enable();
  axis.start_move_by(revolutions(20), profile());
  rig.objects().wait(1s);
  big_stop();
  expect_enabling_moves_nothing("STOP in a move");
}

TEST_P(Enabling, ATorqueThatWasStoppedIsNotRevived) {
  if (!has_mode(OperationMode::profile_torque)) return;
  axis.enable();
  axis.set_mode(OperationMode::profile_torque);
  rig.objects().write<std::int16_t>(0x6071, 0, 200);
  rig.objects().wait(50ms);
  big_stop();
  expect_enabling_moves_nothing("STOP with torque");
}

// Targets that another master or a user has left in a drive that is off.
TEST_P(Enabling, TargetsLeftInADisabledDriveDoNotAct) {
  struct Left {
    OperationMode mode;
    std::uint16_t index;
    std::int32_t value;
    bool is_optional = false;
  };
  const std::int32_t far = axis.position() + revolutions(3);
  const Left all[] = {{OperationMode::profile_position, 0x607A, far},
                      {OperationMode::velocity, 0x6042, 300},
                      {OperationMode::profile_velocity, 0x60FF, speed(2)},
                      {OperationMode::profile_torque, 0x6071, 200},
                      {OperationMode::cyclic_synchronous_position, 0x607A, far},
                      {OperationMode::cyclic_synchronous_velocity, 0x60FF, speed(2)},
                      {OperationMode::cyclic_synchronous_torque, 0x6071, 200},
                      {OperationMode::cyclic_synchronous_velocity, 0x60B1, speed(2), true},
                      {OperationMode::cyclic_synchronous_position, 0x60B1, speed(2), true},
                      {OperationMode::cyclic_synchronous_torque, 0x60B2, 200, true}};
  for (const Left& left : all) {
    if (!has_mode(left.mode)) continue;
    axis.set_mode(left.mode);
    if (left.is_optional) {
      // The size of the offsets differs between products.
      const auto write_short = [&] {
        rig.objects().write<std::int16_t>(left.index, 0, static_cast<std::int16_t>(left.value));
      };
      const auto write_long = [&] { rig.objects().write<std::int32_t>(left.index, 0, left.value); };
      if (!problem_of(write_long).empty() && !problem_of(write_short).empty()) continue;
    } else if (left.index == 0x6071 || left.index == 0x6042) {
      rig.objects().write<std::int16_t>(left.index, 0, static_cast<std::int16_t>(left.value));
    } else {
      rig.objects().write<std::int32_t>(left.index, 0, left.value);
    }
    expect_enabling_moves_nothing(std::string(name(left.mode)).c_str());
  }
}

// After a quick stop or halt by the master, the drive must have no target, even if another master enables it.
TEST_P(Enabling, WhatStopsLeavesNoTarget) {
  for (const bool quick : {true, false}) {
    axis.enable();
    axis.run_at(speed(2), profile(), 5s);
    if (quick) {
      axis.quick_stop();
    } else {
      axis.stop();
    }
    EXPECT_EQ(rig.objects().read<std::int32_t>(0x60FF), 0) << (quick ? "quick stop" : "halt");
    axis.disable();
  }
}

// The objects of a drive that opens its brake before it shows Operation enabled.
class SlowBrake final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;

  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    constexpr std::byte operation_enabled_bit{0x04};
    if (object.index == 0x6041 && (bytes[0] & std::byte{0x08}) == std::byte{0}) bytes[0] &= ~operation_enabled_bit;
    return bytes;
  }
  void download(ObjectAddress object, std::span<const std::byte> data) override {
    is_commanded |= object.index == 0x6040 && (data[0] & std::byte{0x0F}) == std::byte{0x0F};
    ForwardedObjects::download(object, data);
  }

  bool is_commanded = false;
};

TEST_P(Enabling, ACommandThatIsCancelledOrFailsIsTakenBack) {
  for (const bool is_cancelled : {true, false}) {
    SlowBrake objects(rig.objects());
    AxisOptions options = rig.options();
    options.enable_timeout = 3s;
    if (is_cancelled) options.cancelled = [&objects] { return objects.is_commanded; };
    Axis402 slow(objects, options);
    EXPECT_THAT(problem_of([&] { slow.enable(); }), HasSubstr(is_cancelled ? "was cancelled" : "did not enable"));
    EXPECT_TRUE(objects.is_commanded);
    rig.objects().wait(2s);
    EXPECT_FALSE(rig.drive().device().drive().energised()) << is_cancelled;
    EXPECT_EQ(axis.state(), PowerState::switch_on_disabled) << is_cancelled;
  }
}

// Another client acts after the first write.
class Beside final : public ForwardedObjects {
 public:
  Beside(ObjectClient& drive, std::function<void()> other) : ForwardedObjects(drive), other_(std::move(other)) {}

  void download(ObjectAddress object, std::span<const std::byte> data) override {
    ForwardedObjects::download(object, data);
    if (const auto act = std::exchange(other_, nullptr)) act();
  }

 private:
  std::function<void()> other_;
};

TEST(EnablingThatFails, BrakesAnAxisThatAnotherClientMovesByNow) {
  AxisRig rig{{"generic402"}};
  Axis402 other(rig.objects(), rig.options());
  Beside objects(rig.objects(), [&] {
    other.enable();
    other.run_at(2 * 131072, {.acceleration = 10 * 131072, .deceleration = 10 * 131072}, 5s);
  });
  AxisOptions options = rig.options();
  options.enable_timeout = 1s;
  Axis402 axis(objects, options);
  EXPECT_THAT(problem_of([&] { axis.enable(); }), HasSubstr("did not get ready to switch on"));
  EXPECT_EQ(axis.state(), PowerState::quick_stop_active);
  rig.objects().wait(2s);
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
}

// Bits of the statusword are wrong from some moment on.
class WrongBits final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;

  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index == 0x6041) bytes[0] ^= wrong;
    return bytes;
  }

  std::byte wrong{};
};

// Bit 1: the word matches no state. Bit 3: it is that of a fault reaction.
TEST(StoppingWithAWrongStatusword, BringsTheAxisToRest) {
  for (const std::byte wrong : {std::byte{0x02}, std::byte{0x08}}) {
    for (void (Axis402::*const end)() : {&Axis402::stop, &Axis402::quick_stop, &Axis402::disable}) {
      AxisRig rig{{"generic402"}};
      WrongBits objects(rig.objects());
      Axis402 axis(objects, rig.options());
      axis.enable();
      axis.run_at(2 * 131072, {.acceleration = 10 * 131072, .deceleration = 10 * 131072}, 5s);
      objects.wrong = wrong;
      problem_of([&] { (axis.*end)(); });
      rig.objects().wait(3s);
      const double place = rig.shaft_counts();
      rig.objects().wait(1s);
      EXPECT_NEAR(rig.shaft_counts(), place, 20) << std::to_integer<int>(wrong);
      EXPECT_NE(Axis402(rig.objects(), rig.options()).state(), PowerState::operation_enabled);
    }
  }
}

// One write of the controlword gets no answer: the request or the answer is lost.
class Lossy final : public ForwardedObjects {
 public:
  Lossy(ObjectClient& drive, std::uint16_t word, bool loses_request)
      : ForwardedObjects(drive), word_(word), loses_request_(loses_request) {}

  void download(ObjectAddress object, std::span<const std::byte> data) override {
    const bool is_lost = object.index == 0x6040 && data[0] == static_cast<std::byte>(word_) && ++writes == 1;
    if (!is_lost || !loses_request_) ForwardedObjects::download(object, data);
    if (!is_lost) return;
    if (meanwhile) meanwhile();
    throw ObjectError("no answer", where(), "", false, false);
  }

  unsigned writes = 0;  // of the word
  std::function<void()> meanwhile{};

 private:
  std::uint16_t word_;
  bool loses_request_;
};

TEST(AControlwordWithoutAnswer, IsSentAgainIfTheDriveHasNotReceivedIt) {
  for (const bool loses_request : {true, false}) {
    AxisRig rig{{"generic402"}};
    Lossy objects(rig.objects(), command_word::shutdown, loses_request);
    Axis402 axis(objects, rig.options());
    axis.enable();
    EXPECT_EQ(axis.state(), PowerState::operation_enabled);
    EXPECT_EQ(objects.writes, loses_request ? 2U : 1U);
  }
}

TEST(AControlwordWithoutAnswer, ThatStartsAMotionIsNotSentAgain) {
  AxisRig rig{{"generic402"}};
  Lossy objects(rig.objects(), command_word::enable_operation, true);
  Axis402 axis(objects, rig.options());
  EXPECT_THAT(problem_of([&] { axis.enable(); }), HasSubstr("no answer"));
  EXPECT_EQ(objects.writes, 1U);
  EXPECT_FALSE(rig.drive().device().drive().energised());
}

// A stop of homing ends with 000Fh, the word that this client has written before 001Fh.
TEST(AControlwordWithoutAnswer, DoesNotUndoTheStopOfAnotherClient) {
  constexpr std::uint16_t start_homing_word = 0x001F;
  AxisRig rig{{"generic402"}};
  Lossy objects(rig.objects(), start_homing_word, true);
  Axis402 axis(objects, rig.options());
  Axis402 other(rig.objects(), rig.options());
  axis.enable();
  objects.meanwhile = [&] { other.stop(); };
  const double place = rig.shaft_counts();
  const HomingRequest to_index{34, 2 * 131072, 131072, 100 * 131072, {}};
  EXPECT_THAT(problem_of([&] { axis.home(to_index, 10s); }), HasSubstr("no answer"));
  rig.objects().wait(1s);
  EXPECT_NEAR(rig.shaft_counts(), place, 200);
}

TEST(AControlwordWithoutAnswer, ThatStopsTheAxisIsSentAgainOverOneOfAnotherClient) {
  AxisRig rig{{"generic402"}};
  Lossy objects(rig.objects(), command_word::disable_voltage, true);
  Axis402 axis(objects, rig.options());
  axis.enable();
  objects.meanwhile = [&] { rig.objects().write<std::uint16_t>(0x6040, 0, 0x001F); };
  axis.disable();
  EXPECT_EQ(objects.writes, 2U);
  EXPECT_FALSE(rig.drive().device().drive().energised());
}

// An iSMK that holds the axis in Quick stop active closes its brake before it leaves that state.
TEST(EnablingAfterAQuickStop, LastsUntilTheBrakeHasClosed) {
  AxisRig rig{{"ismk"}};
  rig.objects().write<std::uint16_t>(0x6410, 0x12, 6'000);
  rig.objects().write<std::uint8_t>(0x6410, 0x17, 1);
  rig.objects().write<std::int16_t>(0x605A, 0, 6);
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  axis.quick_stop();
  ASSERT_TRUE(rig.drive().device().drive().energised());
  axis.enable();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
}

// A drive with one object that misbehaves.
class Odd final : public ForwardedObjects {
 public:
  Odd(ObjectClient& drive, std::uint16_t index, bool refuses)
      : ForwardedObjects(drive), index_(index), refuses_(refuses) {}

  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index == index_) std::fill(bytes.begin(), bytes.end(), std::byte{1});
    return bytes;
  }
  void download(ObjectAddress object, std::span<const std::byte> data) override {
    if (refuses_ && object.index == index_) throw ObjectError("the object is read-only", where(), "", false);
    ForwardedObjects::download(object, data);
  }

 private:
  std::uint16_t index_;
  bool refuses_;
};

// A cyclic master or an input writes this target (iSMK manual, ch. 5.2.1.1), so it does not keep the value written.
TEST(EnablingIsRefused, WhereATargetCannotBeTakenBack) {
  AxisRig rig{{"generic402"}};
  Odd objects(rig.objects(), 0x60FF, false);
  Axis402 axis(objects, rig.options());
  axis.set_mode(OperationMode::profile_velocity);
  EXPECT_THAT(problem_of([&] { axis.enable(); }), HasSubstr("60FFh"));
  EXPECT_NE(axis.state(), PowerState::operation_enabled);
  axis.set_mode(OperationMode::profile_position);
  axis.enable();  // that target does not act in this mode
}

TEST(EnablingIsRefused, WhereTheDriveRefusesTheTarget) {
  AxisRig rig{{"generic402"}};
  Odd objects(rig.objects(), 0x6071, true);
  Axis402 axis(objects, rig.options());
  axis.set_mode(OperationMode::profile_torque);
  EXPECT_THAT(problem_of([&] { axis.enable(); }), testing::AllOf(HasSubstr("6071h"), HasSubstr("read-only")));
  EXPECT_NE(axis.state(), PowerState::operation_enabled);
}

}  // namespace
}  // namespace enable_test
}  // namespace servodrome::master::test
