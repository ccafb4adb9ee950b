#include "esc_rig.hpp"

// Slaves in line: loops, breaks, rings, errors on the cables.
namespace servodrome::ethercat::test {
namespace ethercat_segment_test {
namespace {

unsigned count(Line& line, Segment::Port port = Segment::Port::primary) {
  const Answer answer = line.send(Command::brd, address_of(0, 0), {0}, port);
  return answer.exit == Segment::Exit::lost ? 0 : answer.counter;
}

TEST(Segment, TheTailBehindABreakIsSilent) {
  Line line(5);
  EXPECT_EQ(count(line), 5U);
  line.segment->set_cable(3, false);
  EXPECT_EQ(count(line), 3U);
  EXPECT_EQ(line.get<std::uint16_t>(2, reg::dl_status), 0x5613);  // loop at port 1 closed
  EXPECT_EQ(line.get<std::uint8_t>(2, reg::lost_links + 1), 1);
  EXPECT_EQ(line.get<std::uint16_t>(1, reg::dl_status), 0x5A33);
  line.segment->set_cable(3, true);
  EXPECT_EQ(count(line), 5U);
  EXPECT_EQ(line.get<std::uint8_t>(3, reg::lost_links), 1);
  line.put<std::uint8_t>(3, reg::lost_links, 0);
  EXPECT_EQ(line.get<std::uint8_t>(3, reg::lost_links), 0);
  line.segment->set_cable(0, false);
  EXPECT_EQ(count(line), 0U);
}

TEST(Segment, DlStatusEventTellsOfABreak) {
  Line line(2);
  line.put<std::uint16_t>(0, reg::ecat_event_mask, reg::ecat_event::dl_status);
  line.get<std::uint16_t>(0, reg::dl_status);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, 0);
  line.segment->set_cable(1, false);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, reg::ecat_event::dl_status);
  line.get<std::uint16_t>(0, reg::dl_status);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, 0);
}

TEST(Segment, PowerCycleOfOneSlave) {
  Line line(3);
  line.put<std::uint16_t>(1, reg::station_address, 0x1002);
  line.put<std::uint16_t>(2, reg::station_address, 0x1003);
  line.segment->set_powered(1, false, line.now);
  EXPECT_EQ(count(line), 1U);
  line.now += 1s;
  line.segment->set_powered(1, true, line.now);
  EXPECT_EQ(count(line), 3U);
  EXPECT_LT(line.get<std::uint64_t>(1, reg::system_time), 1'000'000U) << "its clock begins with its power";
  EXPECT_EQ(line.get<std::uint16_t>(1, reg::station_address), 0);
  EXPECT_EQ(line.get<std::uint16_t>(2, reg::station_address), 0x1003);
}

TEST(Segment, LoopsByDlControl) {
  Line line(3);
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x0C);  // port 1 closed
  EXPECT_EQ(count(line), 2U);
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x08);  // open
  EXPECT_EQ(count(line), 3U);
  line.segment->set_cable(2, false);
  EXPECT_EQ(count(line), 0U);  // an open port without a link loses the frame
  line.segment->set_cable(2, true);
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x04);  // auto close
  line.segment->set_cable(2, false);
  EXPECT_EQ(count(line), 2U);
  line.segment->set_cable(2, true);
  EXPECT_EQ(count(line), 2U);                            // stays closed
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x04);  // until it is written again
  EXPECT_EQ(count(line), 3U);
}

// A port that closed because it lost its link opens when a frame arrives at it; that frame is lost.
TEST(Segment, AFrameOpensAnAutoClosedPort) {
  Line line(3);
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x01);  // port 0
  line.segment->set_cable(1, false);
  line.segment->set_cable(1, true);
  EXPECT_EQ(count(line), 0U);
  EXPECT_EQ(count(line), 3U);
}

// A master that closes all ports of a slave can still reach the slave.
TEST(Segment, Port0IsTheWayBackWhenAllAreClosed) {
  Line line(1);
  line.put<std::uint8_t>(0, reg::dl_control + 1, 0x0F);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::dl_status) & 0x0500, 0x0500);  // both shown as closed
  EXPECT_EQ(count(line), 1U);
}

TEST(Segment, TemporarySettingOfLoops) {
  Line line(2);
  line.write(0, reg::dl_control, {0x01, 0x00, 0x07, 0x00});
  line.write(0, reg::dl_control, {0x03, 0x0C, 0x07, 0x00});
  EXPECT_EQ(count(line), 1U);
  EXPECT_EQ(line.escs[0]->next_deadline(line.now), line.now + 1s);
  line.now += 1s;
  line.escs[0]->poll(line.now);
  EXPECT_EQ(count(line), 2U);
}

TEST(Segment, RingWithoutABreak) {
  Line line(4);
  line.segment->set_cable(4, true);
  Answer answer = line.send(Command::brd, 0, {0});
  EXPECT_EQ(answer.exit, Segment::Exit::secondary);
  EXPECT_EQ(answer.counter, 4U);
  answer = line.send(Command::brd, 0, {0}, Segment::Port::secondary);  // goes back unprocessed
  EXPECT_EQ(answer.exit, Segment::Exit::primary);
  EXPECT_EQ(answer.counter, 0U);
}

TEST(Segment, RingBearsOneBreakAnywhere) {
  for (std::size_t broken = 0; broken <= 4; ++broken) {
    Line line(4);
    line.segment->set_cable(4, true);
    line.segment->set_cable(broken, false);
    const Answer front = line.send(Command::brd, 0, {0});
    const Answer back = line.send(Command::brd, 0, {0}, Segment::Port::secondary);
    EXPECT_EQ(front.exit, broken == 0 ? Segment::Exit::lost : Segment::Exit::primary);
    EXPECT_EQ(back.exit, broken == 4 ? Segment::Exit::lost : Segment::Exit::secondary);
    EXPECT_EQ(front.counter, broken);
    EXPECT_EQ(back.counter, 4 - broken);
    // From the far end, too, a frame passes the slaves in the usual order.
    if (broken == 2) {
      line.send(Command::apwr, address_of(0, 0x1000), {0xAB}, Segment::Port::secondary);
      EXPECT_EQ(line.escs[2]->read_byte(0x1000, line.now), 0xAB);
      EXPECT_EQ(line.escs[3]->read_byte(0x1000, line.now), 0);
    }
  }
}

TEST(Segment, ACirculatingFrameIsTakenOffTheLine) {
  Line line(2);
  line.segment->set_cable(2, true);
  line.segment->set_cable(0, false);
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  writer.add(Command::brd, 0, 0, 1);
  EXPECT_EQ(line.segment->process(writer.bytes(), line.now, Segment::Port::secondary).exit, Segment::Exit::secondary);
  Frame frame;
  parse_ethernet(writer.bytes(), frame);
  EXPECT_TRUE(frame.datagrams()[0].circulating());
  EXPECT_EQ(line.segment->process(writer.bytes(), line.now, Segment::Port::secondary).exit, Segment::Exit::lost);
}

// A port 0 that was closed by a command does not count as a break: no frame is marked (ETG.1000.4 clause 5.3.3).
TEST(Segment, OnlyABreakMarksFrames) {
  Line line(2);
  line.put<std::uint8_t>(1, reg::dl_control + 1, 0x00);
  line.segment->set_cable(2, true);
  line.put<std::uint8_t>(0, reg::dl_control + 1, 0x03);
  const auto marks = [&line] {
    std::array<std::uint8_t, max_frame> memory;
    FrameWriter writer = FrameWriter::ethernet(memory);
    writer.add(Command::brd, 0, 0, 1);
    writer.add(Command::nop, 0, 0, 4);
    line.segment->process(writer.bytes(), line.now, Segment::Port::secondary);
    Frame frame;
    parse_ethernet(writer.bytes(), frame);
    return std::pair{frame.datagrams()[0].circulating(), frame.datagrams()[1].circulating()};
  };
  EXPECT_EQ(marks(), (std::pair{false, false}));
  line.send(Command::apwr, address_of(0, reg::dl_control + 1), {0x00}, Segment::Port::secondary);
  line.segment->set_cable(0, false);
  EXPECT_EQ(marks(), (std::pair{true, true}));  // each datagram has the bit
}

TEST(Segment, AWrongFcsIsCountedWhereItHappenedAndBehind) {
  Line line(3);
  line.slaves[1].corrupts_next = true;
  EXPECT_EQ(count(line), 0U);
  EXPECT_EQ(count(line), 3U);
  // The corrupting slave and the slave before it receive the marked frame at port 1 when it comes back.
  EXPECT_EQ(line.read(0, reg::rx_errors, 13).data, (Bytes{0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0}));
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::rx_errors), 1);
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::forwarded_rx_errors + 1), 1);
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::processing_unit_errors), 1);
  EXPECT_EQ(line.get<std::uint8_t>(2, reg::rx_errors), 0);
  EXPECT_EQ(line.get<std::uint8_t>(2, reg::forwarded_rx_errors), 1);
  line.put<std::uint8_t>(1, reg::rx_errors, 0xFF);  // any value clears all of them
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::rx_errors), 0);
}

TEST(Segment, TimeOfTheWay) {
  Line line(4, 500ns);
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  writer.add(Command::nop, 0, 0, 0);
  EXPECT_EQ(line.segment->process(writer.bytes(), 10us).leaves, 10us + 8 * 500ns);
  line.segment->set_cable(2, false);
  EXPECT_EQ(line.segment->process(writer.bytes(), 10us).leaves, 10us + 4 * 500ns);
}

TEST(Segment, PortReceiveTimes) {
  Line line(3, 100ns);
  line.slaves[2].forward = line.slaves[2].backward = 350ns;
  line.send(Command::bwr, address_of(0, reg::receive_time_port), Bytes(4));
  const auto base = static_cast<std::uint32_t>(line.get<std::uint32_t>(0, reg::receive_time_port));
  EXPECT_EQ(line.get<std::uint64_t>(0, reg::receive_time_processing_unit), base);
  EXPECT_EQ(line.get<std::uint32_t>(0, reg::receive_time_port + 4) - base, 2 * (100U + 350U));
  EXPECT_EQ(line.get<std::uint32_t>(1, reg::receive_time_port) - base, 100U);
  EXPECT_EQ(line.get<std::uint32_t>(1, reg::receive_time_port + 4) - base, 100U + 2 * 350U);
  EXPECT_EQ(line.get<std::uint32_t>(2, reg::receive_time_port) - base, 450U);
  EXPECT_EQ(line.get<std::uint32_t>(2, reg::receive_time_port + 4), 0U);
}

// From the far end the frame enters each slave at port 1, turns at the break, and is processed on its way back.
TEST(Segment, PortReceiveTimesFromTheFarEnd) {
  Line line(3, 100ns);
  line.slaves[2].forward = line.slaves[2].backward = 350ns;
  line.segment->set_cable(3, true);
  line.segment->set_cable(1, false);
  const Answer answer =
      line.send(Command::bwr, address_of(0, reg::receive_time_port), Bytes(4), Segment::Port::secondary);
  EXPECT_EQ(answer.exit, Segment::Exit::secondary);
  EXPECT_EQ(answer.counter, 2U);
  const auto at = [&](std::size_t slave, unsigned port) {
    const std::uint16_t address = static_cast<std::uint16_t>(reg::receive_time_port + 4 * port);
    return line.escs[slave]->read_register<std::uint32_t>(address, line.now);
  };
  const auto sent = static_cast<std::uint32_t>(line.escs[2]->clock().local_time(line.now));
  EXPECT_EQ(at(2, 1), sent);
  EXPECT_EQ(at(1, 1), sent + 350U);
  EXPECT_EQ(at(1, 0), sent + 350U);
  EXPECT_EQ(at(2, 0), sent + 2 * 350U);
  EXPECT_EQ(at(0, 0), 0U) << "before the break";
  EXPECT_EQ(at(0, 1), 0U);
  // A frame that does not latch leaves the latched times unchanged.
  line.now += 1us;
  line.send(Command::brd, address_of(0, reg::receive_time_port), Bytes(4), Segment::Port::secondary);
  EXPECT_EQ(at(2, 1), sent);
}

// 0900h: any write with an address match counts, but only BWR and FPWR latch at the ports (data sheets of the ESCs).
TEST(Segment, PortReceiveTimesByBroadcastAndStationOnly) {
  Line line(2, 100ns);
  line.put<std::uint16_t>(0, reg::station_address, 5);
  const auto port0 = [&line] { return line.get<std::uint32_t>(0, reg::receive_time_port); };
  const auto unit = [&line] { return line.get<std::uint32_t>(0, reg::receive_time_processing_unit); };
  line.send(Command::bwr, address_of(0, reg::receive_time_port), Bytes(4));
  const std::uint32_t first = port0();
  EXPECT_EQ(unit(), first);
  line.now += 1us;
  EXPECT_EQ(line.send(Command::apwr, address_of(0, reg::receive_time_port), Bytes(4)).counter, 1U);
  EXPECT_EQ(port0(), first);
  EXPECT_EQ(unit(), first + 1000);
  line.now += 1us;
  EXPECT_EQ(line.send(Command::fpwr, address_of(5, reg::receive_time_port), Bytes(4)).counter, 1U);
  EXPECT_EQ(port0(), first + 2000);
  line.set_fmmu(0, 0, 0x09000000, 4, reg::receive_time_port, 2);
  line.now += 1us;
  EXPECT_EQ(line.send(Command::lwr, 0x09000000, Bytes(4)).counter, 1U);
  EXPECT_EQ(port0(), first + 2000) << "by a logical address";
}

}  // namespace
}  // namespace ethercat_segment_test
}  // namespace servodrome::ethercat::test
