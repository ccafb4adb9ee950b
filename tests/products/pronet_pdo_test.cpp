#include <gtest/gtest.h>

#include "frames.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Differences between the ProNet drive's bus interface and CiA 301: PDO types and masks, mappings, identifiers, resets,
// no remote frames, SDO without block transfer.
namespace servodrome {
namespace pronet_pdo_test {
namespace {

using dictionary::AbortCode;
using products::Pronet;
using Axis = test::Rig<Pronet>;

std::size_t count(const Axis& axis, std::uint32_t id) {
  std::size_t n = 0;
  for (const canopen::Frame& frame : axis.sent) n += frame.id == id ? 1 : 0;
  return n;
}

std::string last(const Axis& axis, std::uint32_t id) {
  for (std::size_t i = axis.sent.size(); i-- > 0;) {
    if (axis.sent[i].id == id) return test::text_of(axis.sent[i]);
  }
  return "";
}

void start(Axis& axis) { axis.send(0x000, {0x01, 0x00}); }

// The answer of the SDO server.
std::string ask(Axis& axis, const std::string& frame) {
  axis.sent.clear();
  axis.device.receive(test::frame_of(frame), axis.now());
  axis.drain();
  return last(axis, 0x581);
}

// Switches on only TPDO `number`, with this mapping.
void only(Axis& axis, unsigned number, std::initializer_list<std::uint32_t> objects, int type) {
  for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
    const auto index = static_cast<std::uint16_t>(0x1800 + pdo);
    if (pdo + 1U == number) continue;
    EXPECT_EQ(axis.set(index, 1, 0x80000000 | axis.get(index, 1)), AbortCode::none);
  }
  const auto mapping = static_cast<std::uint16_t>(0x1A00 + number - 1);
  EXPECT_EQ(axis.set(mapping, 0, 0), AbortCode::none);
  std::uint8_t sub = 0;
  for (const std::uint32_t object : objects) EXPECT_EQ(axis.set(mapping, ++sub, object), AbortCode::none);
  EXPECT_EQ(axis.set(mapping, 0, sub), AbortCode::none);
  EXPECT_EQ(axis.set(static_cast<std::uint16_t>(0x1800 + number - 1), 2, type), AbortCode::none);
}

// By factory setting every TPDO is sent each 10 ms, with or without changes (ch. 3.3).
TEST(PronetPdo, FromTheFactoryAllAreSentEvery10Ms) {
  Axis axis;
  axis.run_ms(1);
  start(axis);
  axis.sent.clear();
  axis.run_ms(100.5);
  for (const std::uint32_t id : {0x181U, 0x281U, 0x381U, 0x481U}) EXPECT_EQ(count(axis, id), 10U) << std::hex << id;
  EXPECT_EQ(last(axis, 0x181), "181 # 50 00 00 00 00 00");
  EXPECT_EQ(last(axis, 0x281), "281 # 00 00 00 00 00 00") << "6061h with 16 bits";
  axis.set(0x6060, 0, 3);
  axis.run_ms(15);
  EXPECT_EQ(last(axis, 0x481), "481 # 00 00 00 00 03 00");
}

TEST(PronetPdo, Type255IsPeriodicOnly) {
  Axis axis;
  axis.run_ms(1);
  only(axis, 1, {0x60610010}, 255);
  axis.set(0x1800, 5, 50);
  start(axis);
  axis.sent.clear();
  axis.run_ms(20);
  axis.set(0x6060, 0, 3);  // a change does not trigger it
  axis.run_ms(20);
  EXPECT_EQ(count(axis, 0x181), 0U);
  axis.run_ms(461);
  EXPECT_EQ(count(axis, 0x181), 10U);
  axis.set(0x1800, 5, 0);  // no timer
  axis.sent.clear();
  axis.run_ms(200);
  EXPECT_EQ(count(axis, 0x181), 0U);
  // The inhibit time is the minimum interval, in units of 100 us (ch. 3.3, 'Transmit type of PDO').
  axis.set(0x1800, 5, 5);
  axis.set(0x1800, 3, 400);
  axis.sent.clear();
  axis.run_ms(400);
  EXPECT_GE(count(axis, 0x181), 9U);
  EXPECT_LE(count(axis, 0x181), 11U);
}

// Type 254: sent when a bit changes that the mask does not exclude (ch. 3.3).
TEST(PronetPdo, Type254IsSentOnChangesThatTheMaskLetsThrough) {
  for (unsigned number = 1; number <= 4; ++number) {
    SCOPED_TRACE(number);
    const auto mask = static_cast<std::uint16_t>(0x2000 + number - 1);
    const std::uint32_t id = 0x81U + 0x100U * number;
    Axis axis;
    axis.run_ms(1);
    // 6081h is data bytes 0 to 3, 60FFh bytes 4 to 7.
    only(axis, number, {0x60810020, 0x60FF0020}, 254);
    axis.set(static_cast<std::uint16_t>(0x1800 + number - 1), 5, 0);
    start(axis);
    axis.run_ms(20);
    const auto sends = [&](std::uint16_t index, std::int64_t value) {
      axis.sent.clear();
      axis.set(index, 0, value);
      axis.run_ms(15);  // longer than the inhibit time of 10 ms
      return count(axis, id);
    };
    EXPECT_EQ(sends(0x6081, 1), 1U);
    EXPECT_EQ(sends(0x6081, 1), 0U) << "unchanged";
    EXPECT_EQ(sends(0x60FF, 1), 1U);
    axis.set(mask, 1, 0xFFFFFF00);
    EXPECT_EQ(sends(0x6081, 0x22), 0U) << "hidden";
    EXPECT_EQ(sends(0x6081, 0x133), 1U);
    axis.set(mask, 2, 0);
    EXPECT_EQ(sends(0x60FF, 7), 0U);
    axis.set(mask, 2, 0x80000000);
    EXPECT_EQ(sends(0x60FF, 9), 0U);
    EXPECT_EQ(sends(0x60FF, -5), 1U) << "the sign bit";
    axis.set(static_cast<std::uint16_t>(0x1800 + number - 1), 5, 20);  // the timer runs as well
    axis.sent.clear();
    axis.run_ms(101);
    EXPECT_EQ(count(axis, id), 5U);
  }
}

TEST(PronetPdo, SynchronousTypes) {
  for (const int type : {1, 3, 240}) {
    Axis axis;
    axis.run_ms(1);
    only(axis, 2, {0x60410010}, type);
    EXPECT_EQ(axis.set(0x1400, 2, type), AbortCode::none);
    start(axis);
    axis.sent.clear();
    axis.send(0x201, {0x06, 0x00, 0x00, 0x00, 0x00, 0x00});
    EXPECT_EQ(axis.get(0x6040), 0) << "acts with the SYNC";
    for (int i = 0; i < 240; ++i) {
      axis.send(0x080, {});
      axis.run_ms(0.125);
    }
    EXPECT_EQ(axis.get(0x6040), 6);
    EXPECT_EQ(count(axis, 0x281), 240U / static_cast<unsigned>(type));
  }
}

TEST(PronetPdo, ReservedTypesAreRefused) {
  Axis axis;
  axis.run_ms(1);
  for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
    for (int type = 0; type < 256; ++type) {
      const bool synchronous = type >= 1 && type <= 240;
      EXPECT_EQ(axis.set(static_cast<std::uint16_t>(0x1800 + pdo), 2, type),
                synchronous || type >= 254 ? AbortCode::none : AbortCode::value_invalid)
          << type;
      EXPECT_EQ(axis.set(static_cast<std::uint16_t>(0x1400 + pdo), 2, type),
                synchronous || type == 255 ? AbortCode::none : AbortCode::value_invalid)
          << type;
    }
  }
}

TEST(PronetPdo, MappingRules) {
  Axis axis;
  axis.run_ms(1);
  const auto map = [&](std::uint8_t sub, std::int64_t value) { return axis.set(0x1A00, sub, value); };
  EXPECT_EQ(map(1, 0x60640020), AbortCode::unsupported_access) << "sub 0 is not 0";  // 0601 0000h
  EXPECT_EQ(map(0, 0), AbortCode::none);
  EXPECT_EQ(map(1, 0x605A0010), AbortCode::not_mappable);
  EXPECT_EQ(map(1, 0x10010008), AbortCode::not_mappable);
  EXPECT_EQ(map(1, 0x12340020), AbortCode::object_does_not_exist);
  EXPECT_EQ(map(1, 0x60640010), AbortCode::not_mappable) << "another length";
  EXPECT_EQ(map(1, 0x60610008), AbortCode::none);
  EXPECT_EQ(map(1, 0x60610010), AbortCode::none) << "as printed (C7)";
  EXPECT_EQ(map(1, 0x60610020), AbortCode::not_mappable);
  EXPECT_EQ(map(1, 0x60980010), AbortCode::not_mappable) << "for those two objects only";
  EXPECT_EQ(axis.set(0x1600, 0, 0), AbortCode::none);
  EXPECT_EQ(axis.set(0x1600, 1, 0x60410010), AbortCode::not_mappable) << "read-only in an RPDO";
  EXPECT_EQ(axis.set(0x1600, 1, 0x60600008), AbortCode::none);
  EXPECT_EQ(axis.set(0x1600, 1, 0x60600010), AbortCode::none);
  EXPECT_EQ(map(0, 5), AbortCode::value_invalid) << "at most four";
  AbortCode abort{};
  EXPECT_EQ(axis.device.dictionary().find(0x1A00, 5, abort), nullptr);
  EXPECT_EQ(abort, AbortCode::sub_index_does_not_exist);
  for (std::uint8_t sub = 1; sub <= 3; ++sub) EXPECT_EQ(map(sub, 0x60640020), AbortCode::none);
  EXPECT_EQ(map(0, 3), AbortCode::mapping_exceeds_pdo_length);
  EXPECT_EQ(map(0, 2), AbortCode::none);
}

// After any event, and wherever NMT forbids TPDOs meanwhile, the first TPDO afterwards shows the present state.
TEST(PronetPdo, NoTpdoShowsAnOlderState) {
  const std::vector<std::function<void(Axis&)>> steps{
      [](Axis& axis) { axis.control(0x06); },
      [](Axis& axis) { axis.control(0x07); },
      [](Axis& axis) { axis.run_ms(200), axis.control(0x0F); },
      [](Axis& axis) { axis.set(0x60FF, 0, 3000); },
      [](Axis& axis) { axis.device.drive().inject(drive::Cause::current_sensor, true); },
      [](Axis& axis) { axis.device.drive().inject(drive::Cause::current_sensor, false), axis.control(0x00); },
      [](Axis& axis) { axis.control(0x80); },
      [](Axis& axis) { axis.set(0x60FF, 0, 0), axis.control(0x00); },
      [](Axis& axis) { axis.plant.force_input(2, true); },  // POT
      [](Axis& axis) { axis.plant.force_input(2, false); },
      [](Axis& axis) { axis.set(0x6060, 0, 1), axis.control(0x06); },
      [](Axis& axis) { axis.set(0x6060, 0, 3), axis.control(0x02); },
  };
  for (const int type : {254, 255}) {
    for (const std::uint8_t command : {std::uint8_t{0}, std::uint8_t{0x02}, std::uint8_t{0x80}}) {
      SCOPED_TRACE(testing::Message() << "type " << type << " NMT " << int{command});
      Axis axis;
      axis.run_ms(1);
      axis.set(0x6060, 0, 3);
      only(axis, 1, {0x60410010}, type);
      start(axis);
      const auto text = [&axis] {
        const std::uint16_t status = axis.status();
        return test::text_of(
            {.id = 0x181, .length = 2, .data = {std::uint8_t(status & 0xFF), std::uint8_t(status >> 8)}});
      };
      // Each TPDO of these ticks has the values of its tick or of the previous one.
      const auto watch = [&](int ticks) {
        std::size_t seen = 0;
        for (int tick = 0; tick < ticks; ++tick) {
          const std::string before = text();
          axis.tick();
          if (count(axis, 0x181) != 0) {
            EXPECT_TRUE(last(axis, 0x181) == before || last(axis, 0x181) == text());
          }
          seen += count(axis, 0x181);
          axis.sent.clear();
        }
        return seen;
      };
      for (std::size_t step = 0; step < steps.size(); ++step) {
        SCOPED_TRACE(step);
        if (command != 0) axis.send(0x000, {command, 0x01});
        axis.sent.clear();
        steps[step](axis);
        axis.sent.clear();
        EXPECT_EQ(watch(320) != 0, command == 0) << "not while NMT forbids it";
        if (command == 0) continue;
        start(axis);
        if (type == 254) {
          EXPECT_EQ(last(axis, 0x181), text()) << "at once";
        }
        axis.sent.clear();
        EXPECT_NE(watch(320), 0U);
      }
    }
  }
}

// The low byte is the value and the rest is padding, in both directions (C7).
TEST(PronetPdo, EightBitObjectsInSixteenBits) {
  Axis axis;
  axis.run_ms(1);
  start(axis);
  axis.send(0x301, {0x64, 0x00, 0x00, 0x00, 0x03, 0xAA});  // RPDO 2 from the factory: 60FFh, 6060h
  EXPECT_EQ(axis.get(0x60FF), 100);
  EXPECT_EQ(axis.get(0x6060), 3);
  axis.run_ms(15);
  EXPECT_EQ(last(axis, 0x281), "281 # 00 00 00 00 03 00");
}

// C3: sub-index 0 says 4, 5 exists and 4 does not.
TEST(PronetPdo, HighestSubIndexAsPrinted) {
  Axis axis;
  axis.run_ms(1);
  EXPECT_EQ(ask(axis, "601 # 40 00 18 00 00 00 00 00"), "581 # 4F 00 18 00 04 00 00 00");
  EXPECT_EQ(ask(axis, "601 # 40 00 18 04 00 00 00 00"), "581 # 80 00 18 04 11 00 09 06");
  EXPECT_EQ(ask(axis, "601 # 40 00 18 05 00 00 00 00"), "581 # 4B 00 18 05 0A 00 00 00");
  EXPECT_EQ(ask(axis, "601 # 40 00 14 00 00 00 00 00"), "581 # 4F 00 14 00 02 00 00 00");
}

// An identifier can only be changed with bit 31; that of TPDO 1 must be between 181h and 1FFh (ch. 3.3, 1800h; ch.
// 10.2).
TEST(PronetPdo, CobIds) {
  Axis axis;
  axis.run_ms(1);
  const auto set = [&](std::uint16_t index, std::int64_t value) { return axis.set(index, 1, value); };
  EXPECT_EQ(set(0x1400, 0x202), AbortCode::value_invalid);
  EXPECT_EQ(set(0x1400, 0x80000202), AbortCode::none);
  EXPECT_EQ(set(0x1400, 0x202), AbortCode::none);
  EXPECT_EQ(set(0x1800, 0x80000281), AbortCode::value_invalid);
  EXPECT_EQ(set(0x1800, 0x80000180), AbortCode::value_invalid);
  EXPECT_EQ(set(0x1800, 0x800001FF), AbortCode::none);
  EXPECT_EQ(set(0x1800, 0x1FF), AbortCode::none);
  EXPECT_EQ(set(0x1801, 0x80000381), AbortCode::none);
  // A PDO that is switched off has a valid identifier, or none (CiA 301 7.3.5).
  for (const std::uint16_t index : {std::uint16_t{0x1402}, std::uint16_t{0x1802}}) {
    for (const std::int64_t id : {0x701, 0x77F, 0x581, 0x601, 0x67F, 0x101, 0x17F, 0x001, 0x6E0}) {
      EXPECT_EQ(set(index, 0x80000000 | id), AbortCode::value_invalid) << std::hex << id;
      EXPECT_EQ(set(index, id), AbortCode::value_invalid) << std::hex << id;
    }
    EXPECT_EQ(set(index, 0x80000000), AbortCode::none);
    EXPECT_EQ(set(index, 0), AbortCode::value_invalid) << "not to be switched on without one";
    EXPECT_EQ(set(index, 0x800003A1), AbortCode::none);
    EXPECT_EQ(set(index, 0x3A1), AbortCode::none);
  }
  // 1016h: nodes 1 to 127.
  for (const std::int64_t node : {128, 129, 200, 255}) {
    EXPECT_EQ(axis.set(0x1016, 1, node << 16 | 100), AbortCode::value_invalid) << node;
  }
  for (const std::int64_t node : {1, 127}) EXPECT_EQ(axis.set(0x1016, 1, node << 16 | 100), AbortCode::none) << node;
  EXPECT_EQ(axis.set(0x1016, 1, 0), AbortCode::none);
  // 1005h accepts only 80h, with or without bit 31 (ch. 3.4).
  for (const std::int64_t value : {0x80LL, 0x80000080LL}) EXPECT_EQ(axis.set(0x1005, 0, value), AbortCode::none);
  for (const std::int64_t value : {0x40000080LL, 0x81LL, 0xC0000080LL, 0x20000080LL, 0LL}) {
    EXPECT_EQ(axis.set(0x1005, 0, value), AbortCode::value_invalid) << value;
  }
}

// NMT 82h keeps all values, 81h restores the objects to their reset values (ch. 3.7 and 9.2).
TEST(PronetPdo, ResetCommunicationKeepsWhatResetNodeLoses) {
  Axis axis;
  axis.run_ms(1);
  only(axis, 1, {0x606C0020, 0x60FD0020}, 254);
  axis.set(0x1400, 2, 7);
  axis.set(0x1017, 0, 100);
  axis.set(0x2000, 1, 0x0F);
  axis.set(0x6083, 0, 4711);
  axis.sent.clear();
  axis.send(0x000, {0x82, 0x01});
  EXPECT_EQ(last(axis, 0x701), "701 # 00");
  EXPECT_EQ(axis.device.node().nmt_state(), canopen::NmtState::pre_operational);
  EXPECT_EQ(axis.get(0x1A00, 1), 0x606C0020);
  EXPECT_EQ(axis.get(0x1801, 1), 0x80000281);
  EXPECT_EQ(axis.get(0x1400, 2), 7);
  EXPECT_EQ(axis.get(0x1017), 100);
  EXPECT_EQ(axis.get(0x2000, 1), 0x0F);
  EXPECT_EQ(axis.get(0x6083), 4711);
  axis.send(0x000, {0x81, 0x01});
  EXPECT_EQ(last(axis, 0x701), "701 # 00");
  EXPECT_EQ(axis.get(0x1A00, 1), 0x60410010);
  EXPECT_EQ(axis.get(0x1801, 1), 0x281);
  EXPECT_EQ(axis.get(0x1400, 2), 255);
  EXPECT_EQ(axis.get(0x1017), 0);
  EXPECT_EQ(axis.get(0x2000, 1), 0xFFFFFFFF);
  EXPECT_EQ(axis.get(0x6083), 100000);
}

// After both resets, the masks act as their objects show.
TEST(PronetPdo, MasksAfterResets) {
  Axis axis;
  axis.run_ms(1);
  const auto sends_a_change = [&](std::uint8_t reset) {
    axis.send(0x000, {reset, 0x01});
    only(axis, 1, {0x60810020}, 254);
    axis.set(0x1800, 5, 0);
    start(axis);
    axis.run_ms(20);
    axis.sent.clear();
    axis.set(0x6081, 0, axis.get(0x6081) + 1);
    axis.run_ms(15);
    return count(axis, 0x181) == 1;
  };
  axis.set(0x2000, 1, 0);
  EXPECT_FALSE(sends_a_change(0x82));
  EXPECT_TRUE(sends_a_change(0x81));
}

// A frame with the set-points of four drives of 16 bits each, and one with parts of 8 bits: dummies of every width.
TEST(PronetPdo, DummiesOfEveryWidth) {
  struct Dummy {
    std::uint32_t entry;
    std::size_t bytes;
  };
  for (const Dummy& dummy : {Dummy{0x00020008, 1}, Dummy{0x00030010, 2}, Dummy{0x00040020, 4}, Dummy{0x00050008, 1},
                             Dummy{0x00060010, 2}, Dummy{0x00070020, 4}}) {
    Axis axis;
    axis.run_ms(1);
    EXPECT_EQ(axis.set(0x1600, 0, 0), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 1, dummy.entry), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 2, 0x60FF0020), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 0, 2), AbortCode::none);
    start(axis);
    std::vector<std::uint8_t> data(dummy.bytes, 0x55);
    for (std::uint8_t byte = 1; byte <= 4; ++byte) data.push_back(byte);
    axis.send(0x201, data);
    EXPECT_EQ(axis.get(0x60FF), 0x04030201);
    EXPECT_EQ(axis.get(static_cast<std::uint16_t>(dummy.entry >> 16)), 0) << "what is received is thrown away";
    EXPECT_EQ(axis.set(0x1A00, 0, 0), AbortCode::none);
    EXPECT_EQ(axis.set(0x1A00, 1, dummy.entry), AbortCode::not_mappable) << "fillers are for RPDOs";
  }
  Axis axis;
  EXPECT_EQ(axis.device.dictionary().find(0x0001, 0), nullptr);
}

// Two drives use one frame and move in opposite directions (ch. 10.2).
TEST(PronetPdo, OneFrameMovesTwoDrives) {
  Axis one(test::default_plant(), {.node_id = 1});
  Axis two(test::default_plant(), {.node_id = 2});
  Axis* axes[] = {&one, &two};
  for (std::size_t i = 0; i < 2; ++i) {
    Axis& axis = *axes[i];
    axis.run_ms(1);
    axis.set(0x6060, 0, 3);
    ASSERT_TRUE(axis.enable());
    EXPECT_EQ(axis.set(0x1600, 0, 0), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 1, i == 0 ? 0x60FF0020 : 0x00040020), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 2, i == 0 ? 0x00040020 : 0x60FF0020), AbortCode::none);
    EXPECT_EQ(axis.set(0x1600, 0, 2), AbortCode::none);
    EXPECT_EQ(axis.set(0x1400, 1, 0x80000300), AbortCode::none);
    EXPECT_EQ(axis.set(0x1400, 1, 0x300), AbortCode::none);
    start(axis);
  }
  for (Axis* axis : axes) {
    axis->send(0x300, {0xE8, 0x03, 0x00, 0x00, 0x18, 0xFC, 0xFF, 0xFF});  // 1000 and -1000
    axis->run_ms(300);
  }
  EXPECT_NEAR(one.plant.velocity_rpm(), 100.0, 1.0);
  EXPECT_NEAR(two.plant.velocity_rpm(), -100.0, 1.0);
}

TEST(PronetPdo, NoRemoteFrames) {
  Axis axis;
  axis.run_ms(1);
  for (const bool operational : {false, true}) {
    if (operational) {
      only(axis, 4, {0x60410010}, 255);
      axis.set(0x1803, 5, 0);
      start(axis);
    }
    axis.sent.clear();
    for (const std::uint32_t id : {0x701U, 0x181U, 0x281U, 0x381U, 0x481U}) axis.send(id, {}, true);
    axis.run_ms(20);
    EXPECT_TRUE(axis.sent.empty());
  }
  EXPECT_EQ(axis.device.dictionary().find(0x100C, 0), nullptr);
  EXPECT_EQ(axis.device.dictionary().find(0x100D, 0), nullptr);
}

TEST(PronetSdo, NoBlockTransferAndTheListedAborts) {
  Axis axis;
  axis.run_ms(1);
  EXPECT_EQ(ask(axis, "601 # A0 00 10 00 7F 00 00 00"), "581 # 80 00 10 00 01 00 04 05");
  EXPECT_EQ(ask(axis, "601 # C6 81 60 00 04 00 00 00"), "581 # 80 81 60 00 01 00 04 05");
  EXPECT_EQ(ask(axis, "601 # 23 41 60 00 00 00 00 00"), "581 # 80 41 60 00 02 00 01 06");  // read-only
  EXPECT_EQ(ask(axis, "601 # 40 12 10 00 00 00 00 00"), "581 # 80 12 10 00 00 00 02 06");  // 1012h (C37)
  EXPECT_EQ(ask(axis, "601 # 23 60 60 00 01 00 00 00"), "581 # 80 60 60 00 12 00 07 06");  // too long
  EXPECT_EQ(ask(axis, "601 # 2F 81 60 00 01 00 00 00"), "581 # 80 81 60 00 13 00 07 06");  // too short
  EXPECT_EQ(ask(axis, "601 # 2F 60 60 00 08 00 00 00"), "581 # 80 60 60 00 30 00 09 06");  // no such mode
  EXPECT_EQ(ask(axis, "601 # 23 A4 60 01 15 00 00 00"), "581 # 80 A4 60 01 31 00 09 06");  // 21 is too high
  EXPECT_EQ(ask(axis, "601 # 23 93 60 02 00 00 00 00"), "581 # 80 93 60 02 32 00 09 06");  // divisor 0
  EXPECT_EQ(ask(axis, "601 # E0 00 00 00 00 00 00 00"), "581 # 80 00 00 00 01 00 04 05");
  // Segmented transfer, which no object of the drive needs: a download of four bytes in one segment.
  EXPECT_EQ(ask(axis, "601 # 21 81 60 00 04 00 00 00"), "581 # 60 81 60 00 00 00 00 00");
  EXPECT_EQ(ask(axis, "601 # 07 2C 01 00 00 00 00 00"), "581 # 20 00 00 00 00 00 00 00");
  EXPECT_EQ(axis.get(0x6081), 300);
  EXPECT_EQ(ask(axis, "601 # 21 81 60 00 04 00 00 00"), "581 # 60 81 60 00 00 00 00 00");
  EXPECT_EQ(ask(axis, "601 # 17 2C 01 00 00 00 00 00"), "581 # 80 81 60 00 00 00 03 05");  // toggle bit
}

}  // namespace
}  // namespace pronet_pdo_test
}  // namespace servodrome
