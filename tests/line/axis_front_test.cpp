// The visible state of a drive (outputs, lamps and warnings) in the bench API and its stream, and faults that the bench
// injects while the drive's settings mask them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"
#include "line/tap.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace axis_front_test {
namespace {

using namespace test;
using api::Json;

class Front {
 public:
  explicit Front(std::string_view product, bool ethercat = false)
      : line(settings_of(
            fmt::format("clock = \"virtual\"\n[[bus]]\nname = \"bus\"\n{}[[axis]]\nname = \"axis\"\nproduct = \"{}\"\n",
                        ethercat ? "type = \"ethercat\"\n" : "", product))) {
    if (!ethercat) master.emplace(line.buses()[0]->bus);  // a node alone gets no acknowledgement
    run();
  }
  void run(Time time = 20ms) { line.run_until(line.now() + time); }
  Axis& axis() { return *line.axes()[0]; }
  Json view() { return bench::view_of(line, axis()); }
  dictionary::AbortCode set(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    return axis().device().dictionary().set_number(index, sub, value);
  }
  void inject(drive::Cause cause, bool present = true) {
    axis().inject(cause, present);
    run();
  }
  bool in_fault() { return axis().device().drive().any_fault(); }
  // Returns text such as "on" or "flashes 4"; "" if there is no such lamp.
  std::string lamp(std::string_view name) {
    const Json now = view();
    for (const Json& lamp : now["lamps"]) {
      if (lamp["name"] != name) continue;
      const std::string light = lamp["light"];
      return lamp.contains("flashes") ? fmt::format("{} {}", light, lamp["flashes"].get<int>()) : light;
    }
    return "";
  }

  Line line;
  std::optional<links::MemoryPort> master;
};

TEST(AxisFront, OutputsAreInTheViewAndAreSignals) {
  Front front("generic402");
  EXPECT_EQ(front.view()["outputs"], Json::parse(R"({"DO0": false, "DO1": false, "DO2": false, "DO3": false})"));
  front.set(0x60FE, 2, 0xF0000);
  front.set(0x60FE, 1, 0x50000);
  front.run();
  EXPECT_EQ(front.view()["outputs"], Json::parse(R"({"DO0": true, "DO1": false, "DO2": true, "DO3": false})"));
  for (const auto& [name, level] : {std::pair{"DO0", 1.0}, {"DO1", 0.0}, {"DO2", 1.0}, {"DO3", 0.0}}) {
    const Channel channel = signal_channel(front.axis(), name);
    ASSERT_NE(channel.read, nullptr) << name;
    EXPECT_EQ(channel.value(), level) << name;
  }
  for (const char* name : {"DO4", "DO", "DO00x", "DO-1", "DX0", "DO100"}) {
    EXPECT_EQ(signal_channel(front.axis(), name).read, nullptr) << name;
  }
  EXPECT_NE(signal_channel(front.axis(), "DI7").read, nullptr);
  EXPECT_EQ(signal_channel(front.axis(), "DI8").read, nullptr);
}

TEST(AxisFront, ProductsHaveTheOutputsOfTheirManuals) {
  EXPECT_EQ(Front("ismc").view()["outputs"].size(), 4U);          // DO0..DO3 (Table 4-92)
  EXPECT_EQ(Front("pronet").view()["outputs"].size(), 0U);        // the manual describes none
  EXPECT_EQ(Front("ismk").view()["outputs"].size(), 5U);          // OUT1..OUT5 (Table 3-1, ch. 5.6.2 and 5.6.2.1)
  EXPECT_EQ(Front("jmc_ec", true).view()["outputs"].size(), 2U);  // alarm and in position (ch. 3.1.2)
}

TEST(AxisFront, WithoutPowerThereIsNothingToSee) {
  Front front("generic402");
  front.axis().power_off(front.line.now());
  for (const char* key : {"outputs", "lamps", "warnings"}) EXPECT_FALSE(front.view().contains(key)) << key;
}

// CiA 303-3.
TEST(AxisFront, LampsOfTheReferenceDriveFollowTheNode) {
  Front front("generic402");
  EXPECT_EQ(front.lamp("RUN"), "blinking");  // pre-operational
  EXPECT_EQ(front.lamp("ERR"), "off");
  const auto command = [&](std::uint8_t what) {
    front.master->send(nmt(what, 0), front.line.now());
    front.run();
  };
  command(1);
  EXPECT_EQ(front.lamp("RUN"), "on");
  command(2);
  EXPECT_EQ(front.lamp("RUN"), "flashes 1");
}

// ETG.1300.
TEST(AxisFront, LampsOfASlaveFollowItsState) {
  Front front("generic402-ec", true);
  EXPECT_EQ(front.lamp("RUN"), "off");
  EXPECT_EQ(front.lamp("ERR"), "off");
}

// Table 3-1 of the iSMK manual.
TEST(AxisFront, LampsOfTheIsmk) {
  Front front("ismk");
  EXPECT_EQ(front.lamp("PWR"), "on");
  EXPECT_EQ(front.lamp("ERR"), "off");
  EXPECT_EQ(front.lamp("RUN"), "on");
  front.inject(drive::Cause::encoder_connection);
  EXPECT_EQ(front.lamp("ERR"), "on");
  EXPECT_EQ(front.lamp("RUN"), "off");
}

// On EtherCAT there are also the lamps of the bus.
TEST(AxisFront, LampsOfTheIsmkOnEthercat) {
  Front front("ismk-ea", true);
  EXPECT_EQ(front.view()["lamps"].size(), 5U);
  EXPECT_EQ(front.lamp("RUN"), "on");
  EXPECT_EQ(front.lamp("BUS RUN"), "off");
  EXPECT_EQ(front.lamp("BUS ERR"), "off");
}

TEST(AxisFront, LampsOfTheOthers) {
  Front ismc("ismc");
  EXPECT_EQ(ismc.lamp("fault"), "off");
  ismc.inject(drive::Cause::encoder_connection);
  EXPECT_EQ(ismc.lamp("fault"), "blinking");  // ch. 5
  Front jmc("jmc_ec", true);
  EXPECT_EQ(jmc.lamp("alarm"), "off");
  jmc.inject(drive::Cause::following_error);
  EXPECT_EQ(jmc.lamp("alarm"), "flashes 4");  // ch. 4.3.2
  EXPECT_EQ(Front("pronet").view()["lamps"], Json::array());
}

TEST(AxisFront, WarningsAreToldWhileTheyAreThere) {
  Front front("pronet");
  EXPECT_EQ(front.view()["warnings"], Json::array());
  front.axis().force_input(3, true);  // NOT
  front.run();
  const Json view = front.view();
  ASSERT_EQ(view["warnings"].size(), 1U);
  EXPECT_EQ(view["warnings"][0]["code"], "0x8682");
  EXPECT_EQ(view["faults"], Json::array());
  front.axis().force_input(3, false);
  front.run();
  EXPECT_EQ(front.view()["warnings"], Json::array());
}

// ---- Injected codes and the masks of their causes ----

// "The alarm takes effect when 0x2017 bit1 is set to 1" (ISMC, ch. 5, 8900h).
TEST(AxisFront, I2tOfTheIsmcIsMaskedBy2017h) {
  Front front("ismc");
  ASSERT_EQ(front.set(0x2017, 0, 0), dictionary::AbortCode::none);
  front.inject(drive::Cause::i2t);
  EXPECT_FALSE(front.in_fault());
  front.inject(drive::Cause::i2t, false);
  ASSERT_EQ(front.set(0x2017, 0, 2), dictionary::AbortCode::none);
  front.inject(drive::Cause::i2t);
  EXPECT_TRUE(front.in_fault());
}

// 2200h is 0 (off) by factory setting.
TEST(AxisFront, VelocityErrorOfTheIsmcIsMaskedBy2200h) {
  Front front("ismc");
  front.inject(drive::Cause::velocity_error);
  EXPECT_FALSE(front.in_fault());
  ASSERT_EQ(front.set(0x2200, 1, 1000), dictionary::AbortCode::none);
  front.run();
  EXPECT_TRUE(front.in_fault());
}

}  // namespace
}  // namespace axis_front_test
}  // namespace servodrome::line
