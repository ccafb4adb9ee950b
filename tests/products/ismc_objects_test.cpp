#include <gtest/gtest.h>

#include "object_csv.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Compares every object of the ISMC manual (tests/data/ismc_od.csv) with the running drive: type, access, PDO mapping,
// default, range, unit. Differences are listed with their reasons, and the list must not contain entries without a
// difference.
namespace servodrome {
namespace ismc_objects_test {
namespace {

using dictionary::Entry;
using products::Ismc;

const std::vector<test::Difference> differences{
    // CiA 301 allows mapping of the error register.
    {0x1001, test::any_sub, "pdo"},
    // Only bits 15 to 0 are milliseconds.
    {0x1016, test::any_sub, "unit"},
    // PDO 3 and 4 are invalid from the factory (ch. 2.6.2, 'PDO CAN identifier', G7).
    {0x1402, test::any_sub, "default"},
    {0x1403, test::any_sub, "default"},
    {0x1802, test::any_sub, "default"},
    {0x1803, test::any_sub, "default"},
    // The node refuses more than eight objects, with 0604 0042h if they are too long.
    {0x1600, test::any_sub, "max"},
    {0x1601, test::any_sub, "max"},
    {0x1602, test::any_sub, "max"},
    {0x1603, test::any_sub, "max"},
    {0x1A00, test::any_sub, "max"},
    {0x1A01, test::any_sub, "max"},
    {0x1A02, test::any_sub, "max"},
    {0x1A03, test::any_sub, "max"},
    // Some values within the range do not exist; the drive refuses them with 0609 0030h (G13, G14).
    {0x605A, test::any_sub, "min"},
    {0x605A, test::any_sub, "max"},
    {0x605B, test::any_sub, "min"},
    {0x605B, test::any_sub, "max"},
    {0x605C, test::any_sub, "min"},
    {0x605C, test::any_sub, "max"},
    {0x605D, test::any_sub, "min"},
    {0x605D, test::any_sub, "max"},
    {0x605E, test::any_sub, "min"},
    {0x605E, test::any_sub, "max"},
    {0x6060, test::any_sub, "min"},
    {0x6060, test::any_sub, "max"},
    {0x6061, test::any_sub, "min"},
    {0x6061, test::any_sub, "max"},
    // Accepted by the object; a fault when a motion is planned: 6285h, 6286h, 6287h, 6553h (G39b).
    {0x2117, test::any_sub, "min"},
    {0x2117, test::any_sub, "max"},
    {0x6086, test::any_sub, "min"},
    {0x6086, test::any_sub, "max"},
    {0x6088, test::any_sub, "min"},
    {0x6088, test::any_sub, "max"},
    {0x60C2, test::any_sub, "min"},
    // The manual's mapping column is incomplete: all process data can be mapped (G44).
    {0x6062, test::any_sub, "pdo"},
    {0x6063, test::any_sub, "pdo"},
    {0x6069, test::any_sub, "pdo"},
    {0x606B, test::any_sub, "pdo"},
    {0x6074, test::any_sub, "pdo"},
    {0x6077, test::any_sub, "pdo"},
    {0x6083, test::any_sub, "pdo"},
    {0x6084, test::any_sub, "pdo"},
    {0x6087, test::any_sub, "pdo"},
    {0x60B0, test::any_sub, "pdo"},
    {0x60B1, test::any_sub, "pdo"},
    {0x60B2, test::any_sub, "pdo"},
    {0x60B8, test::any_sub, "pdo"},
    {0x60B9, test::any_sub, "pdo"},
    {0x60BA, test::any_sub, "pdo"},
    {0x60FC, test::any_sub, "pdo"},
    {0x60FD, test::any_sub, "pdo"},
    {0x60FE, test::any_sub, "pdo"},
};

TEST(IsmcObjects, AreThoseOfTheManual) {
  test::Rig<Ismc> rig;
  EXPECT_EQ(test::compare_objects(rig.device.dictionary(), 1, test::read_csv("ismc_od.csv"), differences), 204U);
}

// The settings of the maker's tool, and objects that CiA 402 requires in addition to the manual. Each is in the README.
TEST(IsmcObjects, NoOthers) {
  EXPECT_EQ(test::unlisted_objects(Ismc::table, test::read_csv("ismc_od.csv")),
            "2F10h:0 2F11h:0 2F12h:0 2F12h:1 2F12h:2 2F12h:3 2F12h:4 2F12h:5 2F12h:6 2F13h:0 2F14h:0 2F15h:0 2F16h:0 "
            "2F17h:0 2F18h:0 603Fh:0 60C2h:0 60C2h:2 6502h:0");
}

// Every writable object accepts its limits, and no value beyond them.
TEST(IsmcObjects, RangesHoldAtTheirEnds) {
  test::Rig<Ismc> rig;
  rig.run_ms(1);
  for (const Entry& entry : Ismc::table) {
    if (entry.index < 0x2000 || !entry.writable() || !entry.has_range) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub});
    using dictionary::AbortCode;
    if (entry.maximum < dictionary::maximum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.maximum + 1), AbortCode::value_too_high);
    }
    if (entry.minimum > dictionary::minimum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.minimum - 1), AbortCode::value_too_low);
    }
    if (entry.index == 0x2401) continue;  // needs a memory; tested below
    for (const std::int64_t value : {entry.minimum, entry.maximum}) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, value), AbortCode::none) << value;
      EXPECT_EQ(rig.get(entry.index, entry.sub), value);
    }
  }
}

TEST(IsmcObjects, ModesAndBitRatesThatAreNotThere) {
  using dictionary::AbortCode;
  test::Rig<Ismc> rig;
  rig.run_ms(1);
  for (int mode = -128; mode < 128; ++mode) {  // Table 1-2; ch. 4.1, 6060h, G14
    const bool there = mode == 0 || mode == 1 || mode == 3 || mode == 4 || mode == 6 || mode == 8;
    EXPECT_EQ(rig.set(0x6060, 0, mode), there ? AbortCode::none : AbortCode::value_invalid) << mode;
  }
  EXPECT_EQ(rig.get(0x6502), 0xAD);
  for (const int rate : {1000000, 800000, 500000, 250000, 125000, 50000, 20000}) {
    EXPECT_NE(rig.set(0x2004, 0, rate), AbortCode::value_invalid) << rate;
  }
  EXPECT_EQ(rig.set(0x2004, 0, 100000), AbortCode::value_invalid);
  EXPECT_EQ(rig.set(0x2004, 0, 999999), AbortCode::value_invalid);
}

}  // namespace
}  // namespace ismc_objects_test
}  // namespace servodrome
