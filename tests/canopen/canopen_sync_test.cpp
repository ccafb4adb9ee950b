#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_sync_test {
namespace {

constexpr std::uint32_t produce = 0x40000000;

TEST(Sync, ConsumerTellsTheDevice) {
  auto device = make_device();
  device->start();
  device->events.log.clear();
  device->send("080 #");
  EXPECT_EQ(device->events.log, (Frames{"sync 0"}));
  ASSERT_EQ(device->write(0x1005, 0, 0x90, 4), AbortCode::none);
  device->events.log.clear();
  device->send("080 #");
  EXPECT_EQ(device->events.log, Frames{});
  device->send("090 #");
  EXPECT_EQ(device->events.log, (Frames{"sync 0"}));
}

TEST(Sync, TakesOverThenSamplesThenTells) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010}, 1);
  device->map(0x1800, {0x60400010}, 1);
  device->send("000 # 01 01");
  device->send("201 # 34 12");
  device->events.log.clear();
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 34 12"}));
  EXPECT_EQ(device->events.log, (Frames{"rpdo 0", "sync 0"}));
}

TEST(Sync, CounterAndLength) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1019, 0, 1, 1), AbortCode::value_invalid);
  EXPECT_EQ(device->write(0x1019, 0, 241, 1), AbortCode::value_invalid);
  ASSERT_EQ(device->write(0x1019, 0, 10, 1), AbortCode::none);
  device->events.log.clear();
  EXPECT_EQ(device->send("080 # 07"), Frames{});
  EXPECT_EQ(device->events.log, (Frames{"sync 7"}));
  EXPECT_EQ(device->send("080 #"), (Frames{"081 # 40 82 11 00 00 00 00 00"}));
  EXPECT_EQ(device->events.log.size(), 1U) << "not acted upon";
  EXPECT_EQ(device->send("080 # 08"), (Frames{"081 # 00 00 00 00 00 00 00 00"}));
  EXPECT_EQ(device->events.log.size(), 2U);
}

TEST(Sync, Producer) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010}, 2);
  ASSERT_EQ(device->write(0x1006, 0, 1000, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1019, 0, 5, 1), AbortCode::device_state) << "1006h is not 0";
  ASSERT_EQ(device->write(0x1005, 0, produce | 0x80, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1005, 0, produce | 0x90, 4), AbortCode::value_invalid) << "while producing";
  EXPECT_EQ(device->advance(999us), Frames{});
  EXPECT_EQ(device->advance(1us), (Frames{"080 #"}));
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(4ms), (Frames{"080 #", "080 #", "181 # 00 00", "080 #", "080 #", "181 # 00 00"}));
  EXPECT_TRUE(device->events.saw("sync 0")) << "a producer consumes its own";
  device->send("000 # 02 01");
  EXPECT_EQ(device->advance(10ms), Frames{}) << "not in stopped";
  device->send("000 # 80 01");
  EXPECT_EQ(device->advance(10ms).size(), 10U);
  ASSERT_EQ(device->write(0x1005, 0, 0x80, 4), AbortCode::none);
  EXPECT_EQ(device->advance(10ms), Frames{});
}

TEST(Sync, ProducerCounts) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1019, 0, 3, 1), AbortCode::none);
  ASSERT_EQ(device->write(0x1005, 0, produce | 0x80, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1006, 0, 500, 4), AbortCode::none);
  EXPECT_EQ(device->advance(2ms), (Frames{"080 # 01", "080 # 02", "080 # 03", "080 # 01"}));
  EXPECT_TRUE(device->events.saw("sync 3"));
  device->send("000 # 02 01");
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(500us), (Frames{"080 # 01"})) << "the count begins anew after stopped";
}

TEST(Sync, ProducerDoesNotDriftWhenPolledLate) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1005, 0, produce | 0x80, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1006, 0, 1000, 4), AbortCode::none);
  const Time begin = device->now;
  unsigned syncs = 0;
  while (device->now < begin + 1s) {
    device->now += 700us;
    device->node.poll(device->now);
    syncs += static_cast<unsigned>(device->sent().size());
  }
  EXPECT_EQ(syncs, 1000U);
}

// A producer with saved values begins again at power-on, with counter 1.
TEST(Sync, ProducerBeginsAnewAtPowerOn) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1019, 0, 10, 1), AbortCode::none);
  ASSERT_EQ(device->write(0x1005, 0, produce | 0x80, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1006, 0, 10000, 4), AbortCode::none);
  EXPECT_EQ(device->advance(20ms), (Frames{"080 # 01", "080 # 02"}));
  EXPECT_EQ(device->start(), (Frames{"701 # 00"}));
  EXPECT_EQ(device->advance(20ms), (Frames{"080 # 01", "080 # 02"}));
}

// A device without 1019h ignores the counter.
TEST(Sync, WithoutItsObjectTheLengthDoesNotMatter) {
  static constexpr auto table = dictionary::make_table<[] {
    using namespace dictionary;
    TableBuilder<10> t;
    t.add(number_constant(0x1000, 0, ObjectCode::var, "Device type", Type::unsigned32, 0x00020192));
    t.add(number_constant(0x1001, 0, ObjectCode::var, "Error register", Type::unsigned8, 0));
    t.add(number_constant(0x1005, 0, ObjectCode::var, "COB-ID SYNC", Type::unsigned32, 0x80));
    t.add(highest_sub(0x1018, ObjectCode::record, "Identity object", 1));
    t.add(number_constant(0x1018, 1, ObjectCode::record, "Vendor-ID", Type::unsigned32, 0x319));
    return t;
  }>();
  std::array<std::byte, 1> nothing{};
  dictionary::Dictionary dictionary(table, nothing);
  const Profile profile;
  RecordingEvents events;
  NodeStorage<1, 1, 1, 1, 8> storage;
  Node node(dictionary, profile, events, storage.memory());
  node.start(9, 0s);
  Frame out;
  ASSERT_TRUE(node.take(out));
  events.log.clear();
  for (const char* const sync : {"080 # 07", "080 #", "080 # 01 02"}) {
    node.receive(frame_of(sync), 0s);
    EXPECT_FALSE(node.take(out)) << "no emergency";
  }
  EXPECT_EQ(events.log, (Frames{"sync 0", "sync 0", "sync 0"}));
}

TEST(Sync, ProductRules) {
  auto device = make_device<>({.sync_producer = false, .sync_cob_id_fixed = true});
  device->start();
  EXPECT_EQ(device->write(0x1005, 0, 0x81, 4), AbortCode::value_invalid);
  EXPECT_EQ(device->write(0x1005, 0, produce | 0x80, 4), AbortCode::value_invalid);
  // ESTUN manual, ch. 3.4, 1005h
  EXPECT_EQ(device->write(0x1005, 0, 0x80000080, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1005, 0, 0x80, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1005, 0, 0x20000080, 4), AbortCode::value_invalid);
}

TEST(TimeStamp, MillisecondsAndDays) {
  auto device = make_device();
  device->start();
  device->events.log.clear();
  device->send("100 # FF FF FF FF 34 12");
  EXPECT_EQ(device->events.log, (Frames{"time 268435455 4660"})) << "28 bits of milliseconds";
  device->send("100 # FF FF FF FF 34");
  EXPECT_EQ(device->events.log.size(), 1U);
  ASSERT_EQ(device->write(0x1012, 0, 0x100, 4), AbortCode::none);
  device->send("100 # 00 00 00 00 34 12");
  EXPECT_EQ(device->events.log.size(), 1U) << "bit 31 of 1012h: consumed";
  EXPECT_EQ(device->write(0x1012, 0, 0xC0000100, 4), AbortCode::value_invalid) << "no producer";
  auto without = make_device<>({.time_consumer = false});
  without->start();
  without->events.log.clear();
  without->send("100 # 00 00 00 00 34 12");
  EXPECT_EQ(without->events.log, Frames{});
}

}  // namespace
}  // namespace canopen_sync_test
}  // namespace servodrome::canopen::test
