#include "can_line.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/sdo_client.hpp"

namespace servodrome::master::test {
namespace canopen_master_test {
namespace {

class MasterTest : public ::testing::Test {
 protected:
  CanLine line;
  Master master{line.bus};
  CanLine::Device& device = line.add(5);
};

TEST_F(MasterTest, HearsBootUpAndHeartbeats) {
  std::vector<std::string> heard;
  master.on_boot_up([&](std::uint8_t node) { heard.push_back("boot " + std::to_string(node)); });
  master.on_state(
      [&](std::uint8_t node, NmtState state) { heard.push_back(std::to_string(node) + " " + name(state)); });
  line.bus.run_for(1ms);
  SdoClient(line.bus, 5).write<std::uint16_t>(0x1017, 0, 10);
  master.command(NmtCommand::start, 5);
  EXPECT_TRUE(master.wait_for_state(5, NmtState::operational, 50ms));
  master.command(NmtCommand::stop);
  EXPECT_TRUE(master.wait_for_state(5, NmtState::stopped, 50ms));
  EXPECT_FALSE(master.wait_for_state(5, NmtState::operational, 50ms));
  EXPECT_EQ(heard, (std::vector<std::string>{"boot 5", "5 pre-operational", "5 operational", "5 stopped"}));
}

TEST_F(MasterTest, WaitsForTheConfirmationOfACommand) {
  line.bus.run_for(1ms);
  EXPECT_THROW(master.command_and_wait(NmtCommand::start, 5, 50ms), MasterError) << "no heartbeat, no proof";
  EXPECT_EQ(device.node.nmt_state(), NmtState::operational);
  master.command_and_wait(NmtCommand::reset_node, 5, 50ms);
  EXPECT_EQ(master.health(5).boot_ups, 2U);
  SdoClient(line.bus, 5).write<std::uint16_t>(0x1017, 0, 10);
  master.command_and_wait(NmtCommand::stop, 5, 50ms);
  EXPECT_EQ(device.node.nmt_state(), NmtState::stopped);
  EXPECT_THROW(master.command_and_wait(NmtCommand::reset_node, 6, 50ms), MasterError);
}

TEST_F(MasterTest, DecodesEmergencies) {
  std::vector<std::string> heard;
  master.on_emergency([&](const Emergency& emergency) { heard.push_back(text_of(emergency)); });
  line.bus.run_for(1ms);
  device.node.raise(0x3210, 0x04, {1, 2, 3, 4, 5});
  line.bus.run_for(1ms);
  device.node.clear();
  line.bus.run_for(1ms);
  EXPECT_EQ(heard,
            (std::vector<std::string>{"EMCY 3210h DC link over-voltage, error register 05h, vendor 01 02 03 04 05",
                                      "EMCY 0000h no error, error register 00h, vendor 00 00 00 00 00"}));
  EXPECT_EQ(master.health(5).emergency->code, 0);
}

TEST_F(MasterTest, CodesWithoutWordsOfTheirOwnAreDescribedByTheirClass) {
  EXPECT_EQ(text_of_error_code(0x8611), "following error");
  EXPECT_EQ(text_of_error_code(0x8619), "class: positioning controller");
  EXPECT_EQ(text_of_error_code(0x2345), "class: short circuit, device output side");
  EXPECT_EQ(text_of_error_code(0x9ABC), "class: external error");
  EXPECT_EQ(text_of_error_code(0xFF42), "class: device specific");
  EXPECT_EQ(text_of_error_code(0xB001), "manufacturer-specific code");
}

// Records the SYNCs on the bus, with the time since the start.
struct SyncWatch final : links::BusObserver {
  explicit SyncWatch(CanLine& its_line) : line(its_line), start(its_line.now()) { line.wire.add_observer(*this); }
  ~SyncWatch() { line.wire.remove_observer(*this); }
  void on_bus_event(const links::BusEvent& event) override {
    if (event.frame.id != 0x80) return;
    syncs.push_back(std::to_string((event.start - start) / 1ms) + " ms" + text_of(event.frame).substr(5));
  }
  CanLine& line;
  Time start;
  std::vector<std::string> syncs;
};

TEST_F(MasterTest, SyncIsProducedInTimeWithItsCounter) {
  line.bus.run_for(1ms);
  SyncWatch watch(line);
  const auto producing = master.produce_sync(2ms, 3);
  line.bus.run_for(9ms);
  EXPECT_EQ(watch.syncs, (std::vector<std::string>{"2 ms 01", "4 ms 02", "6 ms 03", "8 ms 01"}));
}

TEST_F(MasterTest, ProcessDataGoBothWays) {
  master.command(NmtCommand::start, 5);
  line.bus.run_for(1ms);
  device.map(0x1400, {0x60400010, 0x607A0020});
  device.map(0x1800, {0x60410010}, 1);
  const std::array<std::uint8_t, 6> order{0x0F, 0x00, 0x78, 0x56, 0x34, 0x12};
  master.send_pdo(0x205, order);
  line.bus.run_for(1ms);
  EXPECT_EQ(device.objects.controlword, 0x0F);
  EXPECT_EQ(device.objects.target_position, 0x12345678);
  device.objects.statusword = 0x1237;
  master.send_sync();
  const auto answer = master.wait_for_pdo(0x185, 10ms);
  ASSERT_TRUE(answer);
  EXPECT_EQ(text_of(*answer), "185 # 37 12");
  EXPECT_FALSE(master.wait_for_pdo(0x185, 10ms));
  EXPECT_THROW(master.send_pdo(0x205, std::array<std::uint8_t, 9>{}), MasterError);
}

TEST_F(MasterTest, GuardsANodeByRemoteFrames) {
  line.bus.run_for(1ms);
  const auto first = master.guard(5, 10ms);
  const auto second = master.guard(5, 10ms);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->state, NmtState::pre_operational);
  EXPECT_NE(first->toggle, second->toggle);
  EXPECT_FALSE(master.guard(6, 10ms));
}

TEST_F(MasterTest, AHeartbeatOfItsOwn) {
  SdoClient(line.bus, 5).write<std::uint32_t>(0x1016, 1, 100U << 16 | 30U);
  {
    const auto beating = master.produce_heartbeat(100, 10ms);
    line.bus.run_for(100ms);
    EXPECT_FALSE(master.health(5).emergency);
  }
  line.bus.run_for(100ms);
  ASSERT_TRUE(master.health(5).emergency);
  EXPECT_EQ(master.health(5).emergency->code, 0x8130);
}

}  // namespace
}  // namespace canopen_master_test
}  // namespace servodrome::master::test
