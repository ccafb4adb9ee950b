#include "axis/cyclic/object_cyclic_bus.hpp"

#include <gmock/gmock.h>
#include <map>

namespace servodrome::master {
namespace object_cyclic_bus_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr PdoObject target{{0x60FF, 0}, 32};
constexpr PdoObject controlword{{0x6040, 0}, 16};
constexpr PdoObject position{{0x6064, 0}, 32};
constexpr PdoObject statusword{{0x6041, 0}, 16};

// Objects with their own clock.
class Fake final : public ObjectClient {
 public:
  std::vector<std::byte> upload(ObjectAddress object) override {
    access(object);
    const std::uint64_t value = values[object.index];
    const auto bytes =
        std::as_bytes(std::span(&value, 1)).first(object.index == 0x6041 || object.index == 0x6040 ? 2 : 4);
    return {bytes.begin(), bytes.end()};
  }
  void download(ObjectAddress object, std::span<const std::byte> data) override {
    access(object);
    if (silent_writes) throw ObjectError("no answer", "fake", "see whether it lives", false, false);
    std::uint64_t value = 0;
    std::memcpy(&value, data.data(), data.size());
    values[object.index] = value;
    written.emplace_back(time, object.index);
  }
  Time now() const override { return time; }
  void wait(Time span) override { time += span; }
  std::uint16_t address() const override { return 1; }
  std::string where() const override { return "fake"; }

  void access(ObjectAddress object) {
    time += access_time;
    if (silent) throw ObjectError("no answer", "fake", "see whether it lives", false, false);
    if (object.index == refused) throw ObjectError("it refuses", "fake", "write something else", false);
  }

  Time time{5s};
  Time access_time = 50us;
  bool silent = false;
  bool silent_writes = false;  // reads are answered
  std::uint16_t refused = 0;
  std::map<std::uint16_t, std::uint64_t> values{{0x60FF, 7}, {0x6040, 0xF}, {0x6064, 1000}, {0x6041, 0x237}};
  std::vector<std::pair<Time, std::uint16_t>> written;
};

TEST(ObjectCyclicBus, ExchangesOnItsGrid) {
  Fake drive;
  ObjectCyclicBus bus(drive, {controlword, target}, {statusword, position}, 1ms);
  auto& image = bus.image(0);
  EXPECT_EQ(image.output(target.object)->get<std::int32_t>(), 7) << "as it is";
  EXPECT_FALSE(image.output(position.object));
  EXPECT_FALSE(image.input(target.object));
  int cycles = 0;
  bus.on_cycle([&] {
    EXPECT_EQ(image.input(statusword.object)->get<std::uint16_t>(), 0x237);
    EXPECT_EQ(image.input(position.object)->get<std::int32_t>(), 1000);
    image.output(target.object)->set(-++cycles);
  });
  const Time begin = drive.time;
  bus.wait(100ms);
  EXPECT_GE(drive.time, begin + 100ms);
  EXPECT_LE(drive.time, begin + 100ms + 4 * drive.access_time) << "the cycle at its end";
  EXPECT_NEAR(cycles, 100, 1);
  EXPECT_EQ(bus.counters().missed + bus.counters().skipped, 0U);
  EXPECT_EQ(static_cast<std::int32_t>(drive.values[0x60FF]), -cycles);
  EXPECT_EQ(drive.values[0x6040], 0xFU);
  // Each write of an object comes exactly 1 ms after the previous one.
  std::vector<Time> at;
  for (const auto& [time, index] : drive.written) {
    if (index == 0x60FF) at.push_back(time);
  }
  for (std::size_t i = 1; i < at.size(); ++i) EXPECT_EQ(at[i] - at[i - 1], 1ms);
}

TEST(ObjectCyclicBus, SaysWhatItCameTooLateFor) {
  Fake drive;
  ObjectCyclicBus bus(drive, {target}, {position}, 1ms);
  bus.wait(10ms);
  drive.access_time = 1500us;
  bus.wait(100ms);
  EXPECT_GT(bus.counters().skipped, 20U);
  EXPECT_GE(bus.counters().worst_lateness, 1ms);
}

TEST(ObjectCyclicBus, ASilentDriveIsLost) {
  Fake drive;
  ObjectCyclicBus bus(drive, {target}, {position}, 1ms);
  bus.wait(10ms);
  EXPECT_TRUE(bus.is_fresh(0));
  drive.silent = true;
  int cycles = 0;
  bus.on_cycle([&] { ++cycles; });
  bus.wait(5ms);
  EXPECT_FALSE(bus.is_fresh(0));
  EXPECT_GE(cycles, 4) << "whoever watches is told in each";
  bus.check();
  bus.wait(20ms);
  try {
    bus.check();
    ADD_FAILURE();
  } catch (const MasterError& error) {
    EXPECT_THAT(error.what(), HasSubstr("has not answered for"));
  }
  EXPECT_GE(bus.counters().longest_miss, 20U);
  drive.silent = false;
  bus.wait(2ms);
  EXPECT_TRUE(bus.is_fresh(0));
  bus.check();
}

TEST(ObjectCyclicBus, ADriveThatAnswersOnlyReadsIsLost) {
  Fake drive;
  ObjectCyclicBus bus(drive, {target}, {position}, 1ms);
  bus.wait(10ms);
  drive.silent_writes = true;
  int cycles = 0;
  bus.on_cycle([&] { ++cycles; });
  bus.wait(5ms);
  bus.check();
  bus.wait(20ms);
  EXPECT_TRUE(bus.is_fresh(0));
  EXPECT_THROW(bus.check(), MasterError);
  EXPECT_GE(bus.counters().longest_miss, 20U);
  EXPECT_NEAR(cycles, 25, 1) << "one call in each cycle";
  drive.silent_writes = false;
  bus.wait(2ms);
  bus.check();
}

TEST(ObjectCyclicBus, ARefusalIsTold) {
  Fake drive;
  ObjectCyclicBus bus(drive, {target}, {position}, 1ms);
  drive.refused = 0x60FF;
  bus.wait(5ms);
  EXPECT_THROW(bus.check(), ObjectError);
}

}  // namespace
}  // namespace object_cyclic_bus_test
}  // namespace servodrome::master
