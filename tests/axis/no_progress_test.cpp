// A motion that makes no progress ends before its timeout, with the reason and the axis disabled.
#include <cstring>
#include <gmock/gmock.h>
#include <random>

#include "axis/cia402_words.hpp"
#include "axis/quick_motions.hpp"
#include "master/forwarded_objects.hpp"

namespace servodrome::master::test {
namespace no_progress_test {
namespace {

using namespace quick_motions;
using testing::HasSubstr;

// A drive that shows another statusword or position than it has.
class Shown final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;

  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index == 0x6041) {
      std::uint16_t word = 0;
      std::memcpy(&word, bytes.data(), sizeof word);
      word = static_cast<std::uint16_t>((word | set) & ~cleared);
      std::memcpy(bytes.data(), &word, sizeof word);
      if (is_frozen && !frozen_) frozen_ = bytes;
      if (is_frozen) return *frozen_;
    }
    if (object.index == 0x6064) {
      std::int32_t position = 0;
      std::memcpy(&position, bytes.data(), sizeof position);
      position += static_cast<std::int32_t>(drift_per_s * std::chrono::duration<double>(now()).count());
      if (swing != 0) swing = -swing;
      position += offset + swing + (noise > 0 ? static_cast<std::int32_t>(random_() % noise) : 0);
      position /= counts_per_unit;
      std::memcpy(bytes.data(), &position, sizeof position);
    }
    return bytes;
  }

  unsigned set = 0;  // bits of the statusword
  unsigned cleared = 0;
  bool is_frozen = false;
  double drift_per_s = 0.0;
  std::int32_t counts_per_unit = 1;
  std::int32_t offset = 0;
  unsigned noise = 0;      // counts
  std::int32_t swing = 0;  // counts, with the other sign in each reading

 private:
  std::minstd_rand random_;
  std::optional<std::vector<std::byte>> frozen_;
};

class NoProgress : public testing::Test {
 protected:
  PowerState true_state() { return state_of(rig.objects().read<std::uint16_t>(0x6041)); }

  AxisRig rig{{"generic402"}};
  Shown objects{rig.objects()};
  Axis402 axis{objects, rig.options()};
};

class HomingEnds : public NoProgress, public testing::WithParamInterface<unsigned> {};
INSTANTIATE_TEST_SUITE_P(Without, HomingEnds,
                         testing::Values(status_bit::target_reached, status_bit::mode_bit_12,
                                         status_bit::target_reached | status_bit::mode_bit_12));

TEST_P(HomingEnds, WhenTheDriveDoesNotReportItsEnd) {
  axis.enable();
  objects.cleared = GetParam();
  const Time begun = objects.now();
  EXPECT_THAT(problem_of([&] { axis.home(to_index, 60s); }), HasSubstr("homing by method 34 does not end"));
  EXPECT_LT(objects.now() - begun, 10s);
  EXPECT_EQ(axis.try_to_switch_off(), "");
  EXPECT_EQ(true_state(), PowerState::switch_on_disabled);
}

TEST_F(NoProgress, EndsAMoveThatTheDriveShowsAsReachedElsewhere) {
  axis.enable();
  axis.home(to_index, 10s);
  objects.drift_per_s = 10000;
  const Time begun = objects.now();
  EXPECT_THAT(problem_of([&] { axis.move_to(0, quick, 60s); }), HasSubstr("the drive shows the target as reached"));
  EXPECT_LT(objects.now() - begun, 10s);
  EXPECT_EQ(axis.try_to_switch_off(), "");
}

// The nearest of the noisy positions comes again and again.
TEST_F(NoProgress, EndsAMoveShownAsReachedElsewhereThoughThePositionIsNoisy) {
  axis.enable();
  axis.home(to_index, 10s);
  axis.move_to(0, quick, 10s);
  objects.wait(1s);
  objects.noise = 10;
  objects.offset = revolution;
  const Time begun = objects.now();
  EXPECT_THAT(problem_of([&] { axis.move_to(0, quick, 60s); }), HasSubstr("does not come nearer"));
  EXPECT_LT(objects.now() - begun, 10s);
}

// The drive shows the target as reached from the beginning, and takes 10 s to get there.
TEST_F(NoProgress, IsNoSlowApproachToATargetShownAsReached) {
  axis.enable();
  objects.set = status_bit::target_reached;
  const MotionProfile slow{revolution / 5, 100 * revolution, 100 * revolution};
  const std::int32_t target = axis.position() + 2 * revolution;
  axis.move_to(target, slow, 60s);
  EXPECT_NEAR(axis.position(), target, revolution / 40);
}

// Within the tolerance of 1/50 revolution the axis still turns by 2 revolutions/s.
TEST_F(NoProgress, AMoveShownAsReachedEndsWhenTheAxisRests) {
  axis.enable();
  objects.set = status_bit::target_reached;
  axis.move_to(axis.position() + 2 * revolution, quick, 10s);
  EXPECT_LT(std::abs(rig.drive().plant().velocity_rpm()), 10);
}

TEST_F(NoProgress, AMoveOfAnAxisThatVibratesEnds) {
  axis.enable();
  const std::int32_t target = axis.position() + 2 * revolution;
  objects.swing = revolution / 100;
  const Time begun = objects.now();
  axis.move_to(target, quick, 10s);
  EXPECT_LT(objects.now() - begun, 2s);
}

// A unit is a degree, and the tolerance 8 degrees.
TEST_F(NoProgress, AMoveInCoarseUnitsShownAsReachedEndsWhenTheAxisRests) {
  constexpr std::int32_t degrees = 360;
  objects.write<std::uint32_t>(0x6092, 1, degrees);
  axis.enable();
  objects.set = status_bit::target_reached;
  axis.move_to(axis.position() + 2 * degrees, {10 * degrees, 100 * degrees, 100 * degrees}, 10s);
  EXPECT_LT(std::abs(rig.drive().plant().velocity_rpm()), 20);
}

// In units that are as coarse as a revolution 6064h changes every 15 s. A ProNet homes to no index.
bool is_pronet(const RigCase& one) { return std::string_view(one.product) == "pronet"; }
class CoarseUnits : public testing::TestWithParam<RigCase> {};
std::vector<RigCase> every_product_that_homes() {
  std::vector<RigCase> cases(std::begin(every_product), std::end(every_product));
  for (RigCase& one : cases) {
    if (is_pronet(one)) {
      one.axis_text = "[axis.travel]\ncounts_per_unit = 131072\nlow_stop = -9\nhigh_stop = 9\nnegative_limit = -0.7\n";
    }
  }
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Every, CoarseUnits, testing::ValuesIn(every_product_that_homes()),
                         [](const auto& row) { return row.param.name(); });

TEST_P(CoarseUnits, HomingThatCreepsGoesOn) {
  AxisRig rig(GetParam());
  Shown objects(rig.objects());
  Axis402 axis(objects, rig.options());
  const AxisUnits units = axis.units().value_or(AxisUnits{revolution, revolution, revolution});
  objects.counts_per_unit = static_cast<std::int32_t>(units.position);
  constexpr double rps = 1.0 / 15.0;
  const HomingRequest creeping{.method = is_pronet(GetParam()) ? std::int8_t{17} : std::int8_t{34},
                               .switch_speed = static_cast<std::uint32_t>(rps * units.velocity),
                               .zero_speed = static_cast<std::uint32_t>(rps * units.velocity),
                               .acceleration = static_cast<std::uint32_t>(100 * units.acceleration)};
  axis.enable();
  const Time begun = objects.now();
  axis.home(creeping, 60s);
  EXPECT_GT(objects.now() - begun, 7s) << "the index is too near for this test";
}

// Five units in a revolution: the axis is 7 s within a unit.
TEST(CoarseFactors, HomingAndAMoveThatCreepGoOn) {
  for (const RigCase& its_case : {RigCase{"generic402"}, RigCase{"generic402", RigCase::BusKind::modbus},
                                  RigCase{"generic402-ec", RigCase::BusKind::ethercat}}) {
    SCOPED_TRACE(its_case.name());
    AxisRig rig(its_case);
    Shown objects(rig.objects());
    Axis402 axis(objects, rig.options());
    constexpr std::uint32_t creeping = 150;  // 0.15 units/s
    objects.write<std::uint32_t>(0x6092, 1, 5);
    objects.write<std::uint32_t>(0x6096, 1, 1000);
    axis.enable();
    EXPECT_EQ(problem_of([&] { axis.home({34, creeping, creeping, 1'000'000, 0}, 60s); }), "");
    objects.set = status_bit::target_reached;
    EXPECT_EQ(problem_of([&] { axis.move_to(axis.position() + 3, {creeping, 1'000'000, 1'000'000}, 60s); }), "");
  }
}

TEST_F(NoProgress, AFrozenStatuswordIsReportedAndTheAxisIsSwitchedOff) {
  axis.enable();
  objects.is_frozen = true;
  const Time begun = objects.now();
  EXPECT_THAT(axis.try_to_switch_off(), HasSubstr("the drive did not switch off"));
  EXPECT_LT(objects.now() - begun, 3s);
  EXPECT_EQ(true_state(), PowerState::switch_on_disabled);
}

TEST_F(NoProgress, AHandOverThatIsNotAcknowledgedCanBeCancelled) {
  std::optional<Time> cancelled_at;
  AxisOptions options = rig.options();
  options.cancelled = [&] { return cancelled_at && objects.now() >= *cancelled_at; };
  Axis402 cancellable(objects, options);
  cancellable.enable();
  cancellable.set_mode(OperationMode::profile_position);
  objects.set = status_bit::target_reached;
  objects.cleared = status_bit::mode_bit_12;
  const Time begun = objects.now();
  cancelled_at = begun + 200ms;
  EXPECT_THROW(cancellable.start_move_to(0, quick), Cancelled);
  EXPECT_LT(objects.now() - begun, 1s);
}

}  // namespace
}  // namespace no_progress_test
}  // namespace servodrome::master::test
