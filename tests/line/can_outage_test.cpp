// The frames of a drive on CAN after its cable was cut for a while, and the bus load of drives in motion.
#include <gtest/gtest.h>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace can_outage_test {
namespace {

using namespace test;

constexpr std::uint32_t state_mask = 0x6F;
constexpr std::uint32_t operation_enabled = 0x27;

// A line of equal drives on can0, with node-IDs from 1 on, and a master.
struct Drives {
  explicit Drives(std::string_view product, unsigned count = 1)
      : line(settings_of(text_of(product, count))), recorder(line.buses()[0]->bus), master(line.buses()[0]->bus) {
    line.run_until(100ms);
  }

  static std::string text_of(std::string_view product, unsigned count) {
    std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n";
    for (unsigned node = 1; node <= count; ++node) {
      text += fmt::format("[[axis]]\nname = \"axis{0}\"\nproduct = \"{1}\"\nnode = {0}\n", node, product);
    }
    return text;
  }

  void pass(Time time) { line.run_until(line.now() + time); }
  void send(const canopen::Frame& frame, Time afterwards = 2ms) {
    ASSERT_TRUE(master.send(frame, line.now()));
    pass(afterwards);
  }
  Axis& axis(unsigned node) { return *line.axes()[node - 1]; }
  std::int64_t number(unsigned node, std::uint16_t index, std::uint8_t sub = 0) {
    return axis(node).device().dictionary().number(index, sub);
  }
  // Starts profile velocity mode; `speed` is in the drive's own unit.
  void run(std::uint8_t node, std::uint32_t speed) {
    send(sdo_write(node, 0x6060, 0, 3, 1));
    send(sdo_write(node, 0x6083, 0, 2'000'000, 4));
    send(sdo_write(node, 0x6084, 0, 2'000'000, 4));
    send(sdo_write(node, 0x60FF, 0, speed, 4));
    send(nmt(1, node));
    for (const std::uint32_t controlword : {6U, 7U, 15U}) send(sdo_write(node, 0x6040, 0, controlword, 2), 60ms);
    ASSERT_EQ(number(node, 0x6041) & state_mask, operation_enabled);
  }
  // Frames with this CAN-ID among those recorded since `first`.
  std::vector<canopen::Frame> seen(std::uint32_t id, std::size_t first) const {
    std::vector<canopen::Frame> frames;
    for (std::size_t i = first; i < recorder.events.size(); ++i) {
      const links::BusEvent& event = recorder.events[i];
      if (event.kind == links::BusEvent::Kind::frame && event.frame.id == id) frames.push_back(event.frame);
    }
    return frames;
  }

  Line line;
  Recorder recorder;
  links::MemoryPort master;
};

std::uint32_t status_in(const canopen::Frame& frame) { return frame.data[0] | std::uint32_t{frame.data[1]} << 8U; }

class CanOutage : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Products, CanOutage, testing::Values("ismc", "generic402", "pronet", "ismk"),
                         [](const auto& product) { return std::string(product.param); });

TEST_P(CanOutage, WhatIsToldAfterwardsIsTrue) {
  Drives drives(GetParam());
  // TPDO 1 begins with the statusword and is sent when its data change; TPDO 2 is at its factory setting.
  ASSERT_EQ(drives.number(1, 0x1A00, 1) >> 16, 0x6041);
  drives.send(sdo_write(1, 0x1800, 1, 0x80000181, 4));
  drives.send(sdo_write(1, 0x1800, 2, 255, 1));
  drives.send(sdo_write(1, 0x1800, 3, 0, 2));
  drives.send(sdo_write(1, 0x1800, 1, 0x181, 4));
  drives.run(1, 1000);
  auto& bus = drives.line.buses()[0]->bus;
  bus.cut(drives.axis(1).port(), true);
  drives.pass(200ms);
  ASSERT_EQ(drives.axis(1).device().dictionary().set_number(0x6040, 0, 0), dictionary::AbortCode::none);
  drives.pass(200ms);
  ASSERT_NE(drives.number(1, 0x6041) & state_mask, operation_enabled);

  const std::size_t first = drives.recorder.events.size();
  bus.cut(drives.axis(1).port(), false);
  drives.pass(11ms);
  const auto told = drives.seen(0x181, first);
  ASSERT_GE(told.size(), 1U);
  EXPECT_LE(told.size(), 25U) << "one that waited, and one a cycle";
  for (const canopen::Frame& frame : told)
    EXPECT_EQ(status_in(frame) & state_mask, drives.number(1, 0x6041) & state_mask);
  EXPECT_EQ(status_in(told.back()), drives.number(1, 0x6041)) << "something fresh follows";
}

// These drives leave the NMT state operational when the master is lost; the iSMK continues.
class MasterLost : public CanOutage {};
INSTANTIATE_TEST_SUITE_P(Products, MasterLost, testing::Values("ismc", "generic402", "pronet"),
                         [](const auto& product) { return std::string(product.param); });

TEST_P(MasterLost, NoTpdoWaitsForTheCable) {
  Drives drives(GetParam());
  drives.send(sdo_write(1, 0x1016, 1, 0x007F0032, 4));  // the heartbeat of the master: timeout 50 ms
  canopen::Frame heartbeat;
  heartbeat.id = 0x77F;
  heartbeat.length = 1;
  heartbeat.data[0] = 5;
  drives.send(nmt(1, 1));
  drives.send(heartbeat);
  auto& bus = drives.line.buses()[0]->bus;
  bus.cut(drives.axis(1).port(), true);
  drives.pass(20ms);
  ASSERT_TRUE(drives.axis(1).place(1000)) << "the position, of which TPDOs tell";
  drives.pass(200ms);
  ASSERT_NE(drives.axis(1).device().can_node()->nmt_state(), canopen::NmtState::operational);
  const std::size_t first = drives.recorder.events.size();
  bus.cut(drives.axis(1).port(), false);
  drives.pass(20ms);
  for (const std::uint32_t id : {0x181U, 0x281U, 0x381U, 0x481U}) EXPECT_EQ(drives.seen(id, first).size(), 0U) << id;
  EXPECT_GE(drives.seen(0x81, first).size(), 1U);
}

// ISMC manual, ch. 2.6.2, 'PDO transmission type' and 'Prohibited time': factory settings, three axes that turn.
TEST(CanLoad, IsmcDrivesInMotionLeaveTheBusToTheOthers) {
  Drives drives("ismc", 4);
  for (std::uint8_t node = 1; node <= 3; ++node) drives.run(node, 300'000 + 10'000U * node);
  drives.pass(1s);
  EXPECT_LT(drives.line.buses()[0]->bus.load_percent(drives.line.now()), 20.0);
  drives.run(4, 100'000);
  // A change of the statusword is sent within 10 ms while the axis turns.
  const std::size_t first = drives.recorder.events.size();
  drives.send(sdo_write(1, 0x6040, 0, 7, 2), 11ms);
  const auto told = drives.seen(0x181, first);
  ASSERT_FALSE(told.empty());
  EXPECT_NE(status_in(told.back()) & state_mask, operation_enabled);
}

}  // namespace
}  // namespace can_outage_test
}  // namespace servodrome::line
