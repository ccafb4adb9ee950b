#include "esc_rig.hpp"

// Who may write which register when, and what stays as it was (ETG.1000.4 clause 6).
namespace servodrome::ethercat::test {
namespace {

// Datagrams in one frame to the first slave; their working counters.
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
  // Its own key is not the other one's.
  EXPECT_EQ(write_together(line, {{reg::write_enable, {1}}, {reg::station_address, {8, 0}}}),
            (std::vector<unsigned>{1, 0}));
}

TEST(WriteProtection, TheKeysForgetWithTheFrame) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::register_write_enable, 1);
  line.put<std::uint8_t>(0, reg::write_enable, 1);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::register_write_enable), 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::write_enable), 0);
}

// ---- What a datagram over several registers does not do to those it cannot write ----

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
  line.write(0, reg::dl_control, {0x01, 0x0C, 0x07, 0x01});  // port 1 closed, alias on
  for (const char letter : {'R', 'E', 'S'}) line.write(0, reg::reset_ecat, bytes_of(letter));
  line.write(0, reg::dl_control, {0x03, 0x00});
  line.now += 1s;
  line.escs[0]->poll(line.now);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::dl_control), 0x00070001U);
}

// ---- DL control ----

TEST(DlControl, OnlyTheLoopsAreLentForASecond) {
  Line line(2);
  EXPECT_EQ(line.write(0, reg::dl_control, {0x03, 0x0C}).counter, 1U);  // the first write since power-on
  EXPECT_EQ(line.read(1, 0, 1).counter, 0U);
  line.put<std::uint8_t>(0, reg::dl_control + 3, 0x01);  // alias
  line.now += 1s;
  line.escs[0]->poll(line.now);
  EXPECT_EQ(line.read(1, 0, 1).counter, 1U);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::dl_control), 0x01070001U);
}

// Which bits of a register a master can write (ETG.1000.4): all ones are written, and what sticks is read.
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
  line.put<std::uint8_t>(0, reg::sii_configuration, 1);
  sii.byte_written(1, 1, Side::application, line.now);
  line.put<std::uint8_t>(0, reg::sii_configuration, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_pdi_access), 1);
  EXPECT_EQ(command(0x0100), 0U);
  line.put<std::uint8_t>(0, reg::sii_configuration, 2);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sii_pdi_access), 0);
  sii.byte_written(1, 1, Side::application, line.now);  // not while it is forced
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

// ETG.1000.4 clause 6.5: a channel that the application has taken out of use keeps the master off its area.
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
  line.put<std::uint8_t>(0, 0x080E, 0);  // the master gives up the other one: plain memory
  EXPECT_EQ(line.write(0, 0x1080, Bytes(8)).counter, 1U);
}

}  // namespace
}  // namespace servodrome::ethercat::test
