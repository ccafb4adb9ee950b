#include "esc_rig.hpp"

// Which side may write a register at which time, and which registers keep their values (ETG.1000.4 clause 6).
namespace servodrome::ethercat::test {
namespace ethercat_register_test {
namespace {

// Sends datagrams in one frame to the first slave; returns their working counters.
std::vector<unsigned> write_together(Line& line, std::initializer_list<std::pair<std::uint16_t, Bytes>> writes) {
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  std::vector<std::span<std::uint8_t>> places;
  for (const auto& [offset, data] : writes) {
    places.push_back(writer.add(Command::apwr, 0, address_of(0, offset), data.size()));
    std::copy(data.begin(), data.end(), places.back().begin());
  }
  line.segment->process(writer.bytes(), line.now);
  std::vector<unsigned> counters;
  counters.reserve(places.size());
  for (const auto place : places) counters.push_back(load_u16(place.data() + place.size()));
  return counters;
}

// ---- Write protection ----

TEST(WriteProtection, OfTheWholeControllerLeavesItsOwnKeyOnly) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::write_protection, 1);
  EXPECT_EQ(line.write(0, reg::register_write_enable, {1}).counter, 0U);
  EXPECT_EQ(line.write(0, 0x0F80, {1}).counter, 0U);
  EXPECT_EQ(line.write(0, reg::write_enable, {1}).counter, 1U);
  EXPECT_EQ(write_together(line, {{reg::write_enable, {1}}, {0x1000, {7}}, {reg::station_address, {8, 0}}}),
            (std::vector<unsigned>{1, 1, 1}));
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 8);
}

TEST(WriteProtection, OfRegistersLeavesTheUserMemory) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::register_write_protection, 1);
  EXPECT_EQ(line.write(0, 0x0F80, {1}).counter, 1U);
  EXPECT_EQ(line.write(0, reg::write_enable, {1}).counter, 1U);
  // One lock does not accept the key of the other.
  EXPECT_EQ(write_together(line, {{reg::write_enable, {1}}, {reg::station_address, {8, 0}}}),
            (std::vector<unsigned>{1, 0}));
}

// The lock also protects controller memory that is mapped by an FMMU.
TEST(WriteProtection, OfTheWholeControllerCoversMappedMemory) {
  Line line(1);
  line.set_sync_manager(0, 2, 0x1100, 4, 0x24);
  line.set_fmmu(0, 0, 0, 4, 0x1100, 2);
  line.set_fmmu(0, 1, 0x100, 4, 0x1800, 2);
  line.set_fmmu(0, 2, 0x200, 4, 0x1800, 1);
  EXPECT_EQ(line.send(Command::lwr, 0, {1, 2, 3, 4}).counter, 1U);
  EXPECT_EQ(line.send(Command::lwr, 0x100, {5, 6, 7, 8}).counter, 1U);
  line.put<std::uint8_t>(0, reg::write_protection, 1);
  EXPECT_EQ(line.send(Command::lwr, 0, {9, 9, 9, 9}).counter, 0U);
  EXPECT_EQ(line.send(Command::lwr, 0x100, {9, 9, 9, 9}).counter, 0U);
  EXPECT_EQ(line.escs[0]->open_for_reading(2)[0], 1);
  const Answer answer = line.send(Command::lrd, 0x200, Bytes(4));
  EXPECT_EQ(answer.counter, 1U) << "reading is not protected";
  EXPECT_EQ(answer.data, (Bytes{5, 6, 7, 8}));
}

TEST(WriteProtection, TheKeysForgetWithTheFrame) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::register_write_enable, 1);
  line.put<std::uint8_t>(0, reg::write_enable, 1);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::register_write_enable), 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::write_enable), 0);
}

// ---- Datagrams over several registers, some of which are not writable ----

// Each register within a datagram acts, wherever the datagram begins and ends.
TEST(Registers, ADatagramOverSeveralActsInEach) {
  Line line(1);
  Bytes fmmus(3 * 16);
  for (unsigned n = 0; n < 3; ++n) {
    store_u32(&fmmus[16 * n], 0x100 * n);
    store_u16(&fmmus[16 * n + 4], 2);
    fmmus[16 * n + 7] = 7;
    store_u16(&fmmus[16 * n + 8], 0x1000 + 0x100 * n);
    fmmus[16 * n + 11] = 2;
    fmmus[16 * n + 12] = 1;
  }
  EXPECT_EQ(line.write(0, reg::fmmu, fmmus).counter, 1U);
  for (unsigned n = 0; n < 3; ++n) {
    const auto mark = static_cast<std::uint8_t>(0xA0 + n);
    EXPECT_EQ(line.send(Command::lwr, 0x100 * n, {mark, 0}).counter, 1U) << n;
    EXPECT_EQ(line.get<std::uint8_t>(0, static_cast<std::uint16_t>(0x1000 + 0x100 * n)), mark);
  }
  // Both watchdogs, from the divider on.
  Bytes watchdogs(0x22);
  store_u16(&watchdogs[0], 2498);
  store_u16(&watchdogs[0x10], 7);
  store_u16(&watchdogs[0x20], 9);
  EXPECT_EQ(line.write(0, reg::watchdog_divider, watchdogs).counter, 1U);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_pdi), 7);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_process_data), 9);
}

TEST(Registers, AlControlThatWaitsIsNotAskedForAgain) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.write(0, reg::al_control, {2, 0});
  esc.settle(reg::al_event::al_control);
  EXPECT_EQ(line.write(0, 0x0100, Bytes(0x28)).counter, 1U);  // DL control is writable, AL control is not
  EXPECT_EQ(esc.attention() & reg::al_event::al_control, 0U);
  EXPECT_EQ(esc.take_al_control(), 2);
}

TEST(Registers, PulsesOfTheApplicationAreNotTheMasters) {
  Line line(1);
  Esc& esc = *line.escs[0];
  line.put<std::uint64_t>(0, reg::sync_start_time, esc.clock().system_time(line.now) + 1000);
  line.put<std::uint32_t>(0, reg::sync0_cycle, 1'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 3);
  line.put<std::uint8_t>(0, reg::cyclic_unit_control, 1);
  line.now += 1500us;
  esc.poll(line.now);
  const std::uint32_t count = esc.clock().sync(0).count;
  EXPECT_EQ(line.write(0, reg::cyclic_unit_control, {1, 0}).counter, 1U);  // only its first byte
  EXPECT_TRUE(esc.clock().sync(0).pending);
  EXPECT_EQ(esc.clock().sync(0).count, count);
}

// ---- Counters ----

TEST(ErrorCounters, AreClearedEachByItsOwn) {
  Line line(1);
  Esc& esc = *line.escs[0];
  esc.count_processing_unit_error();
  esc.count_invalid_frame(0);
  esc.count_forwarded_error(1);
  line.put<std::uint8_t>(0, reg::pdi_errors, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 1);
  line.put<std::uint8_t>(0, reg::forwarded_rx_errors, 0);  // one of 0300h to 030Bh: all of these
  EXPECT_EQ(line.read(0, reg::rx_errors, 12).data, Bytes(12));
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 1);
  line.put<std::uint8_t>(0, reg::processing_unit_errors, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 0);
}

// ---- Reset ----

TEST(Registers, TheApplicationsResetIsNotTheMasters) {
  Line line(1);
  EXPECT_EQ(line.write(0, reg::reset_pdi, {'R'}).counter, 0U);
}

TEST(Registers, ResetForgetsWhatDlControlWas) {
  Line line(2);
  line.write(0, reg::dl_control, {0x01, 0x0C, 0x07, 0x01});  // port 1 closed, alias enabled
  for (const char letter : {'R', 'E', 'S'}) line.write(0, reg::reset_ecat, bytes_of(letter));
  line.write(0, reg::dl_control, {0x03, 0x00});
  line.now += 1s;
  line.escs[0]->poll(line.now);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::dl_control), 0x00070001U);
}

// After a reset by the letters RES a controller is as after power-on, whatever it did before: registers, mappings,
// watchdogs, pulses, and pending states.
TEST(Registers, AResetForgetsEverythingElse) {
  Line line(1);
  Line fresh(1);
  Esc& esc = *line.escs[0];
  line.write(0, reg::station_address, words({0x1234}));
  line.put<std::uint8_t>(0, reg::physical_offset, 4);
  line.put<std::uint16_t>(0, reg::ecat_event_mask, 0xFFFF);
  line.set_sync_manager(0, 2, 0x1100, 4, 0x64);  // triggers the watchdog
  line.set_fmmu(0, 0, 0x10000, 4, 0x1100, 2);
  line.set_fmmu(0, 1, 0x10000, 4, 0x1800, 1);
  EXPECT_EQ(line.send(Command::lrw, 0x10000, {1, 2, 3, 4}).counter, 3U);
  line.put<std::uint64_t>(0, reg::sync_start_time, esc.clock().system_time(line.now) + 1000);
  line.put<std::uint32_t>(0, reg::sync0_cycle, 1'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 3);
  line.put<std::uint16_t>(0, reg::watchdog_divider, 100);
  line.put<std::uint16_t>(0, reg::watchdog_pdi, 10);
  line.put<std::uint16_t>(0, reg::system_time_filter, 0x0101);
  line.put<std::uint32_t>(0, reg::system_time_offset, 77);
  line.write(0, reg::dl_control, {0x03, 0x04});  // a loop setting that is valid for a second
  line.write(0, reg::al_control, {2, 0});
  esc.set_al_status(2, 0x11);
  esc.count_invalid_frame(0);
  esc.put_off(0xFFFF);
  esc.pdi_alive(line.now);
  line.put<std::uint8_t>(0, reg::write_protection, 1);

  // The keys of the write protection are valid for one frame, so each letter is sent together with the keys.
  for (const char letter : {'R', 'E', 'S'}) {
    EXPECT_EQ(write_together(line, {{reg::write_enable, {1}}, {reg::reset_ecat, bytes_of(letter)}}),
              (std::vector<unsigned>{1, 1}));
  }
  EXPECT_EQ(esc.attention(), Esc::attention_reset);
  EXPECT_TRUE(esc.calls(line.now)) << "nothing is put off";
  EXPECT_EQ(esc.quiet_until(), Esc::unknown);
  EXPECT_EQ(esc.next_deadline(line.now), fresh.escs[0]->next_deadline(fresh.now));
  EXPECT_EQ(line.send(Command::lrw, 0x10000, {1, 2, 3, 4}).counter, 0U);
  EXPECT_EQ(line.send(Command::fprd, address_of(0x1234, 0), Bytes(1)).counter, 0U);
  for (std::uint16_t at = 0; at < reg::process_memory; ++at) {
    if (at >= reg::receive_time_port && at < reg::system_time_offset) continue;  // times
    EXPECT_EQ(esc.read_byte(at, line.now), fresh.escs[0]->read_byte(at, fresh.now)) << std::hex << at;
  }
  line.now += 10s;  // longer than any of these states lasts
  EXPECT_EQ(esc.poll(line.now), 0U);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::watchdog_status), 1);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::dl_status), fresh.get<std::uint16_t>(0, reg::dl_status));
  EXPECT_EQ(line.write(0, reg::al_control, {4, 0}).counter, 1U) << "no AL control waits";
  EXPECT_EQ(line.write(0, 0x1100, {9}).counter, 1U) << "plain memory";
  // The letters are counted from the first again.
  line.write(0, reg::reset_ecat, bytes_of('S'));
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::reset_ecat), 0);
}

// ETG.1000.4 clause 6; ETG.1000.6 table 16 for registers that come from the slave information.
TEST(Registers, EveryDefaultAfterPowerOn) {
  Line line(1);
  store_u16(&line.sii[0][2], 0xA1B2);
  store_u16(&line.sii[0][4], 0x0321);
  store_u16(&line.sii[0][6], 0xC3D4);
  line.sii[0][14] = sii_checksum(std::span(line.sii[0]).first(14));
  line.escs[0]->power_on(line.now);
  struct Row {
    std::uint16_t address;
    Bytes bytes;
  };
  for (const auto& [address, bytes] : std::initializer_list<Row>{
           {0x0000, {0x11, 0x00, 0x02, 0x00}},  // type, revision, build
           {0x0004, {8, 8, 8, 0x0F}},           // FMMUs, sync managers, KiB of memory, ports
           {0x0008, {0xCC, 0x01}},              // features
           {0x0010, {0, 0, 0x34, 0x12}},        // station address and alias
           {0x0100, {0x01, 0x00, 0x07, 0x00}},  // DL control
           {0x0108, {0, 0}},
           {0x0120, {1, 0}},  // AL control
           {0x0130, {1, 0, 0, 0, 0, 0}},
           {0x0140, {0x08, 0x0E}},  // PDI control
           {0x0150, {0xB2, 0xA1, 0xD4, 0xC3}},
           {0x0200, {0, 0}},
           {0x0204, {0x0F, 0xFF, 0xFF, 0x00}},  // AL event mask
           {0x0300, Bytes(16)},
           {0x0400, {0xC2, 0x09}},  // watchdog divider: 100 us
           {0x0410, {0xE8, 0x03}},  // 100 ms
           {0x0420, {0xE8, 0x03}},
           {0x0440, {1, 0, 0, 0}},
           {0x0930, {0x00, 0x10}},  // speed counter start
           {0x0934, {4, 12}},       // filter depths
           {0x0980, {0, 0, 0x21, 0x03}},
       }) {
    EXPECT_EQ(line.read(0, address, bytes.size()).data, bytes) << std::hex << address;
  }
}

// ---- DL control ----

TEST(DlControl, OnlyTheLoopsAreLentForASecond) {
  Line line(2);
  EXPECT_EQ(line.write(0, reg::dl_control, {0x03, 0x0C}).counter, 1U);  // the first write after power-on
  EXPECT_EQ(line.read(1, 0, 1).counter, 0U);
  line.put<std::uint8_t>(0, reg::dl_control + 3, 0x01);  // alias
  line.now += 1s;
  line.escs[0]->poll(line.now);
  EXPECT_EQ(line.read(1, 0, 1).counter, 1U);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::dl_control), 0x01070001U);
}

// The bits of a register that a master can write (ETG.1000.4): writes all ones and reads which bits are set.
TEST(Registers, OnlyTheBitsThatAreThereStick) {
  struct Row {
    unsigned address;
    std::uint8_t writable;
  };
  for (const auto& [address, writable] : std::to_array<Row>({
           {0x0010, 0xFF},  // station address
           {0x0011, 0xFF},
           {0x0101, 0xFF},  // loops of the ports
           {0x0102, 0x0F},  // RX FIFO and EBUS jitter
           {0x0103, 0x01},  // station alias
           {0x0108, 0xFF},  // physical read/write offset
           {0x0200, 0xFF},  // event mask
           {0x0400, 0xFF},  // watchdog divider
           {0x0606, 0x07},  // FMMU 0: first logical bit
           {0x0607, 0x07},  // last logical bit
           {0x060A, 0x07},  // physical start bit
           {0x060F, 0x00},  // reserved
           {0x0000, 0x00},  // type
           {0x0004, 0x00},  // FMMUs supported
       })) {
    Line line(1);
    line.write(0, static_cast<std::uint16_t>(address), {0x00});
    const auto off = line.get<std::uint8_t>(0, static_cast<std::uint16_t>(address));
    line.write(0, static_cast<std::uint16_t>(address), {0xFF});
    const auto on = line.get<std::uint8_t>(0, static_cast<std::uint16_t>(address));
    EXPECT_EQ(on & ~off, writable) << std::hex << address;
  }
}

// ---- Slave information interface ----

class SiiOwner : public testing::Test {
 protected:
  unsigned command(std::uint16_t control) { return line.write(0, reg::sii_control, words({control, 4, 0})).counter; }
  bool busy() { return (line.get<std::uint16_t>(0, reg::sii_control) & 0x8000) != 0; }
  Line line{1};
  SiiInterface& sii = line.escs[0]->sii();
};

TEST_F(SiiOwner, OfferedIsGiven) {
  line.put<std::uint8_t>(0, reg::sii_configuration, 1);
  EXPECT_TRUE(sii.granted(SiiInterface::Side::application));
  EXPECT_EQ(command(0x0100), 0U);
  EXPECT_FALSE(busy());
  line.put<std::uint8_t>(0, reg::sii_configuration, 0);
  EXPECT_EQ(command(0x0100), 1U);
  EXPECT_TRUE(busy());
}

TEST_F(SiiOwner, WhatTheApplicationTookItHoldsUntilItIsForced) {
  using Side = SiiInterface::Side;
  EXPECT_FALSE(sii.byte_written(0, 1, Side::application, line.now)) << "it cannot offer it to itself";
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_configuration), 0);
  line.put<std::uint8_t>(0, reg::sii_configuration, 1);
  sii.byte_written(1, 1, Side::application, line.now);
  line.put<std::uint8_t>(0, reg::sii_configuration, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_pdi_access), 1);
  EXPECT_EQ(command(0x0100), 0U);
  line.put<std::uint8_t>(0, reg::sii_configuration, 2);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_pdi_access), 0);
  sii.byte_written(1, 1, Side::application, line.now);  // not while the master has forced the access
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_pdi_access), 0);
  EXPECT_EQ(command(0x0100), 1U);
}

TEST_F(SiiOwner, ABusyInterfaceTakesNothingAndDoesNotCount) {
  EXPECT_EQ(command(0x0100), 1U);
  EXPECT_EQ(command(0x0100), 0U);
  line.now += 100us;
  EXPECT_EQ(command(0x0100), 1U);
}

// ---- Sync managers ----

// ETG.1000.4 clause 6.5: if the application disables a channel, the master cannot access its memory area.
TEST(SyncManagers, TakenOutByTheApplicationItsAreaIsLocked) {
  Line line(1);
  line.set_sync_manager(0, 2, 0x1100, 4, 0x24);
  line.set_sync_manager(0, 1, 0x1080, 8, 0x22);
  line.set_fmmu(0, 0, 0, 4, 0x1100, 2);
  for (const unsigned n : {1U, 2U}) line.escs[0]->disable_sync_manager(n, true);
  EXPECT_EQ(line.write(0, 0x1100, {1, 2, 3, 4}).counter, 0U);
  EXPECT_EQ(line.send(Command::lwr, 0, {1, 2, 3, 4}).counter, 0U);
  EXPECT_EQ(line.read(0, 0x1080, 8).counter, 0U);
  EXPECT_EQ(line.read(0, 0x1100, 4).counter, 0U);
  EXPECT_EQ(line.write(0, 0x110C, {1}).counter, 1U);  // behind its three buffers
  line.escs[0]->disable_sync_manager(2, false);
  EXPECT_EQ(line.send(Command::lwr, 0, {1, 2, 3, 4}).counter, 1U);
  line.put<std::uint8_t>(0, 0x080E, 0);  // the master also disables the other one, which becomes plain memory
  EXPECT_EQ(line.write(0, 0x1080, Bytes(8)).counter, 1U);
}

}  // namespace
}  // namespace ethercat_register_test
}  // namespace servodrome::ethercat::test
