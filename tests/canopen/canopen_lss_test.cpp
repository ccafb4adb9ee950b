#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_lss_test {
namespace {

std::string lss(std::uint8_t command, std::uint32_t number) {
  Frame frame;
  frame.id = 0x7E5;
  frame.length = 8;
  frame.data[0] = command;
  std::memcpy(&frame.data[1], &number, 4);
  return text_of(frame);
}

constexpr std::array<std::uint32_t, 4> address = {0x319, 0x10002, 0x30004, 0xCAFE1234};

Frames select(TestDevice<>& device) {
  for (std::uint8_t part = 0; part < 3; ++part) {
    EXPECT_EQ(device.send(lss(static_cast<std::uint8_t>(64 + part), address[part])), Frames{});
  }
  return device.send(lss(67, address[3]));
}

TEST(Lss, WithoutNodeIdOnlyLssAnswers) {
  auto device = make_device<>({}, unconfigured_node_id);
  EXPECT_EQ(device->start(unconfigured_node_id), Frames{});
  EXPECT_EQ(device->node.nmt_state(), NmtState::initialising);
  for (const char* frame : {"000 # 01 00", "6FF # 40 00 10 00 00 00 00 00", "7FF RTR 1", "080 #", "000 # 81 00"}) {
    EXPECT_EQ(device->send(frame), Frames{}) << frame;
  }
  EXPECT_EQ(device->advance(10s), Frames{});
  EXPECT_EQ(device->send("7E5 # 4C 00 00 00 00 00 00 00"), (Frames{"7E4 # 50 00 00 00 00 00 00 00"}));
}

TEST(Lss, FullDialogue) {
  auto device = make_device<>({}, unconfigured_node_id);
  device->start(unconfigured_node_id);
  EXPECT_EQ(device->send("7E5 # 11 05 00 00 00 00 00 00"), Frames{}) << "not in configuration";
  EXPECT_EQ(select(*device), (Frames{"7E4 # 44 00 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 5A 00 00 00 00 00 00 00"), (Frames{"7E4 # 5A 19 03 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 5B 00 00 00 00 00 00 00"), (Frames{"7E4 # 5B 02 00 01 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 5C 00 00 00 00 00 00 00"), (Frames{"7E4 # 5C 04 00 03 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 5D 00 00 00 00 00 00 00"), (Frames{"7E4 # 5D 34 12 FE CA 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), (Frames{"7E4 # 5E FF 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 11 00 00 00 00 00 00 00"), (Frames{"7E4 # 11 01 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 11 80 00 00 00 00 00 00"), (Frames{"7E4 # 11 01 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 11 05 00 00 00 00 00 00"), (Frames{"7E4 # 11 00 00 00 00 00 00 00"}));
  device->events.bit_timings[2] = true;
  EXPECT_EQ(device->send("7E5 # 13 00 05 00 00 00 00 00"), (Frames{"7E4 # 13 01 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 13 01 02 00 00 00 00 00"), (Frames{"7E4 # 13 01 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 13 00 02 00 00 00 00 00"), (Frames{"7E4 # 13 00 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 17 00 00 00 00 00 00 00"), (Frames{"7E4 # 17 00 00 00 00 00 00 00"}));
  EXPECT_TRUE(device->events.saw("lss store 5 2"));
  device->events.lss_answer = LssStore::failed;
  EXPECT_EQ(device->send("7E5 # 17 00 00 00 00 00 00 00"), (Frames{"7E4 # 17 02 00 00 00 00 00 00"}));
  device->objects.communication.sdo_cob_id_client_to_server = 0x605;
  device->objects.communication.sdo_cob_id_server_to_client = 0x585;
  EXPECT_EQ(device->send("7E5 # 04 00 00 00 00 00 00 00"), (Frames{"705 # 00"})) << "boots with its node-ID";
  EXPECT_TRUE(device->events.saw("reset 130 1 5"));
  EXPECT_EQ(device->send("605 # 40 61 60 00 00 00 00 00"), (Frames{"585 # 4F 61 60 00 00 00 00 00"}));
}

TEST(Lss, ConfiguredNodeKeepsItsIdUntilReset) {
  auto device = make_device();
  device->start();
  device->send("7E5 # 04 01 00 00 00 00 00 00");
  EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), (Frames{"7E4 # 5E 01 00 00 00 00 00 00"}));
  device->send("7E5 # 11 07 00 00 00 00 00 00");
  EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), (Frames{"7E4 # 5E 01 00 00 00 00 00 00"}));
  EXPECT_EQ(device->send("7E5 # 04 00 00 00 00 00 00 00"), Frames{});
  EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), Frames{}) << "waiting";
  EXPECT_EQ(device->send("7E5 # 4C 00 00 00 00 00 00 00"), Frames{}) << "it has a node-ID";
  EXPECT_EQ(device->send("000 # 82 01"), (Frames{"707 # 00"}));
}

TEST(Lss, SelectiveNeedsTheWholeAddressInOrder) {
  for (std::uint8_t wrong = 0; wrong < 4; ++wrong) {
    auto device = make_device();
    device->start();
    for (std::uint8_t part = 0; part < 4; ++part) {
      const std::uint32_t number = address[part] + (part == wrong ? 1 : 0);
      EXPECT_EQ(device->send(lss(static_cast<std::uint8_t>(64 + part), number)), Frames{});
    }
    EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), Frames{});
    EXPECT_EQ(device->send(lss(67, address[3])), Frames{}) << "the last alone";
    EXPECT_EQ(select(*device), (Frames{"7E4 # 44 00 00 00 00 00 00 00"}));
  }
}

TEST(Lss, IdentifyRemoteByRanges) {
  struct Case {
    std::array<std::uint32_t, 6> parts;  // vendor, product, revision low, high, serial low, high
    bool answers;
  };
  const Case cases[] = {
      {{0x319, 0x10002, 0x30004, 0x30004, 0xCAFE1234, 0xCAFE1234}, true},
      {{0x319, 0x10002, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF}, true},
      {{0x31A, 0x10002, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF}, false},
      {{0x319, 0x10003, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF}, false},
      {{0x319, 0x10002, 0x30005, 0xFFFFFFFF, 0, 0xFFFFFFFF}, false},
      {{0x319, 0x10002, 0, 0x30003, 0, 0xFFFFFFFF}, false},
      {{0x319, 0x10002, 0, 0xFFFFFFFF, 0xCAFE1235, 0xFFFFFFFF}, false},
      {{0x319, 0x10002, 0, 0xFFFFFFFF, 0, 0xCAFE1233}, false},
  };
  auto device = make_device();
  device->start();
  for (const Case& one : cases) {
    Frames answers;
    for (std::uint8_t i = 0; i < 6; ++i) answers = device->send(lss(static_cast<std::uint8_t>(70 + i), one.parts[i]));
    EXPECT_EQ(answers, one.answers ? (Frames{"7E4 # 4F 00 00 00 00 00 00 00"}) : Frames{});
  }
}

// The master's side of fastscan: it finds every bit of the address from the answers alone.
TEST(Lss, Fastscan) {
  auto device = make_device<>({}, unconfigured_node_id);
  device->start(unconfigured_node_id);
  const auto scan = [&](std::uint32_t number, std::uint8_t bit, std::uint8_t sub, std::uint8_t next) {
    Frame frame = frame_of(lss(81, number));
    frame.data[5] = bit;
    frame.data[6] = sub;
    frame.data[7] = next;
    const Frames answers = device->send(frame);
    if (!answers.empty()) {
      EXPECT_EQ(answers, (Frames{"7E4 # 4F 00 00 00 00 00 00 00"}));
    }
    return !answers.empty();
  };
  ASSERT_TRUE(scan(0, 0x80, 0, 0));
  std::array<std::uint32_t, 4> found{};
  for (std::uint8_t sub = 0; sub < 4; ++sub) {
    for (int bit = 31; bit >= 0; --bit) {
      if (!scan(found[sub], static_cast<std::uint8_t>(bit), sub, sub)) found[sub] |= 1U << bit;
    }
    ASSERT_TRUE(scan(found[sub], 0, sub, static_cast<std::uint8_t>((sub + 1) % 4)));
  }
  EXPECT_EQ(found, address);
  EXPECT_EQ(device->send("7E5 # 11 05 00 00 00 00 00 00"), (Frames{"7E4 # 11 00 00 00 00 00 00 00"}));
  EXPECT_FALSE(scan(0, 0x80, 0, 0)) << "it has a node-ID to come";
}

TEST(Lss, NodesWithIdDoNotAnswerFastscan) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->send("7E5 # 51 00 00 00 00 80 00 00"), Frames{});
}

TEST(Lss, ActivateBitTimingKeepsSilent) {
  auto device = make_device();
  device->objects.communication.producer_heartbeat_time_ms = 10;
  device->start();
  device->events.bit_timings[0] = true;
  device->send("7E5 # 04 01 00 00 00 00 00 00");
  EXPECT_EQ(device->send("7E5 # 15 64 00 00 00 00 00 00"), Frames{});
  EXPECT_FALSE(device->events.saw("lss activate 0 100")) << "nothing was configured";
  device->send("7E5 # 13 00 00 00 00 00 00 00");
  device->send("7E5 # 15 64 00 00 00 00 00 00");
  EXPECT_TRUE(device->events.saw("lss activate 0 100"));
  EXPECT_EQ(device->advance(199ms), Frames{});
  EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00"), Frames{});
  EXPECT_EQ(device->advance(1ms), (Frames{"701 # 7F"}));
  EXPECT_EQ(device->advance(10ms), (Frames{"701 # 7F"}));
}

TEST(Lss, NotOffered) {
  auto device = make_device<>({.lss = false});
  device->start();
  device->send("7E5 # 04 01 00 00 00 00 00 00");
  EXPECT_EQ(device->send("7E5 # 5E 00 00 00 00 00 00 00"), Frames{});
}

}  // namespace
}  // namespace canopen_lss_test
}  // namespace servodrome::canopen::test
