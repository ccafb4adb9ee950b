// Motions and stops that meet a wrong or late statusword, or a command of another client.
#include <cstring>
#include <deque>
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"
#include "axis/cia402_words.hpp"
#include "drive/drive.hpp"
#include "master/forwarded_objects.hpp"

namespace servodrome::master::test {
namespace other_clients_test {
namespace {

using testing::HasSubstr;

constexpr std::int32_t revolution = 131072;
const MotionProfile ramps{.velocity = 5 * revolution, .acceleration = 50 * revolution, .deceleration = 50 * revolution};

// Bits of the statusword are 0 for some time.
class MissingBits final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;
  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index == 0x6041 && now() < until) bytes[0] &= ~missing;
    return bytes;
  }

  std::byte missing{};
  Time until{};
};

// The statusword is that of some time ago.
class LateStatusword final : public ForwardedObjects {
 public:
  LateStatusword(ObjectClient& drive, Time late) : ForwardedObjects(drive), late_(late) {}
  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index != 0x6041) return bytes;
    words_.emplace_back(now(), bytes);
    while (words_.size() > 1 && words_[1].first <= now() - late_) words_.pop_front();
    return words_.front().second;
  }
  // Reads the statusword all the time, so that the late one is known.
  void wait(Time span) override {
    for (const Time end = now() + span; now() < end;) {
      ForwardedObjects::wait(std::min<Time>(end - now(), 2ms));
      upload({0x6041, 0});
    }
  }

 private:
  Time late_;
  std::deque<std::pair<Time, std::vector<std::byte>>> words_;
};

// Another client acts when this one writes an object.
class Interrupted final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;
  void download(ObjectAddress object, std::span<const std::byte> data) override {
    ForwardedObjects::download(object, data);
    if (object.index == at && other) std::exchange(other, {})();
  }

  std::uint16_t at = 0;
  std::function<void()> other{};
};

class OtherClients : public testing::Test {
 protected:
  // The distance within a second, in revolutions.
  double turned() {
    const double before = rig.shaft_counts();
    rig.objects().wait(1s);
    return std::abs(rig.shaft_counts() - before) / revolution;
  }

  AxisRig rig{{"generic402"}};
  Interrupted interrupted{rig.objects()};
  Axis402 axis{interrupted, rig.options()};
  Axis402 other{rig.objects(), rig.options()};
};

// Bit 2: the word looks like that of switched on. Bit 5: like that of quick stop active.
TEST(StoppingWithAMissingBit, BringsTheAxisToRest) {
  for (const std::byte missing : {std::byte{0x04}, std::byte{0x20}}) {
    for (const Time span : {3ms, 30ms, 20'000ms}) {
      for (void (Axis402::*const end)() : {&Axis402::stop, &Axis402::quick_stop, &Axis402::halt}) {
        AxisRig rig{{"generic402"}};
        MissingBits objects(rig.objects());
        Axis402 axis(objects, rig.options());
        axis.enable();
        axis.run_at(2 * revolution, ramps, 5s);
        objects.missing = missing;
        objects.until = objects.now() + span;
        const Time before = objects.now();
        problem_of([&] { (axis.*end)(); });
        EXPECT_LT(objects.now() - before, 4s);
        const double place = rig.shaft_counts();
        rig.objects().wait(1s);
        EXPECT_NEAR(rig.shaft_counts(), place, 20) << std::to_integer<int>(missing) << ' ' << span / 1ms << " ms";
      }
    }
  }
}

TEST(StoppingWithAMissingBit, LeavesAnAxisThatIsSwitchedOnAsItIs) {
  AxisRig rig{{"generic402"}};
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  rig.objects().write<std::uint16_t>(0x6040, 0, command_word::switch_on);
  rig.objects().wait(100ms);
  ASSERT_EQ(axis.state(), PowerState::switched_on);
  axis.stop();
  EXPECT_EQ(axis.state(), PowerState::switched_on);
}

// Bit 10 is at first that of the velocity that was reached.
TEST(StoppingWithALateStatusword, EndsWhenTheAxisRests) {
  for (const Time late : {60ms, 200ms}) {
    AxisRig rig{{"generic402"}};
    LateStatusword objects(rig.objects(), late);
    Axis402 axis(objects, rig.options());
    axis.enable();
    axis.run_at(5 * revolution, {.acceleration = 50 * revolution, .deceleration = 10 * revolution}, 5s);
    objects.wait(500ms);
    axis.stop();
    const double place = rig.shaft_counts();
    rig.objects().wait(1s);
    EXPECT_NEAR(rig.shaft_counts(), place, 200) << late / 1ms;
  }
}

TEST_F(OtherClients, AMotionDoesNotInterruptAStopThatCameMeanwhile) {
  const std::pair<const char*, std::function<void()>> motions[] = {
      {"home",
       [this] {
         axis.home({34, revolution, revolution, 50 * revolution, {}}, 10s);
       }},
      {"move", [this] { axis.move_by(5 * revolution, ramps, 10s); }},
      {"run", [this] { axis.run_at(2 * revolution, ramps, 5s); }},
      {"torque", [this] { axis.run_torque(100, {}, 2s); }},
  };
  rig.objects().write<std::int16_t>(0x605A, 0, 6);
  for (const std::uint16_t word : {std::uint16_t{0x0002}, std::uint16_t{0x010F}}) {
    for (const auto& [name, motion] : motions) {
      other.disable();
      other.set_mode(OperationMode::cyclic_synchronous_position);
      axis.enable();
      interrupted.at = 0x6060;
      interrupted.other = [&] { rig.objects().write<std::uint16_t>(0x6040, 0, word); };
      EXPECT_THAT(problem_of(motion), HasSubstr("another client has stopped the axis before it could")) << name;
      EXPECT_LT(turned(), 0.01) << name << ' ' << word;
      EXPECT_EQ(rig.objects().read<std::uint16_t>(0x6040), word) << name;
    }
  }
}

TEST_F(OtherClients, AHomingOrMoveWhoseModeChangesIsNoSuccess) {
  axis.enable();
  const auto to_velocity = [this](std::int32_t velocity) {
    rig.objects().write<std::int32_t>(0x60FF, 0, velocity);
    rig.objects().write<std::int8_t>(0x6060, 0, 3);
  };
  bool done = false;
  const auto once = [&](std::int32_t velocity) {
    done = false;
    return [&, velocity](const AxisStatus&) {
      if (!std::exchange(done, true)) to_velocity(velocity);
    };
  };
  EXPECT_THAT(problem_of([&] {
                axis.home({34, revolution / 4, revolution / 8, 50 * revolution, {}}, 20s, once(0));
              }),
              HasSubstr("the mode of operation (6061h) is 3 now and no longer 6"));
  EXPECT_LT(turned(), 0.01);
  EXPECT_THAT(problem_of([&] { axis.move_by(revolution, ramps, 20s, once(revolution / 20)); }),
              HasSubstr("(6061h) is 3 now and no longer 1"));
  EXPECT_LT(turned(), 0.01);
}

TEST_F(OtherClients, AHaltAfterAnotherClientWentOnHaltsAgain) {
  axis.enable();
  axis.run_at(2 * revolution, ramps, 5s);
  axis.halt();
  EXPECT_LT(turned(), 0.01);
  rig.objects().write<std::uint16_t>(0x6040, 0, command_word::enable_operation);
  EXPECT_GT(turned(), 1.0);
  axis.halt();
  EXPECT_LT(turned(), 0.01);
}

// The velocity seems to fall by one unit in each reading.
class HardlySlower final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;
  std::vector<std::byte> upload(ObjectAddress object) override {
    std::vector<std::byte> bytes = ForwardedObjects::upload(object);
    if (object.index != 0x606C) return bytes;
    const std::int32_t velocity = 5 * revolution - ++reads;
    std::memcpy(bytes.data(), &velocity, bytes.size());
    return bytes;
  }

  std::int32_t reads = 0;
};

TEST_F(OtherClients, AHaltThatHardlySlowsTheAxisFailsSoon) {
  HardlySlower objects(rig.objects());
  Axis402 slow(objects, rig.options());
  slow.enable();
  slow.run_at(5 * revolution, ramps, 5s);
  rig.objects().write<std::uint32_t>(0x6084, 0, 1);
  const Time before = rig.objects().now();
  EXPECT_THAT(problem_of([&] { slow.stop(); }), HasSubstr("does not come to rest on halt"));
  EXPECT_LT(rig.objects().now() - before, 3s);
  EXPECT_GT(objects.reads, 100);
}

class TwoMoves : public testing::TestWithParam<RigCase> {};
INSTANTIATE_TEST_SUITE_P(Every, TwoMoves, testing::ValuesIn(every_product),
                         [](const auto& row) { return row.param.name(); });

TEST_P(TwoMoves, ByADistanceAddUp) {
  AxisRig rig{GetParam()};
  Axis402 axis(rig.objects(), rig.options());
  const AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
  const MotionProfile profile{.velocity = static_cast<std::uint32_t>(2 * units.velocity),
                              .acceleration = static_cast<std::uint32_t>(50 * units.acceleration),
                              .deceleration = static_cast<std::uint32_t>(50 * units.acceleration)};
  const auto distance = static_cast<std::int32_t>(2 * units.position);
  axis.enable();
  const double before = rig.shaft_counts();
  axis.start_move_by(distance, profile);
  rig.objects().wait(200ms);
  axis.enable();  // it is enabled already, so the move goes on
  EXPECT_EQ(problem_of([&] { axis.move_by(distance, profile, 20s); }), "");
  rig.objects().wait(500ms);
  const double turned = (rig.shaft_counts() - before) / rig.drive().plant().parameters().encoder.counts_per_revolution;
  EXPECT_NEAR(std::abs(turned), 4.0, 0.02);
}

}  // namespace
}  // namespace other_clients_test
}  // namespace servodrome::master::test
