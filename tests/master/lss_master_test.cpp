#include "master/canopen/lss_master.hpp"

#include "can_line.hpp"
#include "master/canopen/master.hpp"
#include "master/error.hpp"

namespace servodrome::master::test {
namespace lss_master_test {
namespace {

class LssMasterTest : public ::testing::Test {
 protected:
  CanLine line;
  CanLine::Device& fresh = line.add(255);
  LssMaster lss{line.bus, 5ms};
  const LssAddress address{0x319, 0x10002, 0x30004, 0xCAFE1234};
};

TEST_F(LssMasterTest, FastscanFindsTheWholeAddressAndConfiguresTheNode) {
  EXPECT_TRUE(lss.any_unconfigured());
  EXPECT_EQ(lss.fastscan(), address);
  EXPECT_EQ(lss.inquire_address(), address);
  EXPECT_EQ(lss.inquire_node_id(), 255);
  Master master(line.bus);
  lss.set_node_id(42);
  lss.switch_all_to_waiting();
  EXPECT_TRUE(line.bus.run_until(line.now() + 100ms, [&] { return master.health(42).boot_ups == 1; }));
  EXPECT_EQ(fresh.node.node_id(), 42);
  EXPECT_FALSE(lss.any_unconfigured());
  EXPECT_EQ(lss.fastscan(), std::nullopt);
}

TEST_F(LssMasterTest, FastscanTellsTwoNodesApart) {
  CanLine::Device& other = line.add(255);
  other.objects.communication.serial_number = 0xCAFE1233;
  EXPECT_EQ(lss.fastscan()->serial_number, 0xCAFE1233U) << "a 0 bit goes before a 1 bit";
  lss.set_node_id(10);
  lss.switch_all_to_waiting();
  EXPECT_EQ(lss.fastscan()->serial_number, 0xCAFE1234U);
  lss.set_node_id(11);
  lss.switch_all_to_waiting();
  line.bus.run_for(10ms);
  EXPECT_EQ(other.node.node_id(), 10);
  EXPECT_EQ(fresh.node.node_id(), 11);
}

TEST_F(LssMasterTest, IdentifiesByRanges) {
  LssAddress lowest{0x319, 0x10002, 0x30000, 0};
  EXPECT_TRUE(lss.identify(lowest, 0x30004, 0xFFFFFFFF));
  EXPECT_FALSE(lss.identify(lowest, 0x30003, 0xFFFFFFFF));
  lowest.product_code = 1;
  EXPECT_FALSE(lss.identify(lowest, 0x30004, 0xFFFFFFFF));
}

TEST_F(LssMasterTest, SelectsAndSetsBitTimingAndStores) {
  EXPECT_FALSE(lss.select({0x319, 0x10002, 0x30004, 1}));
  ASSERT_TRUE(lss.select(address));
  fresh.events.bit_timings[2] = true;
  lss.set_bit_timing(2);
  EXPECT_THROW(lss.set_bit_timing(3), MasterError);
  lss.set_node_id(7);
  EXPECT_THROW(lss.set_node_id(128), MasterError);
  lss.store();
  EXPECT_TRUE(fresh.events.saw("lss store 7 2"));
  lss.activate_bit_timing(20ms);
  line.bus.run_for(1ms);
  EXPECT_TRUE(fresh.events.saw("lss activate 2 20"));
}

TEST_F(LssMasterTest, NobodyInConfigurationIsAnError) {
  try {
    lss.inquire_node_id();
    FAIL();
  } catch (const MasterError& error) {
    EXPECT_EQ(error.happened(), "no node answered to \"inquire node-ID\"");
  }
}

}  // namespace
}  // namespace lss_master_test
}  // namespace servodrome::master::test
