#include "esc_rig.hpp"

// Registers, sync managers, FMMUs, watchdogs, SII by ETG.1000.4 clause 6.
namespace servodrome::ethercat::test {
namespace ethercat_controller_test {
namespace {

TEST(Registers, InformationIsReadOnly) {
  Line line(1);
  EXPECT_EQ(line.read(0, 0, 10).data, (Bytes{0x11, 0, 2, 0, 8, 8, 8, 0x0F, 0xCC, 0x01}));
  EXPECT_EQ(line.write(0, 0, {1, 2, 3}).counter, 0U);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0), 0x11);
}

TEST(Registers, DefaultsAfterPowerOn) {
  Line line(1);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 0);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_alias), 0x1234);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::dl_control), 0x00070001U);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::al_status), 1);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::pdi_control), 0x0E08);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_divider), 2498);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_process_data), 1000);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::speed_counter_start), 0x1000);
  // Loaded, PDI watchdog not expired, link and communication at port 0, loops of the other ports closed.
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::dl_status), 0x5613);
}

TEST(Registers, AllOfThemCanBeRead) {
  Line line(1);
  for (std::uint16_t address = 0; address < reg::process_memory; address += 64) {
    EXPECT_EQ(line.read(0, address, 64).counter, 1U);
  }
  // There are eight sync managers.
  EXPECT_EQ(line.read(0, 0x0840, 8).data, Bytes(8));
}

TEST(Registers, AlControlWaitsForTheApplication) {
  Line line(1);
  EXPECT_EQ(line.write(0, reg::al_control, {2, 0}).counter, 1U);
  EXPECT_EQ(line.escs[0]->attention() & reg::al_event::al_control, reg::al_event::al_control);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::al_event_request) & 1, 1U);
  EXPECT_EQ(line.write(0, reg::al_control, {4, 0}).counter, 0U);  // not read yet
  EXPECT_EQ(line.escs[0]->take_al_control(), 2);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::al_event_request) & 1, 0U);
  EXPECT_EQ(line.write(0, reg::al_control, {4, 0}).counter, 1U);
  EXPECT_EQ(line.escs[0]->take_al_control(), 4);
}

TEST(Registers, WriteProtection) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::register_write_protection, 1);
  EXPECT_EQ(line.write(0, reg::station_address, {5, 0}).counter, 0U);
  EXPECT_EQ(line.write(0, 0x1000, {5}).counter, 1U);
  const auto unlock_and_write = [&line](std::uint16_t key, std::uint16_t target) {
    std::array<std::uint8_t, max_frame> memory;
    FrameWriter writer = FrameWriter::ethernet(memory);
    writer.add(Command::apwr, 0, address_of(0, key), 1);
    const auto data = writer.add(Command::apwr, 0, address_of(0, target), 1);
    data[0] = 9;
    line.segment->process(writer.bytes(), line.now);
    return load_u16(data.data() + 1);
  };
  EXPECT_EQ(unlock_and_write(reg::register_write_enable, reg::station_address), 1);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 9);
  EXPECT_EQ(line.write(0, reg::station_address, {6, 0}).counter, 0U);  // locked again at the end of the frame
  EXPECT_EQ(unlock_and_write(reg::register_write_enable, reg::register_write_protection), 1);
  line.write(0, reg::register_write_protection, {0});

  Line other(1);
  other.put<std::uint8_t>(0, reg::write_protection, 1);
  EXPECT_EQ(other.write(0, reg::station_address, {5, 0}).counter, 0U);
  EXPECT_EQ(other.write(0, 0x1000, {5}).counter, 0U);
}

TEST(Registers, ResetSequence) {
  Line line(1);
  line.put<std::uint16_t>(0, reg::station_address, 77);
  for (const char letter : {'R', 'S', 'E', 'S'}) line.write(0, reg::reset_ecat, bytes_of(letter));
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 77);  // the reset sequence is interrupted
  line.write(0, reg::reset_ecat, bytes_of('R'));
  line.write(0, reg::reset_ecat, bytes_of('E'));
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::reset_ecat), 2);  // with a frame in between
  line.write(0, reg::reset_ecat, bytes_of('S'));
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 77);
  for (const char letter : {'R', 'E', 'S'}) line.write(0, reg::reset_ecat, bytes_of(letter));
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 0);
  EXPECT_NE(line.escs[0]->attention() & Esc::attention_reset, 0U);
}

// ---- Sync managers ----

TEST(SyncManagers, MailboxHandshake) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.set_sync_manager(0, 0, 0x1000, 16, 0x26);  // mailbox, master writes, interrupt to the application
  line.set_sync_manager(0, 1, 0x1080, 16, 0x22);  // mailbox, master reads
  esc.settle(~0U);
  // To the slave.
  EXPECT_TRUE(esc.open_for_reading(0).empty());
  EXPECT_EQ(line.write(0, 0x1001, {1}).counter, 0U);  // must begin at its first byte
  EXPECT_EQ(line.write(0, 0x1000, counting(16)).counter, 1U);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0805), 0x09);  // full, interrupt write
  EXPECT_EQ(esc.attention(), reg::al_event::sync_manager0);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::al_event_request), reg::al_event::sync_manager0);
  EXPECT_EQ(line.write(0, 0x1000, counting(16, 50)).counter, 0U);  // full
  EXPECT_EQ(line.read(0, 0x1000, 16).counter, 0U);                 // the master cannot read it
  const auto mail = esc.open_for_reading(0);
  EXPECT_EQ(Bytes(mail.begin(), mail.end()), counting(16));
  esc.close_reading(0);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0805), 0x02);         // empty, interrupt read
  EXPECT_EQ(line.write(0, 0x1000, counting(8)).counter, 1U);  // in two parts
  EXPECT_TRUE(esc.open_for_reading(0).empty());
  EXPECT_EQ(line.write(0, 0x1008, counting(8, 9)).counter, 1U);
  EXPECT_EQ(esc.open_for_reading(0).size(), 16U);
  // From the slave.
  EXPECT_EQ(line.read(0, 0x1080, 16).counter, 0U);  // empty
  EXPECT_EQ(line.write(0, 0x1080, counting(16)).counter, 0U);
  const auto answer = esc.open_for_writing(1);
  ASSERT_EQ(answer.size(), 16U);
  std::fill(answer.begin(), answer.end(), std::uint8_t{0x33});
  EXPECT_EQ(line.read(0, 0x1080, 16).counter, 0U);  // the slave is writing
  esc.close_writing(1);
  EXPECT_TRUE(esc.open_for_writing(1).empty());
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x080D), 0x09);
  EXPECT_EQ(line.read(0, 0x1080, 15).counter, 1U);  // without the last byte
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x080D) & 0x48, 0x48);
  EXPECT_EQ(line.read(0, 0x1080, 16).data, Bytes(16, 0x33));
  EXPECT_EQ(line.read(0, 0x1080, 16).counter, 0U);
}

TEST(SyncManagers, RepeatRequest) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.set_sync_manager(0, 1, 0x1080, 8, 0x22);
  std::fill_n(esc.open_for_writing(1).begin(), 8, std::uint8_t{0x44});
  esc.close_writing(1);
  EXPECT_EQ(line.read(0, 0x1080, 8).counter, 1U);
  esc.settle(~0U);
  EXPECT_FALSE(esc.repeat_requested(1));
  line.put<std::uint8_t>(0, 0x080E, 0x03);
  EXPECT_TRUE(esc.repeat_requested(1));
  EXPECT_EQ(esc.attention(), reg::al_event::sync_manager_activation);
  esc.repeat(1);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x080F), 0x02);  // acknowledged
  EXPECT_EQ(line.read(0, 0x1080, 8).data, Bytes(8, 0x44));
  line.put<std::uint8_t>(0, 0x080E, 0x01);  // the next toggle is the opposite edge
  EXPECT_TRUE(esc.repeat_requested(1));
}

TEST(SyncManagers, ThreeBuffersFromTheMaster) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.set_sync_manager(0, 2, 0x1100, 4, 0x24);
  EXPECT_TRUE(esc.open_for_reading(2).empty());  // nothing written yet
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0815) & 0x30, 0x30);
  line.write(0, 0x1100, {1, 1, 1, 1});
  const auto first = esc.open_for_reading(2);  // stays open while the master writes twice more
  EXPECT_EQ(first[0], 1);
  EXPECT_EQ(line.write(0, 0x1100, {2, 2, 2, 2}).counter, 1U);
  EXPECT_EQ(line.write(0, 0x1100, {3, 3, 3, 3}).counter, 1U);
  EXPECT_EQ(Bytes(first.begin(), first.end()), Bytes(4, 1));
  esc.close_reading(2);
  EXPECT_EQ(esc.open_for_reading(2)[0], 3);  // the newest; 2 was never read
  esc.close_reading(2);
  EXPECT_EQ(esc.open_for_reading(2)[0], 3);  // the same again, because there is no new data
  // A partly written buffer is not visible.
  line.write(0, 0x1100, {4, 4});
  EXPECT_EQ(esc.open_for_reading(2)[0], 3);
  line.write(0, 0x1102, {4, 4});
  EXPECT_EQ(esc.open_for_reading(2)[0], 4);
  // The other two buffers cannot be accessed directly.
  EXPECT_EQ(line.write(0, 0x1104, {9}).counter, 0U);
  EXPECT_EQ(line.read(0, 0x1108, 4).counter, 0U);
  EXPECT_EQ(line.read(0, 0x110C, 4).counter, 1U);
}

TEST(SyncManagers, ThreeBuffersToTheMaster) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.set_sync_manager(0, 3, 0x1180, 2, 0x20);
  const auto put = [&esc](std::uint8_t value) {
    const auto buffer = esc.open_for_writing(3);
    ASSERT_EQ(buffer.size(), 2U);
    buffer[0] = buffer[1] = value;
    esc.close_writing(3);
  };
  EXPECT_EQ(line.read(0, 0x1180, 2).counter, 0U);
  put(1);
  EXPECT_EQ(line.read(0, 0x1180, 1).data, Bytes(1, 1));  // opened
  put(2);
  put(3);
  EXPECT_EQ(line.read(0, 0x1181, 1).data, Bytes(1, 1));  // consistent with its first byte
  EXPECT_EQ(line.read(0, 0x1180, 2).data, Bytes(2, 3));
  EXPECT_EQ(line.read(0, 0x1180, 2).data, Bytes(2, 3));
}

TEST(SyncManagers, SettingsOfAChannelInUseStay) {
  Line line(1);
  line.set_sync_manager(0, 0, 0x1000, 16, 0x26);
  line.write(0, 0x0800, words({0x1200, 99, 0x04}));
  EXPECT_EQ(line.read(0, 0x0800, 5).data, (Bytes{0x00, 0x10, 16, 0, 0x26}));
  line.put<std::uint8_t>(0, 0x0806, 0);
  line.write(0, 0x0800, words({0x1200, 99}));
  EXPECT_EQ(line.get<std::uint16_t>(0, 0x0800), 0x1200);
  EXPECT_FALSE(line.escs[0]->sync_manager(0).active);
}

TEST(SyncManagers, TheApplicationCanTakeAChannelOut) {
  Line line(1);
  line.set_sync_manager(0, 2, 0x1100, 4, 0x24);
  line.escs[0]->disable_sync_manager(2, true);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0817), 1);
  EXPECT_FALSE(line.escs[0]->sync_manager(2).active);
  line.escs[0]->disable_sync_manager(2, false);
  EXPECT_TRUE(line.escs[0]->sync_manager(2).active);
}

TEST(SyncManagers, AnAreaOutsideTheMemoryIsNone) {
  Line line(1);
  line.set_sync_manager(0, 2, 0x2FF8, 4, 0x24);  // three buffers need 12 bytes
  EXPECT_FALSE(line.escs[0]->sync_manager(2).active);
  line.set_sync_manager(0, 3, 0x2FF8, 8, 0x26);
  EXPECT_TRUE(line.escs[0]->sync_manager(3).active);
  line.set_sync_manager(0, 4, 0x0F00, 8, 0x26);
  EXPECT_FALSE(line.escs[0]->sync_manager(4).active);
  line.set_sync_manager(0, 5, 0xFFFF, 0xFFFF, 0x26);
  EXPECT_FALSE(line.escs[0]->sync_manager(5).active);
}

// ---- FMMUs ----

TEST(Fmmus, PartsInSeveralDatagrams) {
  Line line(1);
  line.set_sync_manager(0, 2, 0x1100, 8, 0x24);
  line.set_fmmu(0, 0, 0x00010004, 8, 0x1100, 2);
  EXPECT_EQ(line.send(Command::lwr, 0x00010000, counting(8)).counter, 1U);  // its first half
  EXPECT_TRUE(line.escs[0]->open_for_reading(2).empty());
  EXPECT_EQ(line.send(Command::lwr, 0x00010008, counting(8, 9)).counter, 1U);
  const auto buffer = line.escs[0]->open_for_reading(2);
  EXPECT_EQ(Bytes(buffer.begin(), buffer.end()), counting(8, 5));
  EXPECT_EQ(line.send(Command::lwr, 0x0001000C, counting(8)).counter, 0U);
  EXPECT_EQ(line.send(Command::lwr, 0x0000FFFC, counting(8)).counter, 0U);
}

TEST(Fmmus, OutputsAndInputsAtOneLogicalAddress) {
  Line line(1);
  line.set_fmmu(0, 0, 0, 4, 0x1000, 2);
  line.set_fmmu(0, 1, 0, 4, 0x1800, 1);
  line.put<std::uint32_t>(0, 0x1800, 0x55667788);
  const Answer answer = line.send(Command::lrw, 0, {1, 2, 3, 4});
  EXPECT_EQ(answer.counter, 3U);
  EXPECT_EQ(load_u32(answer.data.data()), 0x55667788U);
  EXPECT_EQ(line.get<std::uint32_t>(0, 0x1000), 0x04030201U);
}

TEST(Fmmus, ReadWriteExchangesOneMemory) {
  Line line(1);
  line.set_fmmu(0, 0, 0x100, 4, 0x1000, 3);
  line.put<std::uint32_t>(0, 0x1000, 0x0A0B0C0D);
  const Answer answer = line.send(Command::lrw, 0x100, {1, 2, 3, 4});
  EXPECT_EQ(answer.counter, 3U);
  EXPECT_EQ(load_u32(answer.data.data()), 0x0A0B0C0DU);  // the previous content
  EXPECT_EQ(line.get<std::uint32_t>(0, 0x1000), 0x04030201U);
}

TEST(Fmmus, LowestNumberWinsWhereTwoRead) {
  for (const unsigned last_bit : {7U, 6U}) {  // in whole bytes and in single bits
    Line line(1);
    line.put<std::uint16_t>(0, 0x1000, 0x1111);
    line.put<std::uint16_t>(0, 0x1800, 0x2222);
    line.set_fmmu(0, 0, 0x100, 1, 0x1000, 1, 0, last_bit);
    line.set_fmmu(0, 5, 0x100, 2, 0x1800, 1, 0, last_bit);
    EXPECT_EQ(line.send(Command::lrd, 0x100, {0, 0}).data, (Bytes{0x11, 0x22}));
  }
}

// Compared with a simple model, for every start bit, length in bits and physical bit.
TEST(Fmmus, BitsAgainstAModel) {
  Line line(1);
  for (unsigned first = 0; first < 8; ++first) {
    for (unsigned bits = 1; bits <= 19; ++bits) {
      for (unsigned physical_bit = 0; physical_bit < 8; ++physical_bit) {
        const unsigned last = first + bits - 1;
        const unsigned length = last / 8 + 1;
        line.set_fmmu(0, 0, 0x200, length, 0x1000, 1, first, last % 8, physical_bit);
        line.set_fmmu(0, 1, 0x200, length, 0x1010, 2, first, last % 8, physical_bit);
        line.put<std::uint64_t>(0, 0x1000, 0xA53C96E187F00FB4);
        line.put<std::uint64_t>(0, 0x1010, 0x0123456789ABCDEF);
        const std::uint64_t sent = 0x5AC3691E78C33C5A;
        const Answer answer = line.send(Command::lrw, 0x200 - 1, bytes_of(sent));
        ASSERT_EQ(answer.counter, 3U);
        const std::uint64_t mask = (std::uint64_t{1} << bits) - 1;
        const unsigned shift = 8 + first;  // the datagram begins a byte before
        const std::uint64_t read = (0xA53C96E187F00FB4 >> physical_bit & mask) << shift;
        ASSERT_EQ(load<std::uint64_t>(answer.data.data()), (sent & ~(mask << shift)) | read);
        const std::uint64_t written = (sent >> shift & mask) << physical_bit;
        ASSERT_EQ(line.get<std::uint64_t>(0, 0x1010), (0x0123456789ABCDEF & ~(mask << physical_bit)) | written);
      }
    }
  }
}

// The fast paths for whole bytes and whole buffers, compared with the general path, which an FMMU of single bits
// elsewhere selects: the same settings and frames must give the same answers and memory.
TEST(Fmmus, EveryWayGivesTheSame) {
  std::uint32_t seed = 11;
  const auto random = [&seed](std::uint32_t n) {
    seed = seed * 1664525U + 1013904223U;
    return (seed >> 10) % n;
  };
  unsigned counted = 0;
  for (int round = 0; round < 300; ++round) {
    Line lines[2]{Line(1), Line(1)};
    const unsigned outputs = 1 + random(40);
    const unsigned inputs = 1 + random(40);
    const unsigned out_at = random(64);
    const unsigned in_at = random(64);
    const unsigned cut = random(3) == 0 ? random(outputs) : 0;  // an FMMU of a part of its channel
    for (Line& line : lines) {
      line.set_sync_manager(0, 2, 0x1100, outputs, 0x64);
      line.set_sync_manager(0, 3, 0x1300, inputs, 0x20);
      line.set_fmmu(0, 0, 0x1000 + out_at, outputs - cut, 0x1100, 2);
      line.set_fmmu(0, 1, 0x1000 + in_at, inputs, 0x1300, 1);
    }
    lines[1].set_fmmu(0, 2, 0x9000, 1, 0x1F00, 1, 0, 0);
    for (int frame = 0; frame < 40; ++frame) {
      const Command command = std::array{Command::lrw, Command::lrw, Command::lrd, Command::lwr}[random(4)];
      const std::uint32_t address = random(4) == 0 ? 0x1000 + random(100) : 0x1000;
      const Bytes data = counting(1 + random(random(4) == 0 ? 30 : 130), static_cast<std::uint8_t>(random(256)));
      const bool writes_inputs = random(3) != 0;
      const bool reads_outputs = random(3) == 0;
      const auto value = static_cast<std::uint8_t>(random(256));
      Answer answers[2];
      Bytes taken[2];
      for (int i = 0; i < 2; ++i) {
        Esc& esc = *lines[i].escs[0];
        if (writes_inputs) {
          const auto buffer = esc.open_for_writing(3);
          std::fill(buffer.begin(), buffer.end(), value);
          esc.close_writing(3);
        }
        answers[i] = lines[i].send(command, address, data);
        if (reads_outputs) {
          const auto buffer = esc.open_for_reading(2);
          taken[i].assign(buffer.begin(), buffer.end());
          esc.close_reading(2);
        }
      }
      ASSERT_EQ(answers[0].data, answers[1].data) << round;
      ASSERT_EQ(answers[0].counter, answers[1].counter) << round;
      ASSERT_EQ(taken[0], taken[1]) << round;
      ASSERT_EQ(lines[0].escs[0]->attention(), lines[1].escs[0]->attention());
      ASSERT_EQ(lines[0].read(0, 0x0810, 16).data, lines[1].read(0, 0x0810, 16).data);
      counted += answers[0].counter;
    }
  }
  EXPECT_GT(counted, 10000U);
}

TEST(Fmmus, ReadsRegistersToo) {
  Line line(1);
  line.set_sync_manager(0, 1, 0x1080, 8, 0x22);
  line.set_fmmu(0, 2, 0x09000000, 1, 0x080D, 1, 0, 0, 3);  // "mailbox full" of SM1 as bit 0, as masters poll it
  EXPECT_EQ(line.send(Command::lrd, 0x09000000, {0}).data, Bytes{0});
  line.escs[0]->open_for_writing(1);
  line.escs[0]->close_writing(1);
  EXPECT_EQ(line.send(Command::lrd, 0x09000000, {0}).data, Bytes{1});
}

TEST(Fmmus, TopOfTheLogicalSpace) {
  Line line(1);
  line.set_fmmu(0, 0, 0xFFFFFFFC, 8, 0x1000, 2);
  EXPECT_EQ(line.send(Command::lwr, 0xFFFFFFFE, {7, 8, 9, 10}).counter, 1U);
  EXPECT_EQ(line.get<std::uint16_t>(0, 0x1002), 0x0807);
  EXPECT_EQ(line.send(Command::lwr, 0, {7, 8}).counter, 0U);
}

struct BuffersOfFour : Line {
  BuffersOfFour() : Line(1) {
    set_sync_manager(0, 2, 0x1100, 4, 0x64);
    set_sync_manager(0, 3, 0x1300, 4, 0x20);
    map(0);
    const auto buffer = escs[0]->open_for_writing(3);
    std::fill(buffer.begin(), buffer.end(), std::uint8_t{0xA5});
    escs[0]->close_writing(3);
  }
  void map(std::uint32_t logical) {
    set_fmmu(0, 0, logical, 4, 0x1100, 2);
    set_fmmu(0, 1, logical + 4, 4, 0x1300, 1);
  }
};

TEST(Fmmus, WholeBuffersDoNotGoOnAtTheBottomOfTheLogicalSpace) {
  BuffersOfFour line;
  const Answer answer = line.send(Command::lrw, 0xFFFFFFF8, counting(40));
  EXPECT_EQ(answer.counter, 0U);
  EXPECT_EQ(answer.data, counting(40));
  EXPECT_EQ(line.send(Command::lrw, 0, counting(40)).counter, 3U);
}

// The offsets of the buffers in a frame are cached for the next frame.
TEST(Fmmus, WholeBuffersAreLookedForWhereTheyAreNow) {
  BuffersOfFour line;
  Bytes expected = counting(40);
  std::fill_n(expected.begin() + 4, 4, std::uint8_t{0xA5});
  for (int cycle = 0; cycle < 3; ++cycle) EXPECT_EQ(line.send(Command::lrw, 0, counting(40)).data, expected);
  line.map(16);
  expected = counting(40);
  std::fill_n(expected.begin() + 20, 4, std::uint8_t{0xA5});
  for (int cycle = 0; cycle < 3; ++cycle) EXPECT_EQ(line.send(Command::lrw, 0, counting(40)).data, expected);
  const auto outputs = line.escs[0]->open_for_reading(2);
  EXPECT_EQ(Bytes(outputs.begin(), outputs.end()), counting(4, 17));
  EXPECT_EQ(line.send(Command::lrw, 0, counting(16)).counter, 0U);
  EXPECT_EQ(line.send(Command::lrw, 1, counting(40)).data[19], 0xA5);
  EXPECT_EQ(line.send(Command::lrw, 0, {}).counter, 0U);
  line.write(0, reg::fmmu + 12, {0});  // without outputs
  EXPECT_EQ(line.send(Command::lrw, 0, counting(40)).counter, 1U);
}

// ---- Watchdogs ----

TEST(Watchdogs, ProcessData) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.set_sync_manager(0, 2, 0x1100, 2, 0x64);
  line.put<std::uint16_t>(0, reg::watchdog_process_data, 50);  // 5 ms
  line.now += 1s;
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 1);  // never triggered
  line.write(0, 0x1100, {1, 2});
  EXPECT_EQ(esc.next_deadline(line.now), line.now + 5ms);
  line.now += 5ms - 1ns;
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 1);
  line.now += 1ns;
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::watchdog_process_data_count), 1);
  EXPECT_NE(esc.attention() & reg::al_event::watchdog_process_data, 0U);
  line.write(0, 0x1100, {1, 2});
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 1);
  // An expiry between two frames is not missed.
  esc.settle(~0U);
  line.now += 6ms;
  line.write(0, 0x1100, {1, 2});
  EXPECT_NE(esc.attention() & reg::al_event::watchdog_process_data, 0U);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::watchdog_process_data_count), 2);
  line.put<std::uint8_t>(0, reg::watchdog_process_data_count, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::watchdog_process_data_count), 0);
  // Divider: 5 x (98 + 2) x 40 ns.
  line.put<std::uint16_t>(0, reg::watchdog_divider, 98);
  line.put<std::uint16_t>(0, reg::watchdog_process_data, 5);
  line.write(0, 0x1100, {1, 2});
  EXPECT_EQ(esc.next_deadline(line.now), line.now + 20us);
  line.put<std::uint16_t>(0, reg::watchdog_process_data, 0);
  EXPECT_EQ(esc.next_deadline(line.now), never);
}

TEST(Watchdogs, Pdi) {
  Line line(1);
  Esc& esc = *line.escs[0];
  esc.pdi_alive(line.now);
  line.now += 100ms;
  esc.poll(line.now);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::watchdog_pdi_count), 1);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::dl_status) & 2, 0);
}

// ---- SII ----

class Sii : public testing::Test {
 protected:
  unsigned status() { return line.get<std::uint16_t>(0, reg::sii_control); }
  void command(unsigned control, std::uint32_t address) {
    Bytes bytes = words({control});
    const Bytes to = bytes_of(address);
    bytes.insert(bytes.end(), to.begin(), to.end());
    EXPECT_EQ(line.write(0, reg::sii_control, bytes).counter, 1U);
  }
  Line line{1};
};

TEST_F(Sii, ReadTakesItsTime) {
  command(0x0100, 4);
  EXPECT_EQ(status() & 0x8000, 0x8000U);
  line.now += 99us;
  EXPECT_EQ(status() & 0x8000, 0x8000U);
  line.now += 1us;
  EXPECT_EQ(status(), 0x0040U);  // 8 bytes per read, no error
  EXPECT_EQ(line.get<std::uint64_t>(0, reg::sii_data), load<std::uint64_t>(&line.sii[0][8]));
}

TEST_F(Sii, WriteNeedsItsPermission) {
  line.put<std::uint16_t>(0, reg::sii_data, 0xBEEF);
  command(0x0200, 20);
  EXPECT_EQ(status() & 0xC000, 0x4000U);
  EXPECT_EQ(load_u16(&line.sii[0][40]), 0);
  command(0x0201, 20);
  EXPECT_EQ(status() & 0x8000, 0x8000U);
  EXPECT_EQ(line.write(0, reg::sii_control, words({0x0201, 22, 0})).counter, 0U);  // busy: ignored
  line.now += 5ms;
  EXPECT_EQ(status() & 0xF800, 0U);
  EXPECT_EQ(load_u16(&line.sii[0][40]), 0xBEEF);
  EXPECT_EQ(load_u16(&line.sii[0][44]), 0);
  EXPECT_TRUE(line.escs[0]->sii().take_written());
  EXPECT_FALSE(line.escs[0]->sii().take_written());
}

TEST_F(Sii, UnknownCommandAndEndOfMemory) {
  command(0x0300, 0);
  EXPECT_EQ(status() & 0x2000, 0x2000U);
  command(0x0000, 0);
  EXPECT_EQ(status() & 0x2000, 0U);
  command(0x0201, 32);
  line.now += 5ms;
  EXPECT_EQ(status() & 0x2000, 0x2000U);
  command(0x0100, 0xFFFFFFFF);
  line.now += 1ms;
  EXPECT_EQ(line.get<std::uint64_t>(0, reg::sii_data), ~std::uint64_t{0});
}

TEST_F(Sii, ChecksumAndReload) {
  line.sii[0][0] = 0x05;
  command(0x0400, 0);
  line.now += 1ms;
  EXPECT_EQ(status() & 0x1800, 0x1800U);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::dl_status) & 1, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::pdi_control), 0x08);  // unchanged
  line.sii[0][8] = 0x99;
  line.sii[0][14] = sii_checksum(std::span(line.sii[0]).first(14));
  command(0x0400, 0);
  line.now += 1ms;
  EXPECT_EQ(status() & 0x1800, 0U);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::pdi_control), 0x05);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_alias), 0x1234);  // only after a power cycle
  line.escs[0]->power_on(line.now);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_alias), 0x1299);
}

TEST(SiiMemory, KnownChecksum) {
  // Polynomial 07h from FFh over 14 zero bytes, calculated with an independent method: a table.
  std::array<std::uint8_t, 256> table{};
  for (unsigned i = 0; i < 256; ++i) {
    unsigned crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1) ^ ((crc & 0x80) != 0 ? 0x107U : 0U);
    table[i] = static_cast<std::uint8_t>(crc);
  }
  const Bytes bytes = counting(14, 0x37);
  unsigned crc = 0xFF;
  for (const std::uint8_t byte : bytes) crc = table[crc ^ byte];
  EXPECT_EQ(sii_checksum(bytes), crc);
  // The check value of this CRC (initial FFh, no final xor) over "123456789".
  EXPECT_EQ(sii_checksum(std::array<std::uint8_t, 9>{'1', '2', '3', '4', '5', '6', '7', '8', '9'}), 0xFB);
}

}  // namespace
}  // namespace ethercat_controller_test
}  // namespace servodrome::ethercat::test
