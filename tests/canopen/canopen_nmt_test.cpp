#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_nmt_test {
namespace {

TEST(Nmt, BootsIntoPreOperational) {
  auto device = make_device();
  EXPECT_EQ(device->start(), (Frames{"701 # 00"}));
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  EXPECT_EQ(device->events.log, (Frames{"nmt 0", "nmt 127"}));
}

TEST(Nmt, StartsByItselfIfTheProductDoes) {
  auto device = make_device<>({.starts_operational = true});
  EXPECT_EQ(device->start(), (Frames{"701 # 00"}));
  EXPECT_EQ(device->node.nmt_state(), NmtState::operational);
}

TEST(Nmt, EveryCommandFromEveryState) {
  struct Case {
    const char* command;
    NmtState result;
    bool boots;
  };
  const Case commands[] = {{"000 # 01 01", NmtState::operational, false},
                           {"000 # 02 01", NmtState::stopped, false},
                           {"000 # 80 01", NmtState::pre_operational, false},
                           {"000 # 81 01", NmtState::pre_operational, true},
                           {"000 # 82 01", NmtState::pre_operational, true}};
  for (const Case& first : commands) {
    for (const Case& second : commands) {
      auto device = make_device();
      device->start();
      device->send(first.command);
      ASSERT_EQ(device->node.nmt_state(), first.result);
      EXPECT_EQ(device->send(second.command), second.boots ? Frames{"701 # 00"} : Frames{});
      EXPECT_EQ(device->node.nmt_state(), second.result) << first.command << ", " << second.command;
    }
  }
}

TEST(Nmt, CommandsAreForThisNodeOrAll) {
  auto device = make_device();
  device->start();
  for (const char* ignored :
       {"000 # 01 02", "000 # 01", "000 # 01 01 00", "000 # 03 01", "000 # 00 01", "000 RTR 2", "000 #"}) {
    device->send(ignored);
    EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational) << ignored;
  }
  Frame extended = frame_of("000 # 01 01");
  extended.extended = true;
  device->send(extended);
  EXPECT_EQ(device->node.nmt_state(), NmtState::pre_operational);
  device->send("000 # 01 00");
  EXPECT_EQ(device->node.nmt_state(), NmtState::operational);
}

// CiA 301 table 37; the matrix of ISMC manual, ch. 2.4.1.
TEST(Nmt, ServicesOfEachState) {
  struct State {
    const char* command;
    bool pdo, sdo, sync, emergency, time, error_control;
  };
  const State states[] = {{"000 # 80 01", false, true, true, true, true, true},
                          {"000 # 01 01", true, true, true, true, true, true},
                          {"000 # 02 01", false, false, false, false, false, true}};
  for (const State& state : states) {
    SCOPED_TRACE(state.command);
    auto device = make_device();
    device->start();
    device->map(0x1400, {0x60400010});
    device->map(0x1800, {0x60410010}, 1);
    device->send(state.command);
    device->events.log.clear();
    device->send("201 # 34 12");
    EXPECT_EQ(device->objects.controlword, state.pdo ? 0x1234 : 0);
    EXPECT_EQ(device->send("080 #").size(), state.pdo ? 1U : 0U);
    EXPECT_EQ(device->events.saw("sync 0"), state.sync);
    EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00").size(), state.sdo ? 1U : 0U);
    EXPECT_EQ(device->send("181 RTR 2").size(), state.pdo ? 1U : 0U);
    device->node.raise(0x2310, 0x02, {});
    EXPECT_EQ(device->sent().size(), state.emergency ? 1U : 0U);
    device->send("100 # 01 00 00 00 02 00");
    EXPECT_EQ(device->events.saw("time 1 2"), state.time);
    EXPECT_EQ(device->send("701 RTR 1").size(), state.error_control ? 1U : 0U);
  }
}

TEST(Nmt, StoppingDropsATransfer) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->send("601 # 40 08 10 00 00 00 00 00").size(), 1U);
  device->send("000 # 02 01");
  EXPECT_EQ(device->advance(10s), Frames{}) << "no timeout abort in stopped";
  device->send("601 # 40 08 10 00 00 00 00 00");
  device->send("000 # 80 01");
  EXPECT_EQ(device->send("601 # 60 00 00 00 00 00 00 00"), (Frames{"581 # 80 08 10 00 01 00 04 05"}));
}

TEST(Nmt, ResetsNameTheAreasToRestore) {
  auto device = make_device();
  device->start();
  device->events.log.clear();
  device->send("000 # 81 01");
  EXPECT_EQ(device->events.log, (Frames{"nmt 0", "reset 129 15 1", "nmt 127"}));
  device->events.log.clear();
  device->send("000 # 82 01");
  EXPECT_EQ(device->events.log, (Frames{"nmt 0", "reset 130 1 1", "nmt 127"}));
}

TEST(Nmt, ProductsChooseWhatAResetRestores) {
  // ISMC manual, ch. 2.4.1; ESTUN manual, ch. 9.2 keeps the PDO configuration over reset communication.
  using dictionary::Area;
  auto device = make_device<>(
      {.reset_node_restores = Area::manufacturer | Area::profile, .reset_communication_restores = Area{}});
  device->start();
  device->send("000 # 81 01");
  EXPECT_TRUE(device->events.saw("reset 129 6 1"));
  device->send("000 # 82 01");
  EXPECT_TRUE(device->events.saw("reset 130 0 1"));
}

TEST(Nmt, ResetReadsTheConfigurationAgain) {
  auto device = make_device();
  device->start();
  device->objects.communication.producer_heartbeat_time_ms = 10;  // as restored by the device
  EXPECT_EQ(device->advance(100ms), Frames{});
  device->send("000 # 82 01");
  EXPECT_EQ(device->advance(10ms), (Frames{"701 # 7F"}));
}

TEST(Nmt, NodeIdChangesWithReset) {
  auto device = make_device();
  device->start();
  device->node.set_pending_node_id(5);
  EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00").size(), 1U);
  device->objects.communication.sdo_cob_id_client_to_server = 0x605;
  device->objects.communication.sdo_cob_id_server_to_client = 0x585;
  EXPECT_EQ(device->send("000 # 82 01"), (Frames{"705 # 00"}));
  EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00"), Frames{});
  EXPECT_EQ(device->send("605 # 40 61 60 00 00 00 00 00"), (Frames{"585 # 4F 61 60 00 00 00 00 00"}));
  EXPECT_TRUE(device->events.saw("reset 130 1 5"));
}

TEST(Storage, SignaturesAndAreas) {
  auto device = make_device();
  device->start();
  constexpr std::uint32_t save = 0x65766173;
  constexpr std::uint32_t load = 0x64616F6C;
  EXPECT_EQ(device->send("601 # 40 10 10 01 00 00 00 00"), (Frames{"581 # 43 10 10 01 01 00 00 00"}));
  EXPECT_EQ(device->write(0x1010, 1, load, 4), AbortCode::cannot_transfer_or_store);
  EXPECT_EQ(device->write(0x1011, 1, save, 4), AbortCode::cannot_transfer_or_store);
  device->events.log.clear();
  const Frames areas = {"15", "1", "12", "2"};
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    EXPECT_EQ(device->write(0x1010, sub, save, 4), AbortCode::none);
    EXPECT_EQ(device->events.log.back(), "store " + areas[sub - 1U]);
    EXPECT_EQ(device->write(0x1011, sub, load, 4), AbortCode::none);
    EXPECT_EQ(device->events.log.back(), "restore " + areas[sub - 1U]);
  }
  device->events.store_answer = AbortCode::hardware_error;
  EXPECT_EQ(device->write(0x1010, 1, save, 4), AbortCode::hardware_error);
}

// CiA 301 7.5.2.23: a changed configuration no longer counts as verified.
TEST(VerifyConfiguration, ForgottenWithAnyOtherChange) {
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1020, 1, 0x1234, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1020, 2, 0x5678, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x6040, 0, 6, 2), AbortCode::none);
  EXPECT_EQ(device->objects.communication.configuration_date, 0x1234U) << "a controlword is no configuration";
  EXPECT_EQ(device->objects.communication.configuration_time, 0x5678U);
  EXPECT_EQ(device->write(0x1029, 1, 9, 1), AbortCode::value_invalid);
  EXPECT_EQ(device->objects.communication.configuration_date, 0x1234U) << "refused, so unchanged";
  ASSERT_EQ(device->write(0x1029, 1, 1, 1), AbortCode::none);
  EXPECT_EQ(device->objects.communication.configuration_date, 0U);
  EXPECT_EQ(device->objects.communication.configuration_time, 0U);
}

}  // namespace
}  // namespace canopen_nmt_test
}  // namespace servodrome::canopen::test
