// Reports of a drive in fault, with every product on every bus it has.
#include "axis/fault_report.hpp"

#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"
#include "catalogue/product.hpp"

namespace servodrome::master::test {
namespace fault_report_test {
namespace {

using testing::HasSubstr;

class FaultReports : public testing::TestWithParam<RigCase> {
 protected:
  FaultReport report() { return read_faults(rig.objects(), product); }

  AxisRig rig{GetParam()};
  const catalogue::Product& product = catalogue::product_of(GetParam().product);
};
INSTANTIATE_TEST_SUITE_P(Every, FaultReports, testing::ValuesIn(every_product),
                         [](const auto& row) { return row.param.name(); });

TEST_P(FaultReports, AHealthyDriveHasNothingToSay) {
  const FaultReport healthy = report();
  EXPECT_TRUE(healthy.active.empty());
  EXPECT_TRUE(healthy.warnings.empty());
  EXPECT_TRUE(healthy.history.empty());
  EXPECT_TRUE(healthy.log.empty());
}

TEST_P(FaultReports, AnActiveFaultIsExplainedThenItIsHistory) {
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  rig.drive().inject(drive::Cause::over_voltage, true);
  rig.objects().wait(100ms);
  const FaultReport faulty = report();
  ASSERT_EQ(faulty.active.size(), 1U) << text_of_statusword(faulty.statusword);
  EXPECT_TRUE(faulty.warnings.empty());
  const bool knows_code = rig.objects().read_if_present<std::uint16_t>(0x603F) || !product.dialect.alarm_words.empty();
  if (knows_code) {
    EXPECT_THAT(text_of(faulty.active[0], product.name), HasSubstr("over-voltage"));
    ASSERT_FALSE(faulty.active[0].meanings.empty());
    EXPECT_FALSE(faulty.active[0].meanings[0]->remedy.empty());
  } else {
    EXPECT_THAT(text_of(faulty.active[0], product.name), HasSubstr("gives no code"));
  }
  EXPECT_EQ(faulty.active[0].alarm, product.name.starts_with("ismk") ? 5 : 0) << "2601h bit 5";
  rig.drive().inject(drive::Cause::over_voltage, false);
  if (product.name == "jmc_ec") return;  // this fault requires a power cycle
  axis.reset_fault();
  rig.objects().wait(50ms);
  const FaultReport after = report();
  EXPECT_TRUE(after.active.empty());
  const auto count = rig.objects().read_if_present<std::uint8_t>(0x1003);
  if (!count) return;
  ASSERT_EQ(after.history.size(), 1U);
  EXPECT_THAT(text_of(after.history[0], product.name), HasSubstr("over-voltage"));
  clear_fault_history(rig.objects());
  EXPECT_TRUE(report().history.empty());
  if (product.name == "pronet") {
    ASSERT_EQ(after.log.size(), 1U);
    EXPECT_EQ(after.log[0].code, 0x3110);
    EXPECT_EQ(report().log.size(), 1U) << "its own log stays";
  }
}

TEST(FaultTextOfReport, NamesAllAlarmsOfACodeAndWhatNobodyKnows) {
  EXPECT_EQ(text_of(fault_of_code(0x5003, {0x603F, 0}, "jmc_ec"), "jmc_ec"),
            "5003h AL.051 EEPROM parameters damaged or AL.062 parameters not stored");
  EXPECT_EQ(text_of(fault_of_code(0x8619, {0x603F, 0}, ""), ""), "8619h class: positioning controller");
  EXPECT_EQ(text_of(fault_of_code(0xB001, {0x603F, 0}, ""), ""), "B001h manufacturer-specific code");
  EXPECT_EQ(text_of_error_register(0x85), "generic, voltage, manufacturer");
}

// Several alarms at the same time; the iSMK has a bit for each.
TEST(FaultReportOfWords, EveryBitIsAnAlarm) {
  AxisRig rig({"ismk", RigCase::BusKind::modbus});
  rig.drive().inject(drive::Cause::over_voltage, true);
  rig.drive().inject(drive::Cause::motor_unknown, true);
  rig.objects().wait(100ms);
  const FaultReport report = read_faults(rig.objects(), catalogue::product_of("ismk"));
  ASSERT_EQ(report.active.size(), 2U);
  EXPECT_EQ(catalogue::alarm_name("ismk", report.active[0].alarm), "2601h bit 5 (002.0)");
  EXPECT_EQ(catalogue::alarm_name("ismk", report.active[1].alarm), "2602h bit 4 (001.0)");
}

}  // namespace
}  // namespace fault_report_test
}  // namespace servodrome::master::test
