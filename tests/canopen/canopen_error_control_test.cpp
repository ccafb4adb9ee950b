#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_error_control_test {
namespace {

constexpr const char* lost_8130 = "081 # 30 81 11 00 00 00 00 00";
constexpr const char* no_error = "081 # 00 00 00 00 00 00 00 00";

// ---- heartbeat producer ----

TEST(Heartbeat, CarriesTheState) {
  auto device = make_device();
  device->objects.communication.producer_heartbeat_time_ms = 100;
  EXPECT_EQ(device->start(), (Frames{"701 # 00"}));
  EXPECT_EQ(device->advance(100ms - 1ns), Frames{});
  EXPECT_EQ(device->advance(1ns), (Frames{"701 # 7F"}));
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(100ms), (Frames{"701 # 05"}));
  device->send("000 # 02 01");
  EXPECT_EQ(device->advance(200ms), (Frames{"701 # 04", "701 # 04"}));
}

TEST(Heartbeat, BeginsAndEndsWithTheObject) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->advance(1s), Frames{});
  ASSERT_EQ(device->write(0x1017, 0, 50, 2), AbortCode::none);
  EXPECT_EQ(device->advance(100ms), (Frames{"701 # 7F", "701 # 7F", "701 # 7F"})) << "at once, then each 50 ms";
  ASSERT_EQ(device->write(0x1017, 0, 0, 2), AbortCode::none);
  EXPECT_EQ(device->advance(1s), Frames{});
}

// ---- node guarding ----

TEST(NodeGuarding, TogglesFromZero) {
  // ISMC manual, ch. 2.4.2
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 7F"}));
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # FF"}));
  device->send("000 # 01 01");
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 05"}));
  device->send("000 # 02 01");
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 84"}));
  EXPECT_EQ(device->send("702 RTR 1"), Frames{});
  device->send("701 RTR 1");
  device->send("000 # 82 01");
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 7F"})) << "0 again after a reset";
}

TEST(NodeGuarding, BesideTheHeartbeat) {
  struct Case {
    NodeGuarding rule;
    unsigned without_heartbeat, with_heartbeat;
  };
  for (const Case& one : {Case{NodeGuarding::absent, 0, 0}, Case{NodeGuarding::heartbeat_wins, 1, 0},
                          Case{NodeGuarding::simultaneous, 1, 1}}) {
    auto device = make_device<>({.node_guarding = one.rule});
    device->start();
    EXPECT_EQ(device->send("701 RTR 1").size(), one.without_heartbeat);
    ASSERT_EQ(device->write(0x1017, 0, 1000, 2), AbortCode::none);
    device->advance(1ms);
    EXPECT_EQ(device->send("701 RTR 1").size(), one.with_heartbeat);
  }
}

TEST(LifeGuarding, LossAndReturnOfTheMaster) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x100C, 0, 100, 2), AbortCode::none);
  ASSERT_EQ(device->write(0x100D, 0, 3, 1), AbortCode::none);
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(10s), Frames{}) << "begins with the first request";
  device->send("701 RTR 1");
  device->advance(200ms);
  device->send("701 RTR 1");
  EXPECT_EQ(device->advance(300ms - 1ns), Frames{});
  EXPECT_EQ(device->advance(1ns), (Frames{lost_8130}));
  EXPECT_TRUE(device->events.saw("lost 0 33072 0"));
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  EXPECT_EQ(device->advance(10s), Frames{}) << "told once";
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 7F", no_error}));
  EXPECT_TRUE(device->events.saw("restored 0"));
}

TEST(LifeGuarding, IsLostOnceHoweverOftenTheNodeIsPolled) {
  auto device = make_device<>({.node_guarding = NodeGuarding::simultaneous});
  device->start();
  ASSERT_EQ(device->write(0x100C, 0, 100, 2), AbortCode::none);
  ASSERT_EQ(device->write(0x100D, 0, 1, 1), AbortCode::none);
  ASSERT_EQ(device->write(0x1017, 0, 60, 2), AbortCode::none);
  device->send("701 RTR 1");
  unsigned emergencies = 0;
  for (const std::string& frame : device->advance(10s)) emergencies += frame == lost_8130 ? 1U : 0U;
  EXPECT_EQ(emergencies, 1U);
}

// A reset clears the state "lost": the first request after it must not report "connection restored".
TEST(LifeGuarding, AResetBeginsAnew) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x100C, 0, 100, 2), AbortCode::none);
  ASSERT_EQ(device->write(0x100D, 0, 1, 1), AbortCode::none);
  device->send("701 RTR 1");
  EXPECT_EQ(device->advance(100ms), (Frames{lost_8130}));
  device->send("000 # 82 01");
  device->events.log.clear();
  EXPECT_EQ(device->send("701 RTR 1"), (Frames{"701 # 7F"}));
  EXPECT_FALSE(device->events.saw("restored 0"));
}

// Writing its objects again does not end a life guarding that is active.
TEST(LifeGuarding, GoesOnWhenItsTimeIsWrittenAgain) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x100C, 0, 100, 2), AbortCode::none);
  ASSERT_EQ(device->write(0x100D, 0, 3, 1), AbortCode::none);
  device->send("701 RTR 1");
  ASSERT_EQ(device->write(0x100D, 0, 3, 1), AbortCode::none);
  EXPECT_EQ(device->advance(299ms), Frames{});
  EXPECT_EQ(device->advance(2ms), (Frames{lost_8130}));
}

// CiA 301 7.2.8.2.2.1: a shorter time acts while the old one runs.
TEST(LifeGuarding, ShorterTimeActsAtOnce) {
  for (const bool by_factor : {false, true}) {
    auto device = make_device();
    device->start();
    ASSERT_EQ(device->write(0x100C, 0, 100, 2), AbortCode::none);
    ASSERT_EQ(device->write(0x100D, 0, 200, 1), AbortCode::none);
    device->send("701 RTR 1");
    device->advance(10ms);
    ASSERT_EQ(by_factor ? device->write(0x100D, 0, 2, 1) : device->write(0x100C, 0, 1, 2), AbortCode::none);
    EXPECT_EQ(device->advance(200ms - 1ns), Frames{});
    EXPECT_EQ(device->advance(1ns), (Frames{lost_8130}));
  }
}

TEST(LifeGuarding, NeedsBothObjects) {
  for (const auto& [time, factor] : {std::pair{0U, 3U}, std::pair{100U, 0U}}) {
    auto device = make_device();
    device->start();
    ASSERT_EQ(device->write(0x100C, 0, time, 2), AbortCode::none);
    ASSERT_EQ(device->write(0x100D, 0, factor, 1), AbortCode::none);
    device->send("701 RTR 1");
    EXPECT_EQ(device->advance(100s), Frames{});
  }
}

// ---- heartbeat consumer ----

TEST(HeartbeatConsumer, SeveralNodes) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);  // node 127, 100 ms
  ASSERT_EQ(device->write(0x1016, 2, 0x000500C8, 4), AbortCode::none);  // node 5, 200 ms
  EXPECT_EQ(device->write(0x1016, 3, 0x00050064, 4), AbortCode::parameter_incompatible) << "node 5 again";
  EXPECT_EQ(device->write(0x1016, 2, 0x000500C9, 4), AbortCode::none) << "the same entry";
  EXPECT_EQ(device->write(0x1016, 3, 0x00050000, 4), AbortCode::none) << "no time, no consumer";
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(10s), Frames{}) << "begins with the first heartbeat";
  device->events.log.clear();
  device->send("77F # 05");
  device->send("705 # 7F");
  EXPECT_EQ(device->events.log, (Frames{"heartbeat 127 5", "heartbeat 5 127"}));
  device->advance(99ms);
  device->send("77F # 05");
  EXPECT_EQ(device->events.log.size(), 2U) << "no news";
  EXPECT_EQ(device->advance(100ms), (Frames{lost_8130}));
  EXPECT_TRUE(device->events.saw("lost 1 33072 0"));
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  EXPECT_EQ(device->send("77F # 00"), (Frames{no_error}));
  EXPECT_TRUE(device->events.saw("restored 1"));
  EXPECT_TRUE(device->events.saw("heartbeat 127 0"));
}

TEST(HeartbeatConsumer, ALossEndsWithItsMonitoring) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  device->send("77F # 05");
  EXPECT_EQ(device->advance(100ms), (Frames{lost_8130}));
  EXPECT_FALSE(device->events.saw("restored 1"));
  ASSERT_EQ(device->write(0x1016, 1, 0, 4), AbortCode::none);
  EXPECT_EQ(device->others, (Frames{no_error}));
  EXPECT_TRUE(device->events.saw("restored 1"));
}

TEST(HeartbeatConsumer, ABrokenCommandIsNoHeartbeat) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  device->send("77F # 05");
  device->advance(60ms);
  device->send("000 # 05");  // NMT commands have two bytes
  device->advance(40ms);
  EXPECT_TRUE(device->events.saw("lost 1 33072 0"));
}

TEST(HeartbeatConsumer, RewritingTheEntryEndsTheError) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  device->send("77F # 05");
  EXPECT_EQ(device->advance(100ms), (Frames{lost_8130}));
  ASSERT_EQ(device->write(0x1016, 1, 0, 4), AbortCode::none);
  EXPECT_EQ(device->others, (Frames{no_error}));
}

// From any node, including the first and the last.
TEST(HeartbeatConsumer, FirstAndLastNode) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x00010064, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1016, 2, 0x007F0064, 4), AbortCode::none);
  device->events.log.clear();
  device->send("701 # 05");
  device->send("77F # 05");
  EXPECT_EQ(device->events.log, (Frames{"heartbeat 1 5", "heartbeat 127 5"}));
}

// A reset clears all received heartbeats: the supervision starts again at the first heartbeat.
TEST(HeartbeatConsumer, AResetBeginsAnew) {
  for (const char* const reset : {"000 # 81 01", "000 # 82 01"}) {
    auto device = make_device();
    device->start();
    ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
    device->send("77F # 05");
    device->send(reset);
    EXPECT_EQ(device->advance(1s), Frames{}) << reset;
    device->events.log.clear();
    device->send("77F # 05");
    EXPECT_EQ(device->events.log, (Frames{"heartbeat 127 5"})) << "heard for the first time";
    EXPECT_EQ(device->advance(100ms), (Frames{lost_8130})) << "the entry is still there";
  }
}

TEST(HeartbeatConsumer, TheErrorLastsUntilAllAreBack) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1016, 2, 0x00050064, 4), AbortCode::none);
  device->send("77F # 05");
  device->send("705 # 05");
  EXPECT_EQ(device->advance(100ms), (Frames{lost_8130, lost_8130}));
  EXPECT_EQ(device->send("77F # 05"), Frames{});
  EXPECT_EQ(device->node.error_register(), 0x11);
  EXPECT_EQ(device->send("705 # 05"), (Frames{no_error}));
}

TEST(HeartbeatConsumer, FrameAtTheVeryDeadlineCounts) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  device->send("77F # 05");
  device->now += 100ms;
  EXPECT_EQ(device->send("77F # 05"), Frames{});
  device->now += 100ms + 1ns;
  EXPECT_EQ(device->send("77F # 05"), (Frames{lost_8130, no_error})) << "late, though nobody polled";
}

// ---- reaction ----

TEST(ErrorBehaviour, Object1029) {
  struct Case {
    std::uint32_t value;
    const char* state_before;
    NmtState after;
  };
  const Case cases[] = {{0, "000 # 01 01", NmtState::pre_operational}, {1, "000 # 01 01", NmtState::operational},
                        {2, "000 # 01 01", NmtState::stopped},         {0, "000 # 02 01", NmtState::stopped},
                        {2, "000 # 80 01", NmtState::stopped},         {0, "000 # 80 01", NmtState::pre_operational}};
  for (const Case& one : cases) {
    auto device = make_device();
    device->start();
    ASSERT_EQ(device->write(0x1029, 1, one.value, 1), AbortCode::none);
    ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
    device->send(one.state_before);
    device->send("77F # 05");
    device->advance(100ms);
    EXPECT_EQ(device->node.nmt_state(), one.after) << one.value << one.state_before;
  }
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1029, 1, 3, 1), AbortCode::value_invalid);
}

TEST(ErrorBehaviour, TheDeviceMayDecideOtherwise) {
  // Kinco manual, Table 9-26: 6007h = 0 ignores the loss, 1 raises EMCY 8100h.
  for (const std::uint16_t code : {std::uint16_t{0}, std::uint16_t{0x8100}}) {
    LossReaction reaction{code, ErrorBehaviour::no_change};
    auto device = make_device();
    device->events.override_reaction = &reaction;
    device->start();
    ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
    device->send("000 # 01 01");
    device->send("77F # 05");
    EXPECT_EQ(device->advance(100ms), code == 0 ? Frames{} : (Frames{"081 # 00 81 11 00 00 00 00 00"}));
    EXPECT_EQ(device->node.nmt_state(), NmtState::operational);
    EXPECT_EQ(device->send("77F # 05").size(), code == 0 ? 0U : 1U);
  }
}

TEST(ErrorBehaviour, ErrorsMayLatch) {
  auto device = make_device<>({.errors_clear_on_restored_communication = false});
  device->start();
  ASSERT_EQ(device->write(0x1016, 1, 0x007F0064, 4), AbortCode::none);
  device->send("77F # 05");
  device->advance(100ms);
  EXPECT_EQ(device->send("77F # 05"), Frames{});
  EXPECT_EQ(device->node.error_register(), 0x11);
  device->send("000 # 82 01");
  EXPECT_EQ(device->node.error_register(), 0);
}

}  // namespace
}  // namespace canopen_error_control_test
}  // namespace servodrome::canopen::test
