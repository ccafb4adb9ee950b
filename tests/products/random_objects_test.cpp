#include <gtest/gtest.h>
#include <random>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Writes random and extreme values to all writable objects of a moving drive. The sanitizers detect errors; without
// them, the test checks that demand and voltages stay finite.
namespace servodrome {
namespace random_objects_test {
namespace {

using test::Rig;

constexpr std::array<std::uint8_t, 8> controlwords{0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x3F, 0x5F, 0x7F};
constexpr std::array<std::int64_t, 9> hard_values{0, 1, -1, 2147483647, -2147483648, 4294967295, 32767, 65535, -32768};

template <typename Device>
void write_at_random(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Rig<Device> rig;
  int enabled = 0;
  for (int step = 0; step < 4000; ++step) {
    const dictionary::Entry& entry = Device::table[random() % Device::table.size()];
    if (entry.index >= 0x6000 && entry.fixed_size() && random() % 3 != 0) {
      const std::int64_t value = random() % 2 != 0 ? hard_values[random() % hard_values.size()]
                                                   : static_cast<std::int64_t>(random() >> (random() % 64));
      rig.set(entry.index, entry.sub, value);
    }
    if (random() % 8 == 0) rig.set(0x6060, 0, static_cast<std::int64_t>(random() % 11));
    const std::uint16_t halt = random() % 8 == 0 ? 0x100 : 0;
    rig.control(static_cast<std::uint16_t>(controlwords[random() % controlwords.size()] | halt));
    if (random() % 32 == 0) rig.control(0x80);
    rig.run_ms(static_cast<double>(random() % 4));
    ASSERT_TRUE(std::isfinite(rig.device.drive().axis().generator.velocity())) << "seed " << seed << " step " << step;
    for (const float voltage : rig.actuation.phase_voltage_v) ASSERT_TRUE(std::isfinite(voltage));
    rig.sent.clear();
    if (rig.device.drive().state() == drive::PowerState::operation_enabled) ++enabled;
    // At intervals, values with which it can move again.
    if (step % 200 == 199) rig.device.power_on(rig.feedback, rig.now());
  }
  EXPECT_GT(enabled, 400) << "the drive must be reached in operation";
}

TEST(RandomObjects, LeaveTheReferenceDriveSane) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) write_at_random<products::Generic402>(seed);
}

TEST(RandomObjects, LeaveTheIsmcSane) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) write_at_random<products::Ismc>(seed);
}

}  // namespace
}  // namespace random_objects_test
}  // namespace servodrome
