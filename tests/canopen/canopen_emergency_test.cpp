#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_emergency_test {
namespace {

TEST(Emergency, FrameRegisterAndHistory) {
  auto device = make_device();
  device->start();
  device->node.raise(0x2310, 0x02, {1, 2, 3, 4, 5});
  EXPECT_EQ(device->sent(), (Frames{"081 # 10 23 03 01 02 03 04 05"}));
  device->node.raise(0x4210, 0x08, {});
  EXPECT_EQ(device->sent(), (Frames{"081 # 10 42 0B 00 00 00 00 00"}));
  EXPECT_EQ(device->send("601 # 40 01 10 00 00 00 00 00"), (Frames{"581 # 4F 01 10 00 0B 00 00 00"}));
  EXPECT_EQ(device->send("601 # 40 03 10 00 00 00 00 00"), (Frames{"581 # 4F 03 10 00 02 00 00 00"}));
  EXPECT_EQ(device->send("601 # 40 03 10 01 00 00 00 00"), (Frames{"581 # 43 03 10 01 10 42 00 00"})) << "the newest";
  EXPECT_EQ(device->send("601 # 40 03 10 02 00 00 00 00"), (Frames{"581 # 43 03 10 02 10 23 01 02"}));
  device->node.clear(0x02);
  EXPECT_EQ(device->sent(), (Frames{"081 # 00 00 03 00 00 00 00 00"})) << "one of two went";
  device->node.clear();
  EXPECT_EQ(device->sent(), (Frames{"081 # 00 00 00 00 00 00 00 00"}));
  device->node.clear();
  EXPECT_EQ(device->sent(), Frames{}) << "there was no error";
  EXPECT_EQ(device->node.error_register(), 0);
}

TEST(Emergency, HistoryIsBoundedAndCleared) {
  auto device = make_device();
  device->start();
  for (std::uint16_t code = 0x1001; code <= 0x1006; ++code) device->node.raise(code, 0, {});
  const auto& objects = device->objects.communication;
  EXPECT_EQ(objects.predefined_error_count, 4);
  EXPECT_EQ(objects.predefined_error_field, (std::array<std::uint32_t, 4>{0x1006, 0x1005, 0x1004, 0x1003}));
  EXPECT_EQ(device->write(0x1003, 0, 1, 1), AbortCode::value_invalid);
  EXPECT_EQ(device->write(0x1003, 1, 0, 4), AbortCode::read_only);
  EXPECT_EQ(device->write(0x1003, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(objects.predefined_error_count, 0);
  EXPECT_EQ(objects.predefined_error_field, (std::array<std::uint32_t, 4>{}));
}

TEST(Emergency, WaitsForAStateThatSendsIt) {
  auto device = make_device();
  device->node.raise(0x1000, 0, {});
  EXPECT_EQ(device->start(), (Frames{"701 # 00"})) << "power-on begins without errors";
  device->send("000 # 02 01");
  device->node.raise(0x1000, 0, {});
  EXPECT_EQ(device->sent(), Frames{});
  EXPECT_EQ(device->send("000 # 80 01"), (Frames{"081 # 00 10 01 00 00 00 00 00"}));
}

TEST(Emergency, InhibitTimeAndQueue) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1015, 0, 100, 2), AbortCode::none);  // 10 ms
  for (std::uint16_t code = 1; code <= 12; ++code) device->node.raise(code, 0, {});
  EXPECT_EQ(device->sent(), (Frames{"081 # 01 00 01 00 00 00 00 00"}));
  EXPECT_EQ(device->advance(9999us), Frames{});
  EXPECT_EQ(device->advance(1us), (Frames{"081 # 02 00 01 00 00 00 00 00"}));
  EXPECT_EQ(device->advance(1s).size(), 7U) << "eight wait, the rest is in the history alone";
  EXPECT_EQ(device->objects.communication.predefined_error_field[0], 12U);
}

TEST(Emergency, CobId) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1014, 0, 0x82, 4), AbortCode::value_invalid) << "valid: other identifier";
  EXPECT_EQ(device->write(0x1014, 0, 0x80000081, 4), AbortCode::none);
  device->node.raise(0x1000, 0x20, {});
  EXPECT_EQ(device->sent(), Frames{});
  EXPECT_EQ(device->node.error_register(), 0x21) << "updated all the same (ISMC manual, ch. 2.8)";
  EXPECT_EQ(device->objects.communication.predefined_error_count, 1);
  EXPECT_EQ(device->write(0x1014, 0, 0x0FF, 4), AbortCode::none);
  device->node.clear();
  EXPECT_EQ(device->sent(), (Frames{"0FF # 00 00 00 00 00 00 00 00"}));
}

TEST(Emergency, ProductsWithoutErrorReset) {
  auto device = make_device<>({.emergency_on_error_reset = false});
  device->start();
  device->node.raise(0x1000, 0, {});
  device->sent();
  device->node.clear();
  EXPECT_EQ(device->sent(), Frames{});
  EXPECT_EQ(device->node.error_register(), 0);
}

TEST(Emergency, ErrorsSurviveResets) {
  auto device = make_device();
  device->start();
  device->node.raise(0x1000, 0x04, {});
  device->sent();
  device->send("000 # 81 01");
  EXPECT_EQ(device->node.error_register(), 0x05);
  EXPECT_EQ(device->objects.communication.error_register, 0x05);
}

TEST(Emergency, Consumer) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1028, 2, 0x85, 4), AbortCode::none);
  device->events.log.clear();
  device->send("085 # 10 23 03 00 00 00 00 07");
  EXPECT_EQ(device->events.log, (Frames{"emergency 2 8976 7003"}));
  device->send("086 # 10 23 03 00 00 00 00 07");
  EXPECT_EQ(device->events.log.size(), 1U);
}

TEST(Emergency, LostFramesAreReported) {
  auto device = make_device();
  device->start();
  for (int i = 0; i < 100; ++i) device->node.receive(frame_of("601 # 40 61 60 00 00 00 00 00"), device->now);
  const Frames frames = device->sent();
  ASSERT_EQ(frames.size(), transmit_ring_size(4) + 2);
  EXPECT_EQ(frames[frames.size() - 2], "081 # 10 81 11 00 00 00 00 00");
  EXPECT_EQ(frames.back(), "081 # 00 00 00 00 00 00 00 00");
}

TEST(Emergency, BusOffAndErrorPassive) {
  auto device = make_device();
  device->start_operational();
  device->node.bus_state(BusState::error_passive, device->now);
  EXPECT_EQ(device->sent(), (Frames{"081 # 20 81 11 00 00 00 00 00"}));
  device->node.bus_state(BusState::bus_off, device->now);
  EXPECT_TRUE(device->events.saw("lost 3 0 0"));
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  device->node.bus_state(BusState::error_active, device->now);
  EXPECT_TRUE(device->events.saw("restored 3"));
  EXPECT_EQ(device->sent(), (Frames{"081 # 40 81 11 00 00 00 00 00", "081 # 00 00 11 00 00 00 00 00",
                                    "081 # 00 00 00 00 00 00 00 00"}));
}

}  // namespace
}  // namespace canopen_emergency_test
}  // namespace servodrome::canopen::test
