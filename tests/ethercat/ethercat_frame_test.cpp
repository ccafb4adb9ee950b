#include "esc_rig.hpp"

// Frames, commands and working counters by ETG.1000.4 clauses 5.3 and 5.4.
namespace servodrome::ethercat::test {
namespace ethercat_frame_test {
namespace {

constexpr std::uint16_t ram = 0x1000;

TEST(Frame, LayoutByteForByte) {
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  const auto data = writer.add(Command::fprd, 0x21, address_of(0x1001, 0x0130), 2);
  EXPECT_EQ(data.size(), 2U);
  writer.add(Command::brd, 0x22, address_of(0, 0x0110), 1)[0] = 0xEE;
  const Bytes expected{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4,
                       0x1B, 0x10,  // 27 bytes, type 1
                       0x04, 0x21, 0x01, 0x10, 0x30, 0x01, 0x02, 0x80, 0,    0,    0,    0,    0,    0,  // more follows
                       0x07, 0x22, 0x00, 0x00, 0x10, 0x01, 0x01, 0x00, 0,    0,    0xEE, 0,    0};
  EXPECT_EQ(Bytes(writer.bytes().begin(), writer.bytes().end()), expected);
}

struct Encapsulated {
  const char* name;
  Bytes head;
  FrameKind kind;
};

TEST(Frame, IsFoundInEveryEncapsulation) {
  const Bytes addresses{1, 1, 5, 1, 0, 0, 0x10, 2, 3, 4, 5, 6};
  const Bytes ip{0x45, 0, 0, 0, 0, 0, 0, 0, 64, 17, 0, 0, 10, 0, 0, 1, 255, 255, 255, 255};
  const Bytes ip_options{0x46, 0, 0, 0, 0, 0, 0, 0, 64, 17, 0, 0, 10, 0, 0, 1, 255, 255, 255, 255, 1, 1, 1, 1};
  Bytes ip_tcp = ip;
  ip_tcp[9] = 6;
  const Bytes udp{0x12, 0x34, 0x88, 0xA4, 0, 0, 0xAB, 0xCD};
  const Bytes other_port{0x88, 0xA4, 0x12, 0x34, 0, 0, 0xAB, 0xCD};
  const auto join = [&](std::initializer_list<Bytes> parts) {
    Bytes all = addresses;
    for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
  };
  const Bytes vlan{0x81, 0x00, 0x20, 0x05};
  const Encapsulated cases[] = {
      {"plain", join({{0x88, 0xA4}}), FrameKind::ethercat},
      {"vlan", join({vlan, {0x88, 0xA4}}), FrameKind::ethercat},
      {"udp", join({{0x08, 0x00}, ip, udp}), FrameKind::ethercat},
      {"udp, options", join({{0x08, 0x00}, ip_options, udp}), FrameKind::foreign},
      {"vlan, udp", join({vlan, {0x08, 0x00}, ip, udp}), FrameKind::ethercat},
      {"another port", join({{0x08, 0x00}, ip, other_port}), FrameKind::foreign},
      {"tcp", join({{0x08, 0x00}, ip_tcp, udp}), FrameKind::foreign},
      {"arp", join({{0x08, 0x06}}), FrameKind::foreign},
  };
  for (const Encapsulated& one : cases) {
    Line line(1);
    Bytes bytes = one.head;
    const Bytes datagram{0x0E, 0x10, 7, 0, 0, 0, 0x05, 0x00, 2, 0, 0, 0, 0, 0, 0, 0};
    bytes.insert(bytes.end(), datagram.begin(), datagram.end());
    Frame frame;
    EXPECT_EQ(parse_ethernet(bytes, frame), one.kind) << one.name;
    const auto passage = line.segment->process(bytes, line.now);
    if (one.kind == FrameKind::ethercat) {
      EXPECT_EQ(passage.exit, Segment::Exit::primary) << one.name;
      EXPECT_EQ(bytes[bytes.size() - 2], 1) << one.name;  // working counter
      EXPECT_EQ(bytes[bytes.size() - 4], 8) << one.name;  // sync managers
      EXPECT_EQ(bytes[6], 0x12) << one.name;              // source address: locally administered
      if (frame.udp_checksum != nullptr) {
        EXPECT_EQ(load_u16(frame.udp_checksum), 0) << one.name;
      }
    } else {
      EXPECT_EQ(passage.exit, Segment::Exit::lost) << one.name;  // DL control bit 0: only EtherCAT
    }
  }
}

TEST(Frame, OtherProtocolsPassWhenDlControlAllows) {
  Line line(2);
  line.send(Command::bwr, address_of(0, reg::dl_control), {0x00});
  Bytes arp(60, 0x5A);
  arp[12] = 0x08, arp[13] = 0x06;
  const Bytes before = arp;
  EXPECT_EQ(line.segment->process(arp, line.now).exit, Segment::Exit::primary);
  EXPECT_EQ(arp, before);
  // EtherCAT frames then keep their source address.
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  writer.add(Command::brd, 0, 0, 1);
  line.segment->process(writer.bytes(), line.now);
  EXPECT_EQ(memory[6], 0x10);
}

// The checksum of the UDP packet is no longer valid, regardless of DL control.
TEST(Frame, UdpChecksumIsClearedByEverySlave) {
  Line line(1);
  line.send(Command::bwr, address_of(0, reg::dl_control), {0x00});
  Bytes frame{1, 1,  5,  1, 0, 0,  0x10, 2, 3, 4,   5,   6,   0x08, 0x00, 0x45, 0,    0,    0, 0, 0,    0,
              0, 64, 17, 0, 0, 10, 0,    0, 1, 255, 255, 255, 255,  0x12, 0x34, 0x88, 0xA4, 0, 0, 0xAB, 0xCD};
  const Bytes datagram{0x0D, 0x10, 7, 0, 0, 0, 0x05, 0x00, 1, 0, 0, 0, 0, 0, 0};
  frame.insert(frame.end(), datagram.begin(), datagram.end());
  EXPECT_EQ(line.segment->process(frame, line.now).exit, Segment::Exit::primary);
  EXPECT_EQ(frame[40] | frame[41], 0);
  EXPECT_EQ(frame[6], 0x10);  // the source address stays
}

TEST(Frame, PayloadOfUdp) {
  Line line(3);
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::payload(memory);
  writer.add(Command::brd, 0, 0, 1);
  const auto exit =
      line.segment->process(writer.bytes(), line.now, Segment::Port::primary, Segment::Encapsulation::payload).exit;
  EXPECT_EQ(exit, Segment::Exit::primary);
  EXPECT_EQ(memory[2 + 10], 0x11);
  EXPECT_EQ(memory[2 + 11], 3);
}

TEST(Frame, MalformedIsForwardedAndCounted) {
  Line line(2);
  line.put<std::uint16_t>(0, reg::station_address, 7);
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  writer.add(Command::bwr, 0, address_of(0, reg::station_address), 2)[0] = 0x99;
  const std::size_t whole = writer.bytes().size();
  // Every shorter length that still has the EtherType of EtherCAT.
  unsigned malformed = 0;
  for (std::size_t length = 14; length < whole; ++length) {
    Bytes cut(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(length));
    const auto exit = line.segment->process(cut, line.now).exit;
    EXPECT_EQ(exit, Segment::Exit::primary) << length;
    ++malformed;
  }
  // "More follows" is set on the last datagram.
  Bytes more(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(whole));
  more[14 + 2 + 7] |= 0x80;
  line.segment->process(more, line.now);
  ++malformed;
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), malformed);
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::processing_unit_errors), malformed);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::station_address), 7);  // no datagram of them was executed
  line.put<std::uint8_t>(0, reg::processing_unit_errors, 0);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 0);
  EXPECT_EQ(line.get<std::uint8_t>(1, reg::processing_unit_errors), malformed);
}

TEST(Frame, CountersStopAt255) {
  Line line(1);
  Bytes broken(20, 0);
  broken[12] = 0x88, broken[13] = 0xA4, broken[15] = 0x10;
  for (int i = 0; i < 300; ++i) line.segment->process(broken, line.now);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 255);
}

TEST(Frame, MailboxGatewayTypePassesUnprocessed) {
  Line line(1);
  line.send(Command::bwr, address_of(0, reg::dl_control), {0x00});
  Bytes frame(60, 0);
  frame[12] = 0x88, frame[13] = 0xA4, frame[15] = 0x50;  // type 5
  const Bytes before = frame;
  EXPECT_EQ(line.segment->process(frame, line.now).exit, Segment::Exit::primary);
  EXPECT_EQ(frame, before);
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::processing_unit_errors), 0);
}

struct CommandCase {
  const char* name;
  Command command;
  std::uint32_t address;
  unsigned counter;
  std::uint16_t position;  // after three slaves
  Bytes answer;            // to 0x0F 0x0F
  Bytes memory0, memory1, memory2;
};

// Three slaves with stations 101..103 and 11h 11h, 22h 22h, 44h 44h at 1000h; every command with data 0Fh 0Fh.
TEST(Commands, EveryOneByTheBook) {
  const Bytes m0{0x11, 0x11}, m1{0x22, 0x22}, m2{0x44, 0x44}, sent{0x0F, 0x0F};
  const auto second = address_of(0xFFFF, ram);
  const CommandCase cases[] = {
      {"NOP", Command::nop, address_of(0, ram), 0, 0, sent, m0, m1, m2},
      {"APRD", Command::aprd, second, 1, 2, m1, m0, m1, m2},
      {"APWR", Command::apwr, second, 1, 2, sent, m0, sent, m2},
      {"APRW", Command::aprw, second, 3, 2, m1, m0, sent, m2},
      {"FPRD", Command::fprd, address_of(102, ram), 1, 102, m1, m0, m1, m2},
      {"FPWR", Command::fpwr, address_of(102, ram), 1, 102, sent, m0, sent, m2},
      {"FPRW", Command::fprw, address_of(102, ram), 3, 102, m1, m0, sent, m2},
      {"BRD", Command::brd, address_of(0, ram), 3, 3, {0x7F, 0x7F}, m0, m1, m2},
      {"BWR", Command::bwr, address_of(0, ram), 3, 3, sent, sent, sent, sent},
      {"BRW", Command::brw, address_of(0, ram), 9, 3, {0x7F, 0x7F}, sent, {0x1F, 0x1F}, {0x3F, 0x3F}},
      {"ARMW", Command::armw, second, 3, 2, m1, sent, m1, m1},
      {"FRMW", Command::frmw, address_of(102, ram), 3, 102, m1, sent, m1, m1},
      {"FPRD, nobody", Command::fprd, address_of(99, ram), 0, 99, sent, m0, m1, m2},
      {"APRD, behind the end", Command::aprd, address_of(0xFFFD, ram), 0, 0, sent, m0, m1, m2},
      {"15", static_cast<Command>(15), address_of(0, ram), 0, 0, sent, m0, m1, m2},
      {"255", static_cast<Command>(255), address_of(0, ram), 0, 0, sent, m0, m1, m2},
  };
  for (const CommandCase& one : cases) {
    Line line(3);
    for (std::uint16_t i = 0; i < 3; ++i) {
      line.put<std::uint16_t>(i, reg::station_address, static_cast<std::uint16_t>(101 + i));
      line.put<std::uint16_t>(i, ram, static_cast<std::uint16_t>(0x1111 << i));
    }
    const Answer answer = line.send(one.command, one.address, sent);
    EXPECT_EQ(answer.counter, one.counter) << one.name;
    EXPECT_EQ(answer.data, one.answer) << one.name;
    EXPECT_EQ(answer.position, one.position) << one.name;
    EXPECT_EQ(line.read(0, ram, 2).data, one.memory0) << one.name;
    EXPECT_EQ(line.read(1, ram, 2).data, one.memory1) << one.name;
    EXPECT_EQ(line.read(2, ram, 2).data, one.memory2) << one.name;
  }
}

TEST(Commands, LogicalOnesByTheBook) {
  for (const auto& [command, counter] : {std::pair{Command::lrd, 2U}, {Command::lwr, 2U}, {Command::lrw, 6U}}) {
    Line line(2);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto logical = static_cast<std::uint32_t>(0x10000 + 8 * i);
      line.set_fmmu(i, 0, logical, 4, 0x1000, 2);
      line.set_fmmu(i, 1, logical + 4, 4, 0x1100, 1);
      line.put<std::uint32_t>(i, 0x1100, static_cast<std::uint32_t>(0xA0B0C0D0 + i));
    }
    const Answer answer = line.send(command, 0x10000, counting(16));
    EXPECT_EQ(answer.counter, counter);
    const bool reads = command != Command::lwr;
    const bool writes = command != Command::lrd;
    EXPECT_EQ(load_u32(&answer.data[4]), reads ? 0xA0B0C0D0 : 0x08070605U);
    EXPECT_EQ(load_u32(&answer.data[12]), reads ? 0xA0B0C0D1 : 0x100F0E0DU);
    EXPECT_EQ(load_u32(&answer.data[0]), 0x04030201U);
    EXPECT_EQ(line.get<std::uint32_t>(1, 0x1000), writes ? 0x0C0B0A09U : 0U);
    EXPECT_EQ(answer.position, 0x0000);  // a logical address is not incremented
  }
}

TEST(Commands, SeveralDatagramsInOrder) {
  Line line(1);
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  writer.add(Command::apwr, 1, address_of(0, ram), 1)[0] = 5;
  const auto first = writer.add(Command::aprd, 2, address_of(0, ram), 1);
  writer.add(Command::apwr, 3, address_of(0, ram), 1)[0] = 6;
  const auto second = writer.add(Command::aprd, 4, address_of(0, ram), 1);
  line.segment->process(writer.bytes(), line.now);
  EXPECT_EQ(first[0], 5);
  EXPECT_EQ(second[0], 6);
}

TEST(Commands, LongestFrameAndMostDatagrams) {
  Line line(1);
  const Answer answer = line.send(Command::bwr, address_of(0, ram), counting(max_datagram_data));
  EXPECT_EQ(answer.counter, 1U);
  EXPECT_EQ(line.read(0, ram, max_datagram_data).data, counting(max_datagram_data));
  std::array<std::uint8_t, max_frame> memory;
  FrameWriter writer = FrameWriter::ethernet(memory);
  while (writer.room() >= 0) writer.add(Command::nop, 0, 0, 0);
  Frame frame;
  EXPECT_EQ(parse_ethernet(writer.bytes(), frame), FrameKind::ethercat);
  EXPECT_EQ(frame.datagrams().size(), max_datagrams);
  EXPECT_TRUE(writer.add(Command::nop, 0, 0, 0).empty());
}

TEST(Commands, AliasAnswersWhenEnabled) {
  Line line(1);
  EXPECT_EQ(line.send(Command::fprd, address_of(0x1234, 0), {0}).counter, 0U);
  line.put<std::uint8_t>(0, reg::dl_control + 3, 1);
  EXPECT_EQ(line.send(Command::fprd, address_of(0x1234, 0), {0}).counter, 1U);
}

TEST(Commands, BeyondTheMemoryNothingAnswers) {
  Line line(1);
  EXPECT_EQ(line.read(0, Esc::memory_size, 4).counter, 0U);
  EXPECT_EQ(line.write(0, 0xFFFF, {1}).counter, 0U);
  EXPECT_EQ(line.read(0, Esc::memory_size - 1, 4).counter, 1U);  // one byte of it exists
}

TEST(Commands, InterruptFieldCarriesTheMaskedEvents) {
  Line line(2);
  line.escs[1]->set_al_status(2, 0);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, 0);
  line.put<std::uint16_t>(1, reg::ecat_event_mask, 0xFFFF);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, reg::ecat_event::al_status);
  line.read(1, reg::al_status, 2);
  EXPECT_EQ(line.send(Command::nop, 0, {}).interrupt, 0);
}

}  // namespace
}  // namespace ethercat_frame_test
}  // namespace servodrome::ethercat::test
