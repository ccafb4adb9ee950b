#include <gtest/gtest.h>

#include "jmc_bus.hpp"

// Statusword and 603Fh after commands beyond the limits, with several alarms at once, and with warnings.
namespace servodrome {
namespace jmc_status_test {
namespace {

using drive::Cause;
using drive::PowerState;
using test::JmcBus;

constexpr std::uint16_t beyond_limit = 0x0800;
constexpr std::uint16_t with_warning = 0x0080;
constexpr std::uint16_t new_set_point = 0x0010;

struct StatusRig : JmcBus {
  explicit StatusRig(std::int8_t mode) {
    open_limits();
    connect();
    enable_in(mode);
    set(0x607D, 1, -5000);
    set(0x607D, 2, 5000);
    cycles(2);
    EXPECT_EQ(status_in() & beyond_limit, 0);
  }
  void reset() {
    word(0x80);
    word(0x00);
  }
  void go_to(std::int32_t target, std::uint16_t bits = 0) {
    put<std::int32_t>(Out::position, target);
    word(0x0F | new_set_point | bits);
    word(0x0F);
  }
  std::uint16_t error_in() const { return input<std::uint16_t>(In::error); }
};

// Bit 11 is for the command as well as for the position (Table 156): it explains 8612h although the axis never was
// there.
TEST(JmcStatus, CyclicCommandBeyondTheSoftwareLimit) {
  StatusRig rig(8);
  rig.cycles(500, [&](int i) { rig.put<std::int32_t>(JmcBus::Out::position, 10 * (i + 1)); });
  EXPECT_EQ(rig.status_in() & beyond_limit, 0);
  rig.put<std::int32_t>(JmcBus::Out::position, 5001);
  rig.cycles(3);
  EXPECT_NE(rig.status_in() & beyond_limit, 0);
  rig.cycles(400);
  EXPECT_EQ(rig.state(), 0x08U);
  EXPECT_EQ(rig.error_in(), 0x8612);
  EXPECT_NE(rig.status_in() & beyond_limit, 0) << "the command stays where it is";
  EXPECT_LT(rig.position(), 6000);
  rig.set(0x607D, 2, 9000);
  rig.cycles(2);
  EXPECT_EQ(rig.status_in() & beyond_limit, 0) << "within limits that were widened";
  rig.reset();
  rig.enable_in(8);
  EXPECT_EQ(rig.status_in() & beyond_limit, 0) << "the command is where the axis is";
}

// The same for set-points (object 607Dh), absolute and relative; the next one within the limits clears the bit.
TEST(JmcStatus, SetPointBeyondTheSoftwareLimit) {
  for (const bool relative : {false, true}) {
    StatusRig rig(1);
    rig.set(0x6081, 0, 40000);
    const std::uint16_t bits = relative ? 0x40 : 0;
    rig.go_to(3000, bits);
    rig.cycles(600);
    EXPECT_EQ(rig.status_in() & beyond_limit, 0);
    rig.go_to(relative ? -8001 : -5001, bits);
    EXPECT_NE(rig.status_in() & beyond_limit, 0);
    rig.cycles(300);
    EXPECT_EQ(rig.state(), 0x08U);
    EXPECT_NE(rig.status_in() & beyond_limit, 0);
    rig.reset();
    rig.enable_in(1);
    rig.go_to(relative ? -1000 : 2000, bits);
    rig.cycles(600);
    EXPECT_EQ(rig.status_in() & beyond_limit, 0);
    EXPECT_NEAR(rig.position(), 2000, 3);
  }
}

// An alarm after the first one sends an emergency, but does not change 603Fh and the panel.
TEST(JmcStatus, FirstAlarmIsNotHiddenBySecondOnes) {
  StatusRig rig(8);
  drive::Drive& drive = rig.device.drive();
  rig.set(0x605E, 0, 2);
  drive.inject(Cause::following_error, true);  // AL.501
  rig.cycles(1);
  drive.inject(Cause::jammed, true);  // AL.410
  rig.cycles(5);
  EXPECT_EQ(rig.error_in(), 0x5006);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.501");
  rig.cycles(300);
  ASSERT_EQ(drive.state(), PowerState::fault);
  drive.inject(Cause::motor_hot, true);  // in Fault
  rig.cycles(2);
  EXPECT_EQ(rig.error_in(), 0x5006);
  while (!rig.fetch().empty()) {
  }
  std::vector<std::uint16_t> codes;
  for (const test::Bytes& emergency : rig.emergencies) codes.push_back(ethercat::load_u16(emergency.data()));
  EXPECT_EQ(codes, (std::vector<std::uint16_t>{0x5006, 0x7121, 0x4310}));

  // After a refused reset the drive shows the remaining cause.
  drive.inject(Cause::following_error, false);
  rig.reset();
  EXPECT_EQ(rig.state(), 0x08U);
  EXPECT_EQ(rig.error_in(), 0x7121);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.410");
  drive.inject(Cause::jammed, false);
  drive.inject(Cause::motor_hot, false);
  rig.reset();
  EXPECT_EQ(rig.state(), 0x40U);
  EXPECT_EQ(rig.error_in(), 0);
  EXPECT_STREQ(rig.device.alarm().data(), "");
}

// An error of the bus in Fault does not hide the drive's alarm either; it is shown after the alarm is reset.
TEST(JmcStatus, ErrorOfTheBusComesBehindTheAlarmOfTheDrive) {
  StatusRig rig(8);
  rig.device.drive().inject(Cause::following_error, true);
  rig.cycles(300);
  ASSERT_EQ(rig.state(), 0x08U);
  rig.write(ethercat::reg::al_control, test::little_endian(std::uint16_t{3}));  // a state that does not exist
  rig.run_ms(2);
  EXPECT_EQ(rig.get(0x603F), 0x5006);
  rig.device.drive().inject(Cause::following_error, false);
  rig.set(0x6040, 0, 0x00);
  rig.set(0x6040, 0, 0x80);
  rig.run_ms(2);
  EXPECT_NE(rig.get(0x603F), 0);
  EXPECT_NE(rig.get(0x603F), 0x5006);
}

// Warnings are alarms of the list (ch. 9.1), and 603Fh has "the latest alarm signal" (Table 151): it shows a warning if
// there is no fault.
TEST(JmcStatus, WarningsAreReadIn603F) {
  StatusRig rig(8);
  drive::Drive& drive = rig.device.drive();
  drive.inject(products::jmc_ec::cause::memory_wear, true);
  rig.cycles(3);
  EXPECT_EQ(rig.error_in(), 0xA942);
  EXPECT_NE(rig.status_in() & with_warning, 0);
  EXPECT_EQ(rig.get(0x1001), 0);
  rig.plant.force_input(0, true);  // AL.950
  rig.cycles(50);
  EXPECT_EQ(rig.error_in(), 0xA942) << "one at a time";
  drive.inject(products::jmc_ec::cause::memory_wear, false);
  rig.cycles(3);
  EXPECT_EQ(rig.error_in(), 0xA950);
  drive.inject(Cause::following_error, true);
  rig.cycles(300);
  EXPECT_EQ(rig.error_in(), 0x5006) << "a fault comes first";
  drive.inject(Cause::following_error, false);
  rig.reset();
  EXPECT_EQ(rig.error_in(), 0xA950) << "still there";
  rig.plant.force_input(0, false);
  rig.cycles(50);
  EXPECT_EQ(rig.error_in(), 0);
  EXPECT_EQ(rig.status_in() & with_warning, 0);
  while (!rig.fetch().empty()) {
  }
  for (const test::Bytes& emergency : rig.emergencies) {
    EXPECT_NE(ethercat::load_u16(emergency.data()) & 0xFF00, 0xA900) << "no emergency of a warning";
  }
}

// A parameter that takes effect after power-on (AL.941), and a ramp that is limited, which has no alarm number.
TEST(JmcStatus, WarningsOfParametersAndRamps) {
  StatusRig rig(1);
  ASSERT_EQ(rig.set_panel(3, 9, 5000), dictionary::AbortCode::none);
  rig.cycles(3);
  EXPECT_EQ(rig.error_in(), 0xA941);
  ASSERT_EQ(rig.set_panel(3, 9, 4000), dictionary::AbortCode::none);
  rig.cycles(3);
  EXPECT_EQ(rig.error_in(), 0);
  rig.set(0x60C5, 0, 1000);
  rig.cycles(3);
  EXPECT_EQ(rig.error_in(), 0xA002);
  EXPECT_NE(rig.status_in() & with_warning, 0);
}

// Without the supply the link feeds the drive's electronics: under-voltage (AL.401, 65 %) comes when 3 W have
// discharged the capacitor that far.
TEST(JmcStatus, SupplyThatIsGoneEmptiesTheLink) {
  StatusRig rig(8);
  rig.word(0x06, 200);
  const plant::Parameters& parameters = rig.plant.parameters();
  EXPECT_EQ(parameters.supply.standby_w, 3.0);
  const double start_v = rig.plant.dc_link_v();
  const double end_v = 0.65 * parameters.supply.volts;
  rig.plant.set_supply_v(0.0);
  const double expected_ms =
      1e3 * 0.5 * parameters.supply.capacitance_f * (start_v * start_v - end_v * end_v) / parameters.supply.standby_w;
  const std::int64_t ticks = rig.run_until([&] { return rig.plant.dc_link_v() < end_v; }, 3000);
  EXPECT_NEAR(static_cast<double>(ticks) / 16.0, expected_ms, 0.02 * expected_ms);
  EXPECT_GE(rig.run_until([&] { return rig.get(0x603F) == 0x3220; }, 20), 0);
}

}  // namespace
}  // namespace jmc_status_test
}  // namespace servodrome
