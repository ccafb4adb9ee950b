#include "master/canopen/sdo_client.hpp"

#include <algorithm>
#include <gmock/gmock.h>

#include "can_line.hpp"

namespace servodrome::master::test {
namespace sdo_client_test {
namespace {

std::vector<std::byte> pattern(std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(i * 37 + i / 251);
  return bytes;
}

std::vector<std::byte> content_of(const dictionary::Blob<6000>& blob) {
  const auto bytes = std::as_bytes(std::span(blob.bytes)).first(blob.length);
  return {bytes.begin(), bytes.end()};
}

class SdoClientTest : public ::testing::Test {
 protected:
  CanLine line;
  CanLine::Device& device = line.add(5);
  SdoClient client{line.bus, 5};
  canopen::test::Frames seen;
  Bus::Subscription listening = line.bus.listen([this](const Frame& frame) { seen.push_back(text_of(frame)); });

  template <typename Call>
  SdoError error_of(Call call) {
    try {
      call();
    } catch (const SdoError& error) {
      return error;
    }
    ADD_FAILURE() << "no SdoError";
    return SdoError("", 0, {}, true, AbortCode::none, false);
  }

  // Reads the statusword while these frames arrive at once, as answers that are late.
  std::uint16_t statusword_after(std::initializer_list<const char*> late, SdoClient& reader) {
    bool sent = false;
    const Bus::Subscription intruder = line.bus.every(1us, [&] {
      if (std::exchange(sent, true)) return;
      for (const char* text : late) line.intrude(frame_of(text));
    });
    const auto word = reader.read<std::uint16_t>(0x6041);
    EXPECT_TRUE(sent);
    return word;
  }
};

TEST_F(SdoClientTest, ExpeditedOfEverySize) {
  client.write<std::int8_t>(0x6060, 0, -3);
  EXPECT_EQ(device.objects.modes_of_operation, -3);
  EXPECT_EQ(client.read<std::int8_t>(0x6060), -3);
  client.write<std::uint16_t>(0x6040, 0, 0x1234);
  EXPECT_EQ(client.read<std::uint16_t>(0x6040), 0x1234);
  client.write<std::int32_t>(0x607A, 0, -2'000'000'000);
  EXPECT_EQ(client.read<std::int32_t>(0x607A), -2'000'000'000);
  EXPECT_EQ(seen.back(), "585 # 43 7A 60 00 00 6C CA 88");
  EXPECT_EQ(client.read<std::uint32_t>(0x2008), canopen::test::constant_value);
}

TEST_F(SdoClientTest, ShortValuesAreExtendedLongOnesRefused) {
  client.write<std::int8_t>(0x6060, 0, -3);
  EXPECT_EQ(client.read<std::int32_t>(0x6060), -3);
  EXPECT_EQ(client.read<std::uint32_t>(0x6060), 0xFDU);
  EXPECT_THROW(client.read<std::int16_t>(0x607A), MasterError);
}

// A server with the "size indicated" bit cleared: the client takes as many bytes as the value has.
TEST_F(SdoClientTest, AnExpeditedAnswerMayHideItsSize) {
  SdoTransfer transfer = SdoTransfer::upload({0x6041, 0});
  Frame frame;
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_TRUE(transfer.receive({.id = 0x585, .length = 8, .data = {0x42, 0x41, 0x60, 0, 0x37, 0x02, 0xAA, 0xBB}}));
  EXPECT_EQ(transfer.result(), AbortCode::none);
  EXPECT_FALSE(transfer.size_is_known());
  EXPECT_EQ(transfer.data().size(), 4U);

  class Unsized final : public ObjectClient {
   public:
    std::vector<std::byte> upload(ObjectAddress) override {
      return {std::byte{0x37}, std::byte{0x02}, std::byte{0xAA}, std::byte{0xBB}};
    }
    void download(ObjectAddress, std::span<const std::byte>) override {}
    bool size_is_known() const override { return false; }
    Time now() const override { return {}; }
    void wait(Time) override {}
    std::uint16_t address() const override { return 5; }
    std::string where() const override { return ""; }
  } unsized;
  EXPECT_EQ(unsized.read<std::uint16_t>(0x6041), 0x0237);
  EXPECT_EQ(unsized.read<std::uint32_t>(0x6041), 0xBBAA0237U);
}

TEST_F(SdoClientTest, SegmentedOfEverySizeAroundTheSegments) {
  for (const std::size_t size : {0U, 5U, 6U, 7U, 8U, 13U, 14U, 15U, 21U, 5999U, 6000U}) {
    const auto sent = pattern(size);
    client.download({0x2002, 0}, sent);
    EXPECT_EQ(content_of(device.objects.big), sent) << size;
    EXPECT_EQ(client.upload({0x2002, 0}), sent) << size;
  }
  client.write<std::uint64_t>(0x2003, 0, 0x0123456789ABCDEF);
  EXPECT_EQ(client.read<std::uint64_t>(0x2003), 0x0123456789ABCDEFU);
  EXPECT_EQ(client.read_text(0x1008), canopen::test::constant_text);
}

// A server that sends such segments would never end the transfer.
TEST_F(SdoClientTest, ASegmentWithoutDataThatIsNotTheLastIsRefused) {
  SdoTransfer transfer = SdoTransfer::upload({0x2002, 0});
  Frame frame;
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_TRUE(transfer.receive({.id = 0x585, .length = 8, .data = {0x40, 0x02, 0x20}}));
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_TRUE(transfer.receive({.id = 0x585, .length = 8, .data = {0x0E}}));
  EXPECT_TRUE(transfer.finished());
  EXPECT_EQ(transfer.result(), AbortCode::length_mismatch);
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_EQ(frame.data[0], 0x80);
}

TEST_F(SdoClientTest, ALongTransferIsCancelledWithinIt) {
  const auto sent = pattern(6000);
  client.download({0x2002, 0}, sent);
  const std::size_t before = seen.size();
  std::string told;
  line.lost = [&told](const Frame& frame) {
    if (frame.id == 0x605) told = text_of(frame);
    return false;
  };
  client.cancel_when([&] { return seen.size() >= before + 100; });
  EXPECT_THROW(client.upload({0x2002, 0}), MasterError);
  EXPECT_LT(seen.size(), before + 110);
  line.bus.run_for(2ms);
  EXPECT_EQ(told, "605 # 80 02 20 00 00 00 00 08");
  client.cancel_when({});
  EXPECT_EQ(client.upload({0x2002, 0}), sent);
}

TEST_F(SdoClientTest, BlockOfEverySizeAroundTheSegmentsAndSubBlocks) {
  constexpr std::size_t sub_block = 127 * 7;
  for (const std::size_t size :
       {1UL, 6UL, 7UL, 8UL, 14UL, sub_block - 1, sub_block, sub_block + 1, 2 * sub_block, 6000UL}) {
    const auto sent = pattern(size);
    client.download({0x2002, 0}, sent, SdoProtocol::block);
    EXPECT_EQ(content_of(device.objects.big), sent) << size;
    EXPECT_EQ(client.upload({0x2002, 0}, SdoProtocol::block), sent) << size;
  }
}

// Loses each frame of a block transfer in turn; the data must arrive complete.
TEST_F(SdoClientTest, BlockTransfersRepairWhatIsLost) {
  const auto sent = pattern(900);  // a sub-block and some segments
  client.download({0x2002, 0}, sent);
  unsigned repaired = 0;
  for (const bool upload : {true, false}) {
    for (unsigned victim = 2; victim < 131; ++victim) {
      unsigned count = 0;
      line.lost = [&](const Frame& frame) { return frame.id == (upload ? 0x585U : 0x605U) && ++count == victim; };
      if (!upload) device.objects.big.length = 0;
      try {
        if (upload) {
          EXPECT_EQ(client.upload({0x2002, 0}, SdoProtocol::block), content_of(device.objects.big)) << victim;
        } else {
          client.download({0x2002, 0}, sent, SdoProtocol::block);
          EXPECT_EQ(content_of(device.objects.big), sent) << victim;
        }
        ++repaired;
      } catch (const SdoError& error) {
        // A download is not restarted, so the frames before and after its segments are not repeated.
        EXPECT_FALSE(upload) << victim << error.what();
        EXPECT_GE(victim, 130U) << error.what();
      }
      line.lost = [](const Frame&) { return false; };
      line.bus.run_for(3s);  // the server aborts unfinished transfers meanwhile
    }
  }
  EXPECT_GE(repaired, 2 * 127U);
}

TEST_F(SdoClientTest, AbortsCarryObjectCodeAndWords) {
  const SdoError absent = error_of([&] { client.read<std::uint8_t>(0x2FFF, 3); });
  EXPECT_EQ(absent.index(), 0x2FFF);
  EXPECT_EQ(absent.sub(), 3);
  EXPECT_EQ(absent.code(), AbortCode::object_does_not_exist);
  EXPECT_TRUE(absent.from_node());
  EXPECT_TRUE(absent.object_is_absent());
  EXPECT_STREQ(absent.what(),
               "mem:, node 5, 2FFF:03: read refused: object does not exist (0602 0000h); look up the object in the "
               "node's EDS or manual");

  EXPECT_EQ(error_of([&] { client.write<std::uint16_t>(0x6041, 0, 1); }).code(), AbortCode::read_only);
  EXPECT_EQ(error_of([&] { client.upload({0x2005, 0}); }).code(), AbortCode::write_only);
  EXPECT_EQ(error_of([&] { client.write<std::int16_t>(0x2006, 0, 101); }).code(), AbortCode::value_too_high);
  EXPECT_EQ(error_of([&] { client.write<std::uint32_t>(0x6040, 0, 1); }).code(), AbortCode::length_too_high);
  EXPECT_EQ(error_of([&] { client.download({0x2002, 0}, pattern(6001)); }).code(), AbortCode::length_too_high);
  EXPECT_EQ(error_of([&] {
              client.download({0x2002, 0}, pattern(6001), SdoProtocol::block);
            }).code(),
            AbortCode::length_too_high);
  EXPECT_EQ(error_of([&] { client.upload({0x2005, 0}, SdoProtocol::block); }).code(), AbortCode::write_only);
  EXPECT_EQ(client.read_if_present<std::uint8_t>(0x2FFF), std::nullopt);
  EXPECT_EQ(client.read_if_present<std::uint32_t>(0x2008), canopen::test::constant_value);
}

TEST_F(SdoClientTest, SilenceIsReportedAfterTheStatedRetries) {
  SdoClient nobody(line.bus, 9, {.timeout = 50ms, .retries = 2});
  unsigned requests = 0;
  line.lost = [&](const Frame& frame) {
    requests += frame.id == 0x609 && frame.data[0] == 0x40;
    return false;
  };
  const Time before = line.now();
  const SdoError error = error_of([&] { nobody.read<std::uint16_t>(0x6041); });
  EXPECT_EQ(error.code(), AbortCode::protocol_timed_out);
  EXPECT_FALSE(error.from_node());
  EXPECT_EQ(requests, 3U);
  EXPECT_NEAR(std::chrono::duration<double>(line.now() - before).count(), 0.150, 0.005);
  requests = 0;
  line.lost = [&](const Frame& frame) {
    requests += frame.id == 0x609 && frame.data[0] == 0x2B;
    return false;
  };
  error_of([&] { nobody.write<std::uint16_t>(0x6040, 0, 6); });
  EXPECT_EQ(requests, 1U) << "a download is not repeated";
}

TEST_F(SdoClientTest, ALateAnswerIsNotTakenForTheNextOne) {
  SdoClient impatient(line.bus, 5, {.timeout = 20ms, .retries = 0});
  line.lost = [](const Frame& frame) { return frame.id == 0x605; };
  error_of([&] { impatient.read<std::uint16_t>(0x6040); });
  line.lost = [](const Frame&) { return false; };
  device.objects.statusword = 0x0237;
  // The answer for 6040h arrives while the client waits for 6041h.
  EXPECT_EQ(statusword_after({"585 # 4B 40 60 00 FF FF 00 00", "585 # 80 40 60 00 00 00 04 05"}, impatient), 0x0237);
}

// The answer to a request that was given up arrives in the next upload of the same object.
TEST_F(SdoClientTest, ALateAnswerIsNotTakenForTheNextOneOfTheSameObject) {
  SdoClient impatient(line.bus, 5, {.timeout = 20ms, .retries = 0});
  device.objects.statusword = 0x0237;
  for (const char* late : {"585 # 4B 41 60 00 FF FF 00 00", "585 # 80 41 60 00 00 00 04 05"}) {
    line.lost = [](const Frame& frame) { return frame.id == 0x605; };
    error_of([&] { impatient.read<std::uint16_t>(0x6041); });
    line.lost = [](const Frame&) { return false; };
    EXPECT_EQ(statusword_after({late}, impatient), 0x0237);
  }
}

// The answer to the read that drains late answers may be late, too.
TEST_F(SdoClientTest, ALateAnswerToADrainDrainsNothing) {
  SdoClient impatient(line.bus, 5, {.timeout = 20ms, .retries = 0});
  device.objects.statusword = 0x0237;
  line.lost = [](const Frame& frame) { return frame.id == 0x605; };
  for (int i = 0; i < 2; ++i) error_of([&] { impatient.read<std::uint16_t>(0x6041); });
  line.lost = [](const Frame&) { return false; };
  EXPECT_EQ(statusword_after({"585 # 43 00 10 00 92 01 42 00", "585 # 4B 41 60 00 FF FF 00 00"}, impatient), 0x0237);
}

TEST_F(SdoClientTest, ANodeThatDoesNotAnswerTheDrainIsReadLater) {
  SdoClient impatient(line.bus, 5, {.timeout = 20ms, .retries = 0});
  device.objects.statusword = 0x0237;
  bool loses_all = true;
  line.lost = [&](const Frame& frame) {
    const bool is_constant = frame.data[2] == 0x10;  // 1000h, 1018h
    return frame.id == 0x605 && (loses_all || is_constant);
  };
  error_of([&] { impatient.read<std::uint16_t>(0x6041); });
  loses_all = false;
  error_of([&] { impatient.read<std::uint16_t>(0x6041); });
  impatient.wait(10s);
  EXPECT_EQ(impatient.read<std::uint16_t>(0x6041), 0x0237);
}

TEST_F(SdoClientTest, ALostRequestIsRepeatedAfterTheLateAnswerIsDrained) {
  unsigned losses = 1;
  std::vector<std::string> requests;
  line.lost = [&](const Frame& frame) {
    if (frame.id != 0x605) return false;
    requests.push_back(text_of(frame).substr(0, 18));
    return losses != 0 && losses-- != 0;
  };
  device.objects.statusword = 0x0237;
  EXPECT_EQ(client.read<std::uint16_t>(0x6041), 0x0237);
  EXPECT_EQ(client.read<std::uint16_t>(0x6041), 0x0237);
  EXPECT_THAT(requests, ::testing::ElementsAre("605 # 40 41 60 00 ", "605 # 80 41 60 00 ", "605 # 40 00 10 00 ",
                                               "605 # 40 41 60 00 ", "605 # 40 41 60 00 "));
}

// Each further upload from a silent node takes one timeout per attempt, as the first one does.
TEST_F(SdoClientTest, ASilentNodeCostsNoTimeoutMore) {
  SdoClient nobody(line.bus, 9, {.timeout = 50ms, .retries = 1});
  for (int i = 0; i < 3; ++i) {
    const Time before = line.now();
    EXPECT_EQ(error_of([&] { nobody.read<std::uint16_t>(0x6041); }).index(), 0x6041);
    EXPECT_NEAR(std::chrono::duration<double>(line.now() - before).count(), 0.100, 0.005);
  }
  nobody.limit_wait(20ms);
  for (const bool upload : {true, false}) {
    const Time before = line.now();
    error_of([&] { upload ? void(nobody.read<std::uint16_t>(0x6041)) : nobody.write<std::uint16_t>(0x6040, 0, 6); });
    EXPECT_NEAR(std::chrono::duration<double>(line.now() - before).count(), 0.020, 0.002);
  }
}

TEST_F(SdoClientTest, TwoDevicesWithOneNodeIdAreReported) {
  std::uint8_t change = 0x02;
  bool is_copy = false;
  const Bus::Subscription second_device = line.bus.listen([&](const Frame& frame) {
    if (frame.id != 0x585 || std::exchange(is_copy, false)) return;
    is_copy = true;
    Frame copy = frame;
    copy.data[5] ^= change;
    line.intrude(copy);
  });
  const auto problem = [&]() -> std::string {
    try {
      client.write<std::uint16_t>(0x6040, 0, 6);  // a command gets through
      client.read<std::uint16_t>(0x6041);
      client.read<std::uint16_t>(0x6041);
    } catch (const ObjectError& error) {
      EXPECT_TRUE(error.answered());
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(problem(), ::testing::HasSubstr("mem:, node 5: two devices answer; give each device"));
  line.bus.run_for(10ms);
  change = 0;  // a frame that is doubled
  client.write<std::uint16_t>(0x6040, 0, 6);
  problem();
  EXPECT_EQ(problem(), "none");
}

// The copy of each answer comes after the next answer.
TEST_F(SdoClientTest, ADoubledAnswerThatIsLateIsNoSecondDevice) {
  std::optional<Frame> before;
  bool is_copy = false;
  const Bus::Subscription doubling = line.bus.listen([&](const Frame& frame) {
    if (frame.id != 0x585 || std::exchange(is_copy, false)) return;
    if (const auto copy = std::exchange(before, frame)) {
      is_copy = true;
      line.intrude(*copy);
    }
  });
  for (int i = 0; i < 5; ++i) {
    device.objects.statusword ^= 0x0400;
    EXPECT_EQ(client.read<std::uint16_t>(0x6041), device.objects.statusword);
    line.bus.run_for(1ms);
  }
}

TEST_F(SdoClientTest, AnswersToOtherRequestsAreNoSecondDevice) {
  SdoClient other(line.bus, 5);
  const auto change = [this] { device.objects.statusword ^= 0x0400; };
  for (int i = 0; i < 3; ++i) {
    client.read<std::uint16_t>(0x6041);
    change();
    other.read<std::uint16_t>(0x6041);
    change();
  }
  client.read<std::uint16_t>(0x6041);
  change();
  line.intrude(frame_of("605 # 40 41 60 00 00 00 00 00"));  // another program
  line.bus.run_for(10ms);
  client.read<std::uint16_t>(0x6040);
  EXPECT_EQ(std::count(seen.begin(), seen.end(), text_of(frame_of("605 # 40 41 60 00 00 00 00 00"))), 1);
}

TEST_F(SdoClientTest, AWrongToggleBitAborts) {
  device.objects.big.length = 20;
  const Bus::Subscription twice = line.bus.listen([&](const Frame& frame) {
    if (frame.id == 0x585 && (frame.data[0] & 0xF0) == 0x00) line.intrude(frame);
  });
  EXPECT_EQ(error_of([&] { client.upload({0x2002, 0}); }).code(), AbortCode::toggle_bit_not_alternated);
}

TEST(SdoClient, RefusesAnImpossibleNode) {
  CanLine line;
  EXPECT_THROW(SdoClient(line.bus, 0), MasterError);
  EXPECT_THROW(SdoClient(line.bus, 128), MasterError);
}

// A server like the Python package canopen: it has no block upload and answers with an ordinary one.
TEST(SdoTransfer, ABlockUploadMayBeAnsweredByAnOrdinaryOne) {
  SdoTransfer transfer = SdoTransfer::upload({0x2000, 0}, SdoProtocol::block);
  Frame frame;
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_TRUE(transfer.receive({.id = 0x585, .length = 8, .data = {0x41, 0x00, 0x20, 0x00, 3, 0, 0, 0}}));
  ASSERT_TRUE(transfer.take(frame));
  EXPECT_EQ(frame.data[0], 0x60);
  EXPECT_TRUE(transfer.receive({.id = 0x585, .length = 8, .data = {0x09, 'a', 'b', 'c', 0, 0, 0, 0}}));
  ASSERT_TRUE(transfer.finished());
  EXPECT_EQ(transfer.result(), AbortCode::none);
  EXPECT_EQ(transfer.data().size(), 3U);
}

TEST(SdoClient, ABlockTransferIsRefusedByANodeWithoutIt) {
  CanLine line;
  line.add(5, {.sdo_block = false});
  SdoClient client(line.bus, 5);
  try {
    client.upload({0x1008, 0}, SdoProtocol::block);
    FAIL();
  } catch (const SdoError& error) {
    EXPECT_EQ(error.code(), AbortCode::command_specifier_unknown);
  }
}

}  // namespace
}  // namespace sdo_client_test
}  // namespace servodrome::master::test
