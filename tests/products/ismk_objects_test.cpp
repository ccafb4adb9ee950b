#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "object_csv.hpp"

// Compares every object of the iSMK manual (tests/data/ismk_od.csv) with the running drive.
namespace servodrome {
namespace ismk_objects_test {
namespace {

using dictionary::AbortCode;
using products::Ismk;
using test::Difference;
using IsmkRig = test::FactoryIsmkRig;

const std::vector<Difference> differences{
    // 100 inc times 10000 is not the 524288 inc that the manual prints for 6065h; both objects show one limit (C9).
    {0x2FF0, 0x0E, "default"},
    // The printed range 0-31 omits two of the printed bits (C26).
    {0x2340, 0x10, "max"},
};

TEST(IsmkObjects, AreThoseOfTheManual) {
  test::FactoryIsmkRig rig;
  rig.run_ms(1);
  const auto rows = test::read_csv("ismk_od.csv");
  EXPECT_EQ(test::compare_objects(rig.device.dictionary(), 1, rows, differences, {"HEX"}), 177U);
}

// The numbers of entries of records, and three objects of CiA 402.
TEST(IsmkObjects, NoOthers) {
  EXPECT_EQ(test::unlisted_objects(Ismk::table, test::read_csv("ismk_od.csv")),
            "2010h:0 2020h:0 2340h:0 2502h:0 2508h:0 250Ah:0 250Bh:0 2605h:0 2FF0h:0 2FF1h:0 3011h:0 3041h:0 6061h:0 "
            "6064h:0 607Dh:0 6099h:0 60F5h:0 60F6h:0 60F9h:0 60FBh:0 6410h:0 6502h:0 6510h:0");
}

TEST(IsmkObjects, RangesHoldAtTheirEnds) {
  for (const dictionary::Entry& entry : Ismk::table) {
    if (entry.index < 0x2000 || !entry.writable() || !entry.has_range) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub});
    IsmkRig rig;
    rig.run_ms(1);
    if (entry.maximum < dictionary::maximum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.maximum + 1), AbortCode::value_too_high);
    }
    if (entry.minimum > dictionary::minimum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.minimum - 1), AbortCode::value_too_low);
    }
  }
}

TEST(IsmkObjects, ModesAndBitRatesThatAreNotThere) {
  IsmkRig rig;
  rig.run_ms(1);
  for (int mode = -4; mode <= 7; ++mode) {  // ch. 7.1, 6060h
    const bool there = mode == -4 || mode == -3 || mode == 1 || mode == 3 || mode == 4 || mode == 6 || mode == 7;
    EXPECT_EQ(rig.set(0x6060, 0, mode), there ? AbortCode::none : AbortCode::value_invalid) << mode;
  }
  EXPECT_EQ(rig.get(0x6502), 0x000C006D);
  for (int code = 1; code <= 100; ++code) {  // Table 9-26, 2F81h
    const bool there = code == 100 || code == 50 || code == 25 || code == 12 || code == 5 || code == 1;
    EXPECT_EQ(rig.set(0x2F81, 0, code), there ? AbortCode::none : AbortCode::value_invalid) << code;
  }
}

// Values that two objects show (ch. 5.2.1.4, 607Fh; Table 5-9, 6071h; Table 6-5; ch. 7.5, 2508.09; ch. 8.4.2).
TEST(IsmkObjects, TwinsAreOneValue) {
  IsmkRig rig;
  rig.run_ms(1);
  rig.set(0x6080, 0, 3000);
  EXPECT_EQ(rig.get(0x607F), 53687091);
  rig.set(0x607F, 0, 17895697);
  EXPECT_EQ(rig.get(0x6080), 1000);
  rig.set(0x607F, 0, 1);
  EXPECT_EQ(rig.get(0x6080), 1) << "below half a rpm it is a limit, and 0 would be none";
  rig.set(0x607F, 0, 0);
  EXPECT_EQ(rig.get(0x6080), 0);
  rig.set(0x2FF0, 9, 600);
  EXPECT_EQ(rig.get(0x60FF), 10737418);
  rig.set(0x60FF, 0, -1789570);
  EXPECT_EQ(rig.get(0x2FF0, 9), -100);
  rig.set(0x2508, 9, 33);
  EXPECT_EQ(rig.get(0x6068), 33);
  rig.set(0x2FF0, 0x0E, 100);
  EXPECT_EQ(rig.get(0x6065), 10000);
  rig.set(0x6065, 0, 777700);
  EXPECT_EQ(rig.get(0x2FF0, 0x0E), 7777);
  // 1 Arms is 60.33 DEC (appendix II): rated torque is 16 Ap, a third of 2048.
  rig.set(0x6071, 0, 1000);
  EXPECT_EQ(rig.get(0x60F6, 8), 683);
  rig.set(0x60F6, 8, -2048);
  EXPECT_EQ(rig.get(0x6071), -3000);
}

}  // namespace
}  // namespace ismk_objects_test
}  // namespace servodrome
