#include "master/canopen/scan.hpp"

#include "can_line.hpp"
#include "master/canopen/sdo_client.hpp"

namespace servodrome::master::test {
namespace scan_test {
namespace {

TEST(Scan, FindsFiveNodesInTheTimeOfOneAbsentOne) {
  CanLine line;
  std::uint32_t serial = 100;
  for (const unsigned node_id : {1U, 2U, 17U, 64U, 127U}) {
    CanLine::Device& device = line.add(static_cast<std::uint8_t>(node_id));
    device.objects.communication.serial_number = serial++;
  }
  line.bus.run_for(10ms);
  const Time before = line.now();
  const std::vector<FoundNode> nodes = scan(line.bus, {.timeout = 250ms});
  // 127 requests take 16 ms on the bus at 1 Mbit/s.
  EXPECT_LT(line.now() - before, 300ms);
  ASSERT_EQ(nodes.size(), 5U);
  serial = 100;
  std::string found;
  for (const FoundNode& node : nodes) {
    found += std::to_string(node.node_id) + " ";
    EXPECT_EQ(node.name, canopen::test::constant_text);
    EXPECT_EQ(node.identity, (LssAddress{0x319, 0x10002, 0x30004, serial++}));
    EXPECT_EQ(node.profile(), 0);
    EXPECT_EQ(kind_of(node), "device without profile");
    EXPECT_EQ(node.software_version, "") << "it has no 100Ah";
  }
  EXPECT_EQ(found, "1 2 17 64 127 ");
}

TEST(Scan, OneNodeThatAnswersIsFoundWithoutWaiting) {
  CanLine line;
  line.add(3);
  line.bus.run_for(10ms);
  const Time before = line.now();
  EXPECT_EQ(scan(line.bus, {.first = 3, .last = 3}).size(), 1U);
  EXPECT_LT(line.now() - before, 20ms);
}

TEST(Scan, AStoppedNodeIsFoundByItsHeartbeat) {
  CanLine line;
  line.add(9);
  Master master(line.bus);
  SdoClient(line.bus, 9).write<std::uint16_t>(0x1017, 0, 400);
  master.command(NmtCommand::stop, 9);
  line.bus.run_for(10ms);
  EXPECT_EQ(scan(line.bus, {.timeout = 50ms}).size(), 0U);
  const auto nodes = scan(line.bus, {.timeout = 50ms, .listen = 500ms});
  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].node_id, 9);
  EXPECT_EQ(nodes[0].state, NmtState::stopped);
  EXPECT_FALSE(nodes[0].device_type);
}

TEST(Scan, AWrongToggleIsAborted) {
  CanLine line;
  line.add(3);
  line.bus.run_for(10ms);
  std::vector<std::string> aborts;
  line.lost = [&](const Frame& frame) {
    if (frame.id == 0x603 && frame.data[0] == 0x80) aborts.push_back(text_of(frame));
    return frame.id == 0x603 && frame.data[0] == 0x60;
  };
  const Bus::Subscription intruder =
      line.bus.every(1ms, [&] { line.intrude(frame_of("583 # 10 41 42 43 44 45 46 47")); });
  ASSERT_EQ(scan(line.bus, {.first = 3, .last = 3}).size(), 1U);
  EXPECT_THAT(aborts, testing::Contains("603 # 80 08 10 00 00 00 03 05"));
}

TEST(Scan, AnswersThatGetLostLeaveGapsOnly) {
  CanLine line;
  line.add(4);
  line.bus.run_for(10ms);
  line.lost = [](const Frame& frame) { return frame.id == 0x584 && frame.data[1] == 0x18 && frame.data[3] == 2; };
  const auto nodes = scan(line.bus, {.timeout = 20ms});
  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].identity, (LssAddress{0x319, 0, 0x30004, 0xCAFE1234}));
  EXPECT_EQ(nodes[0].name, canopen::test::constant_text);
}

TEST(Scan, KindsByDeviceType) {
  FoundNode node;
  EXPECT_EQ(kind_of(node), "");
  node.device_type = 0x00020192;
  EXPECT_TRUE(node.is_drive());
  EXPECT_EQ(kind_of(node), "servo drive (CiA 402)");
  node.device_type = 0x00040192;
  EXPECT_EQ(kind_of(node), "stepper drive (CiA 402)");
  node.device_type = 0x000F0191;
  EXPECT_EQ(kind_of(node), "CiA 401 device");
}

}  // namespace
}  // namespace scan_test
}  // namespace servodrome::master::test
