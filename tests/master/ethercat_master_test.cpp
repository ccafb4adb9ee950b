// Scan, slave information, states: the master against the real slave stack.
#include <gmock/gmock.h>

#include "ethercat_line.hpp"
#include "master/ethercat/sii_client.hpp"

namespace servodrome::master::test {
namespace ethercat_master_test {
namespace {

using testing::HasSubstr;

TEST(EthercatScan, SaysWhatEverySlaveIs) {
  EthercatLine line({.slaves = 3});
  const auto found = scan_slaves(*line.master);
  ASSERT_EQ(found.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(found[i].position, i + 1);
    EXPECT_EQ(found[i].station, 0x1001 + i);
    EXPECT_EQ(found[i].alias, 101 + i);
    EXPECT_EQ(found[i].status.state(), AlState::init);
    EXPECT_TRUE(found[i].has_clock());
    EXPECT_TRUE(found[i].knows_lrw());
    EXPECT_EQ(text_of_links(found[i]), i < 2 ? "0 1" : "0");
    const SiiContent& sii = found[i].sii;
    EXPECT_TRUE(sii.checksum_right);
    EXPECT_EQ(sii.identity, (EthercatIdentity{0x66668888, 0x1234, 0x00010002, static_cast<std::uint32_t>(i + 1)}));
    EXPECT_EQ(sii.name, "Test device");
    EXPECT_EQ(sii.group, "Tests");
    EXPECT_EQ(sii.order, "TD-1");
    EXPECT_EQ(sii.mailbox, (MailboxAreas{{0x1000, 256}, {0x1100, 256}}));
    EXPECT_TRUE(sii.has(mailbox_protocol::coe));
    EXPECT_FALSE(sii.has(mailbox_protocol::foe));
    EXPECT_TRUE(sii.complete_access());
    ASSERT_EQ(sii.sync_managers.size(), 4U);
    EXPECT_EQ(sii.sync_managers[2].start, 0x1200);
    EXPECT_EQ(sii.sync_managers[2].length, 7);
    EXPECT_EQ(sii.sync_managers[2].type, 3);
    ASSERT_EQ(sii.rx_pdos.size(), 4U);
    EXPECT_EQ(sii.rx_pdos[0].index, 0x1600);
    EXPECT_EQ(sii.rx_pdos[0].sync_manager, 2);
    EXPECT_FALSE(sii.rx_pdos[1].sync_manager.has_value());
    ASSERT_EQ(sii.rx_pdos[0].entries.size(), 3U);
    EXPECT_EQ(sii.rx_pdos[0].entries[2].object, (ObjectAddress{0x607A, 0}));
    EXPECT_EQ(sii.rx_pdos[0].entries[2].bits, 32);
    EXPECT_EQ(sii.rx_pdos[0].entries[2].name, "Target position");
    ASSERT_EQ(sii.dc_modes.size(), 1U);
    EXPECT_EQ(sii.dc_modes[0].assign_activate, 0x0300);
    EXPECT_EQ(sii.dc_modes[0].name, "DC");
  }
}

TEST(EthercatScan, SixtyFourSlaves) {
  EthercatLine line({.slaves = 64});
  const auto found = scan_slaves(*line.master);
  ASSERT_EQ(found.size(), 64U);
  EXPECT_EQ(found.back().sii.identity.serial_number, 64U);
}

TEST(EthercatScan, NobodyIsNoError) {
  EthercatLine line;
  line.segment->set_cable(0, false);
  EXPECT_EQ(count_slaves(*line.master), 0U);
  EXPECT_TRUE(scan_slaves(*line.master).empty());
}

TEST(EthercatScan, ATailThatIsCutOffIsNotCounted) {
  EthercatLine line({.slaves = 5});
  line.segment->set_cable(3, false);
  EXPECT_EQ(scan_slaves(*line.master).size(), 3U);
}

// Another master may be using these slaves.
TEST(EthercatScan, StationAddressesOfOthersStay) {
  EthercatLine line({.slaves = 4});
  const auto give = [&](std::size_t slave, std::uint16_t address) {
    line.device(slave).esc.write_register<std::uint16_t>(ethercat::reg::station_address, address);
  };
  give(0, 7);
  give(1, 0x1003);
  give(2, 7);  // the same address twice
  const auto found = scan_slaves(*line.master);
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].station, 7);
  EXPECT_EQ(found[1].station, 0x1003);
  EXPECT_EQ(found[2].station, 0x1004);
  EXPECT_EQ(found[3].station, 0x1005);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found[i].sii.identity.serial_number, i + 1);
    EXPECT_EQ(line.device(i).esc.read_register<std::uint16_t>(ethercat::reg::station_address, line.now),
              found[i].station);
  }
}

// A slave that answers to its alias, enabled by another master, must not be confused with the slave that has that
// address.
TEST(EthercatScan, AnAliasIsNobodyElsesAddress) {
  EthercatLine line({.slaves = 3});
  line.device(2).esc.write_register<std::uint16_t>(ethercat::reg::station_alias, 0x1001);
  line.master->write_all(ethercat::reg::dl_control + 3, std::array<std::uint8_t, 1>{1});
  for (int times = 0; times < 2; ++times) {
    const auto found = scan_slaves(*line.master);
    ASSERT_EQ(found.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(found[i].sii.identity.serial_number, i + 1);
    EXPECT_NE(found[0].station, 0x1001);
  }
}

TEST(EthercatFrames, LostOnesAreSentAgain) {
  EthercatLine line({.slaves = 2});
  scan_slaves(*line.master);
  unsigned count = 0;
  line.lost_out = [&] { return ++count % 3 == 0; };
  line.lost_back = [&] { return count % 5 == 0; };
  EXPECT_EQ(scan_slaves(*line.master).size(), 2U);
  EXPECT_GT(line.master->lost_frames(), 20U);
}

// A program that simulates slaves may get no processor for longer than the master waits for a frame. It then receives
// the frame and its repetition at once, and the slave is still busy with the first one.
TEST(EthercatFrames, AnyFrameMayArriveTogetherWithItsRepetition) {
  const auto frames_of = [](unsigned queued) {
    EthercatLine line;
    unsigned count = 0;
    line.queued_out = [&] { return ++count == queued; };
    const auto all = line.open();
    SiiClient(*line.master, all[0]->station()).write_alias(7);
    EthercatOperation operation(*line.master, line.found, all, {.cyclic = {.period = 1ms}});
    all[0]->coe().write<std::int16_t>(0x2006, 0, 5);
    EXPECT_EQ(all[0]->coe().read<std::int16_t>(0x2006), 5);
    return count;
  };
  const unsigned frames = frames_of(0);
  for (unsigned queued = 1; queued <= frames; ++queued) EXPECT_EQ(problem_of([&] { frames_of(queued); }), "") << queued;
}

TEST(EthercatFrames, SilenceSaysWhatWhereAndWhatToDo) {
  EthercatLine line;
  line.lost_out = [] { return true; };
  const std::string problem = problem_of([&] { line.master->read<std::uint16_t>(0x1001, 0x0130); });
  EXPECT_THAT(problem, HasSubstr("mem:: frames do not come back within 5 ms, 4 times"));
  EXPECT_THAT(problem, HasSubstr("powered"));
}

TEST(EthercatFrames, AnAbsentSlaveIsToldByItsWorkingCounter) {
  EthercatLine line;
  EXPECT_THAT(problem_of([&] { line.master->read<std::uint16_t>(0x2222, 0x0130); }),
              HasSubstr("mem:, slave 2222h: reading 0130h: the slave does not answer (working counter 0)"));
}

TEST(EthercatFrames, ManyDatagramsTakeAsFewFramesAsHoldThem) {
  EthercatLine line;
  std::vector<std::array<std::uint8_t, 100>> data(40);
  std::vector<EthercatDatagram> datagrams;
  for (auto& bytes : data) {
    datagrams.push_back({.command = ethercat::Command::brd, .address = 0, .data = bytes});
  }
  line.master->exchange(datagrams);
  EXPECT_EQ(line.frames, 4U);  // 13 datagrams of 112 bytes fit into 1498
  for (const EthercatDatagram& datagram : datagrams) EXPECT_EQ(datagram.counter, 1);
}

TEST(EthercatSii, WordsAliasAndChecksumAreWritten) {
  EthercatLine line;
  line.open();
  SiiClient sii(*line.master, 0x1001);
  const std::array<std::uint8_t, 4> words{0x12, 0x34, 0x56, 0x78};
  sii.write(0x0700, words);
  EXPECT_EQ(sii.read(0x0700, 4), std::vector<std::uint8_t>(words.begin(), words.end()));
  sii.write_alias(0x0333);
  const SiiContent content = sii.content();
  EXPECT_EQ(content.alias, 0x0333);
  EXPECT_TRUE(content.checksum_right);
  line.device(0).esc.power_on(line.now);
  EXPECT_EQ(scan_slaves(*line.master)[0].alias, 0x0333);
}

TEST(EthercatSii, WhatDoesNotExistIsRefused) {
  EthercatLine line;
  line.open();
  SiiClient sii(*line.master, 0x1001);
  const std::array<std::uint8_t, 2> word{};
  EXPECT_THAT(problem_of([&] { sii.write(0x4000, word); }),
              HasSubstr("SII word 4000h: the memory does not acknowledge"));
}

TEST(EthercatSii, IsTakenFromTheApplication) {
  EthercatLine line;
  line.open();
  line.master->write<std::uint8_t>(0x1001, ethercat::reg::sii_configuration, 1);
  line.device(0).esc.sii().byte_written(1, 1, ethercat::SiiInterface::Side::application, line.now);
  EXPECT_EQ(SiiClient(*line.master, 0x1001).content().name, "Test device");
}

TEST(EthercatSii, ADamagedMemoryIsTakenAsFarAsItGoes) {
  EthercatLine line;
  std::vector<std::uint8_t> image(line.device(0).sii.begin(), line.device(0).sii.end());
  const SiiContent whole = parse_sii(image);
  ASSERT_EQ(whole.name, "Test device");
  ASSERT_FALSE(whole.rx_pdos.empty());
  // An image that ends early yields complete parts before its end, and never different values.
  std::size_t last_parts = 0;
  for (std::size_t size = 0; size <= image.size(); ++size) {
    const SiiContent part = parse_sii(std::span(image).first(size));
    EXPECT_TRUE(part.name.empty() || part.name == whole.name) << size;
    EXPECT_LE(part.rx_pdos.size(), whole.rx_pdos.size()) << size;
    EXPECT_LE(part.sync_managers.size(), whole.sync_managers.size()) << size;
    EXPECT_EQ(part.checksum_right, size >= 128) << size;
    const std::size_t parts = part.sync_managers.size() + part.rx_pdos.size() + part.tx_pdos.size() + part.fmmus.size();
    EXPECT_GE(parts, last_parts) << size;
    last_parts = parts;
  }
  EXPECT_EQ(last_parts, whole.sync_managers.size() + whole.rx_pdos.size() + whole.tx_pdos.size() + whole.fmmus.size());
  std::uint32_t seed = 1;
  int right = 0;
  for (int i = 0; i < 20000; ++i) {
    seed = seed * 1664525U + 1013904223U;
    image[seed >> 8 & 0x3FF] = static_cast<std::uint8_t>(seed >> 24);
    const SiiContent content = parse_sii(std::span(image).first(1024));
    right += content.checksum_right ? 1 : 0;
    // No category may have more content than fits into the memory.
    EXPECT_LE(content.name.size(), 255U);
    EXPECT_LE(content.sync_managers.size() * 8, 1024U);
    EXPECT_LE(content.fmmus.size(), 1024U);
  }
  EXPECT_LT(right, 20000 / 64) << "a checksum of 8 bits is right by accident in one of 256";
}

TEST(EthercatStates, UpAndDown) {
  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  slave.to_pre_operational();
  EXPECT_EQ(text_of(slave.status()), "PREOP");
  slave.to_pre_operational();
  slave.to_init();
  EXPECT_EQ(text_of(slave.status()), "INIT");
  slave.to_pre_operational();
  EXPECT_EQ(line.device(0).slave.state(), AlState::pre_operational);
}

TEST(EthercatStates, RefusalsNameCodeAndRemedy) {
  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  EXPECT_THAT(
      problem_of([&] { slave.request(AlState::operational); }),
      HasSubstr("mem:, slave 1001h: it does not go to OP: it is in INIT with error 0011h invalid requested state "
                "change; go one step at a time"));
  EXPECT_THAT(problem_of([&] { slave.request(AlState::pre_operational); }),
              HasSubstr("0016h invalid mailbox configuration; set up sync managers 0 and 1"));
  slave.to_pre_operational();  // also acknowledges the error
  EXPECT_THAT(problem_of([&] { slave.request(AlState::safe_operational); }),
              HasSubstr("PREOP with error 001Dh invalid output configuration; check 1C12h"));
  EXPECT_THAT(problem_of([&] { slave.to_bootstrap(); }), HasSubstr("it has no Bootstrap mailbox"));
  acknowledge_error(*line.master, 0x1001, 1s);
  EXPECT_FALSE(slave.status().error());
}

TEST(EthercatStates, BootstrapAndBack) {
  EthercatLine line({.profile = {.bootstrap = true}});
  EthercatSlave& slave = *line.open()[0];
  slave.to_bootstrap();
  EXPECT_EQ(slave.status().state(), AlState::bootstrap);
  slave.to_pre_operational();
  EXPECT_EQ(slave.status().state(), AlState::pre_operational);
}

TEST(EthercatStates, ADeviceThatRefusesSaysItsOwnCode) {
  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  line.device(0).events.refused = AlState::pre_operational;
  line.device(0).events.refusal = AlStatusCode::external_hardware_not_ready;
  EXPECT_THAT(problem_of([&] { slave.to_pre_operational(); }),
              HasSubstr("0052h external hardware not ready; switch on its power stage"));
}

TEST(EthercatStates, EveryCodeHasWordsAndARemedy) {
  unsigned known = 0;
  for (unsigned code = 0; code < 0x100; ++code) {
    const auto status = static_cast<AlStatusCode>(code);
    const bool has_words = std::string(text(status)) != "unknown AL status code";
    const bool has_remedy = std::string(remedy_of(status)) != "see its manual for this AL status code";
    EXPECT_EQ(has_words, has_remedy) << code;
    known += has_words ? 1U : 0U;
  }
  EXPECT_EQ(known, 63U);
}

TEST(EthercatStates, WordsOfTheCommandLine) {
  EXPECT_EQ(parse_al_state("safeop"), AlState::safe_operational);
  EXPECT_EQ(parse_al_state("Op"), AlState::operational);
  EXPECT_FALSE(parse_al_state("run").has_value());
}

}  // namespace
}  // namespace ethercat_master_test
}  // namespace servodrome::master::test
