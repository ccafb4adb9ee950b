// Frames that wait because the bus is not available: of frames that are sent repeatedly, only the newest one is kept.
#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_waiting_test {
namespace {

constexpr const char* start = "000 # 01 01";
constexpr const char* pre_operational = "000 # 80 01";
constexpr const char* stop = "000 # 02 01";

// Operational, TPDO 1 with the statusword, TPDO 2 with the mode; no frame waits.
auto operational_device(const Profile& profile = {}) {
  auto device = make_device<>(profile);
  device->start();
  device->map(0x1800, {0x60410010});
  device->map(0x1801, {0x60610008});
  device->send(start);
  return device;
}

// A frame arrives while the bus accepts no frame.
template <typename Device>
void hear(Device& device, const char* frame) {
  device.node.receive(frame_of(frame), device.now);
}

template <typename Device>
void change_status(Device& device, unsigned from, unsigned to) {
  for (unsigned value = from; value <= to; ++value) {
    device.objects.statusword = static_cast<std::uint16_t>(value);
    device.now += 1ms;
    device.node.poll(device.now);
    device.node.process_image_updated(device.now);
  }
}

TEST(WaitingFrames, ATpdoTakesItsNewestValue) {
  auto device = operational_device();
  change_status(*device, 1, 200);
  EXPECT_EQ(device->sent(), (Frames{"181 # C8 00"}));
  change_status(*device, 201, 201);
  EXPECT_EQ(device->sent(), (Frames{"181 # C9 00"})) << "and none is missed";
}

TEST(WaitingFrames, ATpdoKeepsItsPlaceAndTheOthersTheirOrder) {
  auto device = operational_device();
  change_status(*device, 1, 1);
  device->node.raise(0x2310, 2);
  device->objects.modes_of_operation_display = 1;
  change_status(*device, 2, 2);
  device->node.raise(0x7380, 0);
  device->objects.modes_of_operation_display = 3;
  change_status(*device, 3, 40);
  EXPECT_EQ(device->sent(),
            (Frames{"181 # 28 00", "081 # 10 23 03 00 00 00 00 00", "281 # 03", "081 # 80 73 03 00 00 00 00 00"}));
}

TEST(WaitingFrames, ATpdoOfASyncAndOfATimerWaitOnce) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010}, 1);
  device->map(0x1801, {0x60410010}, 254);
  device->map(0x1802, {0x60410010}, 253);
  ASSERT_EQ(device->write(0x1801, 5, 5, 2), AbortCode::none);
  device->send(start);
  for (unsigned i = 1; i <= 60; ++i) {
    change_status(*device, i, i);
    hear(*device, "080 #");
    hear(*device, "381 RTR 2");
  }
  EXPECT_EQ(device->sent(), (Frames{"281 # 3C 00", "181 # 3C 00", "381 # 3C 00"}));
}

// A PDO that no change triggers (because of its type or its mask) still has the present values when it gets onto the
// bus. Values that a SYNC sampled stay as sampled.
TEST(WaitingFrames, ATpdoOfATimerOrWithAMaskTakesItsNewestValue) {
  auto device = make_device<>(Profile{.type_255_sends_on_change = false});
  device->start();
  device->map(0x1800, {0x60410010}, 255);
  device->map(0x1801, {0x60410010}, 254);
  device->map(0x1802, {0x60410010}, 1);
  ASSERT_EQ(device->write(0x1800, 5, 10, 2), AbortCode::none);
  device->node.set_tpdo_change_mask(1, 0xFF00);
  hear(*device, start);
  device->objects.statusword = 0x0101;
  hear(*device, "080 #");
  change_status(*device, 0x0101, 0x010A);  // the timer, once
  change_status(*device, 0x010B, 0x0112);  // 8 ms later
  EXPECT_EQ(device->sent(), (Frames{"281 # 12 01", "381 # 01 01", "181 # 12 01"}));
  EXPECT_EQ(device->sent(), Frames{}) << "once";
  change_status(*device, 0x0113, 0x0113);
  EXPECT_EQ(device->sent(), Frames{}) << "no reason";
  change_status(*device, 0x0114, 0x0114);
  EXPECT_EQ(device->sent(), (Frames{"181 # 14 01"})) << "10 ms after the one before";
}

// A value that changes and changes back while the frame waits is not sent.
TEST(WaitingFrames, ATpdoOfATimerTakesAValueBack) {
  auto device = make_device<>(Profile{.type_255_sends_on_change = false});
  device->start();
  device->map(0x1800, {0x60410010}, 255);
  ASSERT_EQ(device->write(0x1800, 5, 10, 2), AbortCode::none);
  hear(*device, start);
  for (int i = 0; i < 11; ++i) change_status(*device, 11, 11);  // the timer, once
  change_status(*device, 12, 12);
  change_status(*device, 11, 11);
  EXPECT_EQ(device->sent(), (Frames{"181 # 0B 00"}));
}

TEST(WaitingFrames, TheInhibitTimeDoesNotKeepAnOldValueInTheQueue) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010});
  ASSERT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1800, 3, 1000, 2), AbortCode::none);  // 100 ms
  ASSERT_EQ(device->write(0x1800, 1, 0x00000181, 4), AbortCode::none);
  hear(*device, start);
  change_status(*device, 1, 20);
  EXPECT_EQ(device->sent(), (Frames{"181 # 14 00"}));
}

TEST(WaitingFrames, TheNmtStateDropsTpdos) {
  for (const char* const command : {pre_operational, stop}) {
    auto device = operational_device();
    change_status(*device, 1, 3);
    hear(*device, command);
    EXPECT_EQ(device->sent(), Frames{}) << command;
    device->objects.statusword = 9;
    EXPECT_EQ(device->send(start), (Frames{"181 # 09 00", "281 # 00"})) << "all of them, fresh";
  }
  for (const char* const command : {"000 # 81 01", "000 # 82 01"}) {
    auto device = operational_device();
    change_status(*device, 1, 3);
    device->node.raise(0x2310, 2);
    hear(*device, command);
    EXPECT_EQ(device->sent(), (Frames{"081 # 10 23 03 00 00 00 00 00", "701 # 00"})) << command;
  }
  // The state is left and entered again while the bus is not available: each message is sent once.
  auto device = operational_device();
  change_status(*device, 1, 3);
  for (int i = 0; i < 40; ++i) {
    hear(*device, pre_operational);
    hear(*device, start);
  }
  EXPECT_EQ(device->sent(), (Frames{"181 # 03 00", "281 # 00"}));
}

TEST(WaitingFrames, ALostMasterDropsTpdos) {
  auto device = operational_device();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0032, 4), AbortCode::none);
  device->send("77F # 05");
  change_status(*device, 1, 30);
  for (unsigned i = 0; i < 5; ++i) change_status(*device, 31, 40);
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  EXPECT_EQ(device->sent(), (Frames{"081 # 30 81 11 00 00 00 00 00"}));
}

TEST(WaitingFrames, ATpdoThatIsMadeInvalidIsDropped) {
  auto device = operational_device();
  change_status(*device, 1, 3);
  EXPECT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  EXPECT_EQ(device->others, Frames{});
  EXPECT_EQ(device->write(0x1800, 1, 0x000001A1, 4), AbortCode::none);
  EXPECT_EQ(device->others, (Frames{"1A1 # 03 00"}));
}

TEST(WaitingFrames, AnotherMappingOfAValidTpdoIsSentInsteadOfTheOld) {
  auto device = operational_device({.valid_pdo_may_be_remapped = true});
  change_status(*device, 1, 3);
  device->objects.modes_of_operation_display = 7;
  EXPECT_EQ(device->write(0x1A00, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(device->write(0x1A00, 1, 0x60610008, 4), AbortCode::none);
  change_status(*device, 4, 5);
  EXPECT_EQ(device->write(0x1A00, 0, 1, 1), AbortCode::none);
  EXPECT_EQ(device->others, (Frames{"281 # 07", "181 # 07"}));
}

TEST(WaitingFrames, OneHeartbeatWaitsWithTheNewestState) {
  auto device = operational_device();
  ASSERT_EQ(device->write(0x1017, 0, 10, 2), AbortCode::none);
  device->advance(25ms);
  change_status(*device, 1, 500);
  hear(*device, stop);
  change_status(*device, 501, 520);
  EXPECT_EQ(device->sent(), (Frames{"701 # 04"}));
  // A boot-up message does not count as a heartbeat: both are sent.
  hear(*device, "000 # 82 01");
  ASSERT_EQ(device->sent(), (Frames{"701 # 00"}));
  hear(*device, "000 # 82 01");
  device->dictionary.set_number(0x1017, 0, 10);
  change_status(*device, 1, 50);
  EXPECT_EQ(device->sent(), (Frames{"701 # 00", "701 # 7F"}));
}

TEST(WaitingFrames, OneSyncWaits) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1006, 0, 1000, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1005, 0, 0x40000080, 4), AbortCode::none);
  change_status(*device, 1, 100);
  EXPECT_EQ(device->sent(), (Frames{"080 #"}));
}

// An error message is kept for any duration of the outage.
TEST(WaitingFrames, NothingCyclicKeepsAnErrorOut) {
  auto device = operational_device();
  ASSERT_EQ(device->write(0x1017, 0, 2, 2), AbortCode::none);
  change_status(*device, 1, 2000);
  device->node.raise(0x2310, 2);
  change_status(*device, 1, 2000);
  const Frames frames = device->sent();
  EXPECT_EQ(frames, (Frames{"701 # 05", "181 # D0 07", "081 # 10 23 03 00 00 00 00 00"}));
}

TEST(WaitingFrames, BusOffLosesNoChange) {
  auto device = operational_device();
  ASSERT_EQ(device->write(0x1029, 1, 1, 1), AbortCode::none);  // stays operational
  device->sent();
  change_status(*device, 1, 3);
  device->node.bus_state(BusState::bus_off, device->now);
  EXPECT_EQ(device->sent(), Frames{});
  device->node.bus_state(BusState::error_active, device->now);
  device->now += 1ms;
  device->node.poll(device->now);
  EXPECT_EQ(device->sent(), (Frames{"081 # 40 81 11 00 00 00 00 00", "081 # 00 00 00 00 00 00 00 00", "181 # 03 00"}));
}

}  // namespace
}  // namespace canopen_waiting_test
}  // namespace servodrome::canopen::test
