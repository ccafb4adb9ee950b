#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// Numbers that the JMC manual prints: the start-up lists of its routines as SDO frames, gear ratios, units.
namespace servodrome {
namespace jmc_examples_test {
namespace {

using dictionary::AbortCode;
using test::Bytes;
using test::JmcRig;

struct Download {
  const char* line;
  Bytes request;
  Bytes response;
};

// The start-up lists of the routines for INovance ('Set the zero return parameter') and CoDeSys ('Set homing
// parameter'), and the answer to each row.
const Download start_up_lists[] = {
    {"6060:00 = 8", {0x2F, 0x60, 0x60, 0x00, 0x08, 0, 0, 0}, {0x60, 0x60, 0x60, 0x00, 0, 0, 0, 0}},
    {"60E0:00 = 5000", {0x2B, 0xE0, 0x60, 0x00, 0x88, 0x13, 0, 0}, {0x60, 0xE0, 0x60, 0x00, 0, 0, 0, 0}},
    {"60E1:00 = 5000", {0x2B, 0xE1, 0x60, 0x00, 0x88, 0x13, 0, 0}, {0x60, 0xE1, 0x60, 0x00, 0, 0, 0, 0}},
    {"607F:00 = 400000", {0x23, 0x7F, 0x60, 0x00, 0x80, 0x1A, 0x06, 0}, {0x60, 0x7F, 0x60, 0x00, 0, 0, 0, 0}},
    {"6098:00 = 17", {0x2F, 0x98, 0x60, 0x00, 0x11, 0, 0, 0}, {0x60, 0x98, 0x60, 0x00, 0, 0, 0, 0}},
    {"6099:01 = 4000", {0x23, 0x99, 0x60, 0x01, 0xA0, 0x0F, 0, 0}, {0x60, 0x99, 0x60, 0x01, 0, 0, 0, 0}},
    {"6099:02 = 100", {0x23, 0x99, 0x60, 0x02, 0x64, 0, 0, 0}, {0x60, 0x99, 0x60, 0x02, 0, 0, 0, 0}},
    {"609A:00 = 40000", {0x23, 0x9A, 0x60, 0x00, 0x40, 0x9C, 0, 0}, {0x60, 0x9A, 0x60, 0x00, 0, 0, 0, 0}},
    {"6098:00 = 1", {0x2F, 0x98, 0x60, 0x00, 0x01, 0, 0, 0}, {0x60, 0x98, 0x60, 0x00, 0, 0, 0, 0}},
};

TEST(JmcExamples, StartUpListsByteByByte) {
  JmcRig rig;
  rig.to_pre_operational();
  for (const Download& download : start_up_lists) {
    EXPECT_EQ(rig.sdo(download.request), download.response) << download.line;
  }
  EXPECT_EQ(rig.get(0x6060), 8);
  EXPECT_EQ(rig.get(0x60E0), 5000);
  EXPECT_EQ(rig.get(0x60E1), 5000);
  EXPECT_EQ(rig.get(0x607F), 400000);
  EXPECT_EQ(rig.get(0x6098), 1);
  EXPECT_EQ(rig.get(0x6099, 1), 4000);
  EXPECT_EQ(rig.get(0x6099, 2), 100);
  EXPECT_EQ(rig.get(0x609A), 40000);
}

// "607A:00 with 32 bits is 607A0020h" (Chart 16).
TEST(JmcExamples, MappingEntry) {
  JmcRig rig;
  rig.to_pre_operational();
  EXPECT_EQ(rig.upload(0x1600, 3), 0x607A0020U);
  EXPECT_EQ(rig.upload(0x1600, 12), 0xFFFFFFFFU) << "unused slots stay readable";
}

// The sequence of a reconfiguration is that of 'PDO Communicate' 3.3; it is refused outside of Pre-Operational and lost
// after a power cycle ('PDO Communicate' 3.4).
TEST(JmcExamples, ReconfigurationOfPdos) {
  JmcRig rig;
  rig.to_pre_operational();
  EXPECT_EQ(rig.download(0x1600, 1, 0x60FF0020, 4), AbortCode::sub_index_0_not_zero);
  EXPECT_EQ(rig.download(0x1C12, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(rig.download(0x1C13, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(rig.download(0x1600, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(rig.download(0x1600, 1, 0x60400010, 4), AbortCode::none);
  EXPECT_EQ(rig.download(0x1600, 2, 0x60FF0020, 4), AbortCode::none);
  EXPECT_EQ(rig.download(0x1600, 3, 0xFFFFFFFF, 4), AbortCode::none) << "an empty slot";
  EXPECT_EQ(rig.download(0x1600, 4, 0x608F0120, 4), AbortCode::not_mappable);
  EXPECT_EQ(rig.download(0x1600, 4, 0x60410010, 4), AbortCode::not_mappable);
  EXPECT_EQ(rig.download(0x1600, 4, 0x55550020, 4), AbortCode::object_does_not_exist);
  EXPECT_EQ(rig.download(0x1600, 0, 13, 1), AbortCode::value_too_high) << "at most 12 ('PDO mapping')";
  EXPECT_EQ(rig.download(0x1600, 0, 2, 1), AbortCode::none);
  EXPECT_EQ(rig.download(0x1C12, 1, 0x1600, 2), AbortCode::none);
  EXPECT_EQ(rig.download(0x1C12, 1, 0x1604, 2), AbortCode::value_too_high);
  EXPECT_EQ(rig.download(0x1C12, 0, 1, 1), AbortCode::none);
  EXPECT_EQ(rig.download(0x1C13, 0, 2, 1), AbortCode::none);
  rig.to_safe_operational();
  EXPECT_EQ(rig.outputs.size(), 6U);
  EXPECT_EQ(rig.inputs.size(), 36U) << "1A00h and 1A01h, as subs 1 and 2 are preset";
  EXPECT_EQ(rig.download(0x1C12, 0, 0, 1), AbortCode::device_state);
  rig.device.power_off();
  rig.device.power_on(rig.feedback, rig.now());
  EXPECT_EQ(rig.get(0x1600), 6);
  EXPECT_EQ(rig.get(0x1600, 2), 0x60600008);
}

// At most 48 bytes in one PDO ('PDO mapping').
TEST(JmcExamples, LongestPdo) {
  JmcRig rig;
  rig.to_pre_operational();
  rig.download(0x1C12, 0, 0, 1);
  rig.download(0x1600, 0, 0, 1);
  for (std::uint8_t sub = 1; sub <= 12; ++sub) {
    ASSERT_EQ(rig.download(0x1600, sub, 0x607A0020, 4), AbortCode::none);
  }
  EXPECT_EQ(rig.download(0x1600, 0, 12, 1), AbortCode::none);
  rig.download(0x1600, 0, 0, 1);
  ASSERT_EQ(rig.download(0x1600, 12, 0x607A0028, 4),
            AbortCode::none);  // 40 bits: like 60FDh, every object may be mapped longer than it is
  EXPECT_EQ(rig.download(0x1600, 0, 12, 1), AbortCode::mapping_exceeds_pdo_length);
}

struct Gear {
  std::int64_t increments, revolutions, motor, shaft, feed, feed_shaft;
  std::int64_t user_per_revolution;
};

// Each of the three objects acts when it is written, in any order.
TEST(JmcExamples, EachPartOfTheGearActs) {
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x608F, 0x6091, 0x6092})) {
    JmcRig rig;
    rig.to_pre_operational();
    const auto counts = [&rig] { return rig.device.drive().axis().units.position.value(); };
    const double before = counts();
    const auto window = static_cast<double>(rig.get(0x6067));
    const std::int64_t written = rig.get(index, 1);
    ASSERT_EQ(rig.download(index, 1, 2 * written, 4), AbortCode::none);
    const double change = counts() / before;
    EXPECT_TRUE(change == 2.0 || change == 0.5) << std::hex << index;
    EXPECT_NEAR(static_cast<double>(rig.get(0x6067)), window / change, 1.0) << std::hex << index;
  }
}

// Electronic gear: 10000 and 2000 command units for a revolution of 4000 increments ('Electronic gear').
TEST(JmcExamples, ElectronicGear) {
  for (const Gear& gear : {Gear{4000, 1, 1, 1, 4000, 1, 4000}, Gear{4000, 1, 1, 1, 10000, 1, 10000},
                           Gear{4000, 1, 2, 1, 4000, 1, 2000}, Gear{4000, 1, 25, 8, 4000, 1, 1280}}) {
    JmcRig rig;
    rig.to_pre_operational();
    EXPECT_EQ(rig.download(0x608F, 1, gear.increments, 4), AbortCode::none);
    EXPECT_EQ(rig.download(0x608F, 2, gear.revolutions, 4), AbortCode::none);
    EXPECT_EQ(rig.download(0x6091, 1, gear.motor, 4), AbortCode::none);
    EXPECT_EQ(rig.download(0x6091, 2, gear.shaft, 4), AbortCode::none);
    EXPECT_EQ(rig.download(0x6092, 1, gear.feed, 4), AbortCode::none);
    EXPECT_EQ(rig.download(0x6092, 2, gear.feed_shaft, 4), AbortCode::none);
    rig.set(0x607F, 0, 400000);
    rig.set(0x60C5, 0, 4000000);
    rig.set(0x60C6, 0, 4000000);
    rig.set(0x6065, 0, 0xFFFFFFFF);
    rig.set(0x6081, 0, 10 * gear.user_per_revolution);
    rig.set(0x6060, 0, 1);
    ASSERT_TRUE(rig.enable());
    rig.set(0x607A, 0, gear.user_per_revolution);
    rig.control(0x1F);
    rig.run_ms(500);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 4000.0, 2.0) << gear.user_per_revolution;
    EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), static_cast<double>(gear.user_per_revolution),
                2.0 + static_cast<double>(gear.user_per_revolution) / 2000.0);
  }
}

// Gear objects take effect in Pre-Operational only, and the ratio is 1/1000 to 1000; otherwise "protection"
// ('Electronic gear').
TEST(JmcExamples, GearOutOfRangeAndOutOfState) {
  JmcRig rig;
  rig.to_pre_operational();
  EXPECT_EQ(rig.download(0x6091, 1, 1000, 4), AbortCode::none);
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0);
  EXPECT_EQ(rig.download(0x6091, 1, 1001, 4), AbortCode::none);
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0xA105);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.105");
  EXPECT_EQ(rig.device.leds(rig.now()).alarm_flashes, 12);
  EXPECT_EQ(rig.download(0x6091, 2, 1001, 4), AbortCode::none);
  rig.control(0x80);
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0);
  EXPECT_EQ(rig.download(0x6091, 1, 1, 4), AbortCode::none);
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0xA105) << "1 to 1001";
  EXPECT_EQ(rig.download(0x6091, 2, 1000, 4), AbortCode::none);
  rig.control(0x00);
  rig.run_ms(1);
  rig.control(0x80);
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0) << "1 to 1000";
  rig.download(0x6091, 2, 1, 4);
  rig.to_safe_operational();
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x608F, 0x6091, 0x6092})) {
    EXPECT_EQ(rig.download(index, 1, 4000, 4), AbortCode::device_state) << std::hex << index;
  }
}

}  // namespace
}  // namespace jmc_examples_test
}  // namespace servodrome
