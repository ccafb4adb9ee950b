// Stops that meet a command of another client, or one that an earlier program has left; with every product on every bus
// it has.
#include <cmath>
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"
#include "axis/cia402_words.hpp"
#include "drive/drive.hpp"
#include "master/forwarded_objects.hpp"

namespace servodrome::master::test {
namespace stop_sequences_test {
namespace {

constexpr double slow_ramp = 2.0;  // revolutions per second squared
constexpr double run_speed = 3.0;  // revolutions per second; below the factory limit of each product

// The objects of a drive, without answers to reads or with a statusword that keeps its value.
struct Faulty final : ForwardedObjects {
  using ForwardedObjects::ForwardedObjects;
  std::vector<std::byte> upload(ObjectAddress object) override {
    if (is_silent) {
      wait(20ms);
      throw ObjectError("no answer", "test", "", false, false);
    }
    auto value = ForwardedObjects::upload(object);
    if (object.index != 0x6041) return value;
    if (!keeps_statusword) kept = value;
    return kept;
  }

  bool is_silent = false;
  bool keeps_statusword = false;
  std::vector<std::byte> kept{};
};

class StopSequences : public testing::TestWithParam<RigCase> {
 protected:
  MotionProfile profile(double ramp = 50.0) const {
    return {.velocity = static_cast<std::uint32_t>(run_speed * units.velocity),
            .acceleration = static_cast<std::uint32_t>(50 * units.acceleration),
            .deceleration = static_cast<std::uint32_t>(ramp * units.acceleration)};
  }
  std::int32_t velocity() const { return static_cast<std::int32_t>(run_speed * units.velocity); }
  double shaft() { return rig.shaft_counts() / rig.drive().plant().parameters().encoder.counts_per_revolution; }
  bool turns() {
    const double before = shaft();
    rig.objects().wait(50ms);
    return std::abs(shaft() - before) > 0.005;
  }
  void run() {
    axis.enable();
    axis.run_at(velocity(), profile(), 5s);
  }
  // As another client, or an input.
  void command(std::uint16_t word) { rig.objects().write<std::uint16_t>(0x6040, 0, word); }
  // Returns the distance of the shaft from now until it is at rest.
  template <typename Call>
  double distance_of(Call call) {
    const double before = shaft();
    call();
    EXPECT_FALSE(turns()) << "the call returns when the axis is at rest";
    rig.objects().wait(2s);
    return std::abs(shaft() - before);
  }

  AxisRig rig{GetParam()};
  Axis402 axis{rig.objects(), rig.options()};
  Axis402 other{rig.objects(), rig.options()};  // a later program: it knows no earlier command
  AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
};
INSTANTIATE_TEST_SUITE_P(Every, StopSequences, testing::ValuesIn(every_product),
                         [](const auto& row) { return row.param.name(); });

TEST_P(StopSequences, AStopOfADriveThatCannotBeReadIsSent) {
  using Call = void (Axis402::*)();
  for (const Call call : {&Axis402::stop, &Axis402::begin_stop, &Axis402::quick_stop, &Axis402::disable}) {
    run();
    Faulty objects(rig.objects());
    Axis402 blind(objects, rig.options());
    objects.is_silent = true;
    EXPECT_NE(problem_of([&] { (blind.*call)(); }), "");
    rig.objects().wait(3s);
    EXPECT_FALSE(turns());
    axis.disable();
  }
}

// A quick stop, which the end of an axis that cannot be read commands, must not enable it.
TEST_P(StopSequences, AStopOfADriveThatCannotBeReadEnablesNothing) {
  axis.enable();
  axis.disable();
  command(command_word::shutdown);
  command(command_word::switch_on);
  Faulty objects(rig.objects());
  Axis402 blind(objects, rig.options());
  objects.is_silent = true;
  blind.try_to_switch_off();
  rig.objects().wait(500ms);
  EXPECT_FALSE(rig.drive().device().drive().energised());
}

// Two seconds after SIGTERM a trial kills its master.
TEST_P(StopSequences, ACancelledMotionEndsInTwoSecondsThoughTheStatuswordStands) {
  for (const double ramp : {50.0, 1.0}) {
    Faulty objects(rig.objects());
    bool is_cancelled = false;
    AxisOptions options = rig.options();
    options.longest_halt = 1s;
    options.cancelled = [&] { return is_cancelled; };
    Axis402 cancelled(objects, options);
    run();
    cancelled.run_at(velocity(), profile(ramp), 5s);
    cancelled.hold_for(200ms);
    objects.keeps_statusword = is_cancelled = true;
    const Time begun = objects.now();
    EXPECT_NE(problem_of([&] { cancelled.hold_for(10s); }), "");
    cancelled.try_to_switch_off();
    EXPECT_LT(objects.now() - begun, 2s) << ramp;
    EXPECT_FALSE(rig.drive().device().drive().energised()) << ramp;
    rig.objects().wait(3s);
    axis.disable();
  }
}

// The drive stays in operation enabled until its brake has closed.
TEST(StopSequencesWithABrake, DisablingLastsUntilTheBrakeHasClosed) {
  for (const bool is_cancelled : {false, true}) {
    AxisRig rig{{"ismk"}};
    rig.objects().write<std::uint16_t>(0x6410, 0x12, 4'000);
    rig.objects().write<std::uint8_t>(0x6410, 0x17, 1);
    bool cancels = false;
    AxisOptions options = rig.options();
    options.cancelled = [&cancels] { return cancels; };
    Axis402 axis(rig.objects(), options);
    axis.enable();
    cancels = is_cancelled;
    EXPECT_EQ(problem_of([&axis] { axis.disable(); }), "");
    EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  }
}

// To switch off in the middle of a quick stop would let the axis coast, which takes much longer than its ramp here.
TEST_P(StopSequences, AQuickStopOfAnotherIsNotCutOff) {
  const auto ramp = static_cast<std::uint32_t>(4 * slow_ramp * units.acceleration);
  if (!rig.objects().read_if_present<std::uint32_t>(0x6085)) return;
  const double longest = 1.3 * run_speed * run_speed / (2 * 4 * slow_ramp) + 0.1;
  for (const int way : {0, 1, 2}) {
    run();
    rig.objects().write<std::uint32_t>(0x6085, 0, ramp);
    command(command_word::quick_stop);
    if (axis.state() != PowerState::quick_stop_active) return;  // a product whose quick stop switches off at once
    const double distance = distance_of([&] {
      if (way == 0) axis.stop();
      if (way == 1) axis.try_to_switch_off();
      if (way == 2) other.enable();
    });
    EXPECT_LT(distance, longest) << way;
    axis.try_to_switch_off();
  }
}

TEST_P(StopSequences, AHaltStopsAndDoesNotSwitchOffWhatAnotherHasBegun) {
  run();
  other.halt();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
  EXPECT_FALSE(turns());
  other.resume();
  rig.objects().wait(500ms);
  EXPECT_TRUE(turns());
  other.stop();
  EXPECT_FALSE(turns());
}

// An operator "acknowledges" a fault that is not there: the drive ignores the word, and goes on.
TEST_P(StopSequences, AWordThatResetsFaultsDoesNotKeepTheAxisFromStopping) {
  run();
  command(command_word::fault_reset);
  rig.objects().wait(50ms);
  if (axis.state() != PowerState::operation_enabled) return;  // a product that takes it as disable voltage
  other.stop();
  EXPECT_FALSE(turns());
}

TEST_P(StopSequences, HomingDoesNotResumeAMoveThatWasStopped) {
  axis.enable();
  axis.start_move_by(static_cast<std::int32_t>(20 * units.position), profile());
  rig.objects().wait(1s);
  axis.stop();
  const double before = shaft();
  double farthest = 0.0;
  const auto watch = [&](const AxisStatus&) { farthest = std::max(farthest, std::abs(shaft() - before)); };
  other.home({.method = rig.options().product->dialect.cautious_homing_method,
              .switch_speed = static_cast<std::uint32_t>(0.5 * units.velocity),
              .zero_speed = static_cast<std::uint32_t>(0.5 * units.velocity),
              .acceleration = static_cast<std::uint32_t>(50 * units.acceleration)},
             20s, watch);
  EXPECT_LT(farthest, 1.05) << "a search for the index takes a revolution at most";
}

TEST_P(StopSequences, AHaltedAxisCanBeHomed) {
  axis.enable();
  axis.halt();
  axis.home({.method = rig.options().product->dialect.cautious_homing_method,
             .switch_speed = static_cast<std::uint32_t>(0.5 * units.velocity),
             .zero_speed = static_cast<std::uint32_t>(0.5 * units.velocity),
             .acceleration = static_cast<std::uint32_t>(50 * units.acceleration)},
            20s);
  EXPECT_FALSE(axis.halted());
}

TEST_P(StopSequences, SeveralAxesBeginToStopTogether) {
  run();
  axis.begin_stop();
  const double before = shaft();
  rig.objects().wait(1s);
  EXPECT_FALSE(turns());
  EXPECT_LT(std::abs(shaft() - before), 1.3 * run_speed * run_speed / (2 * 50) + 0.1);
  axis.stop();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
}

}  // namespace
}  // namespace stop_sequences_test
}  // namespace servodrome::master::test
