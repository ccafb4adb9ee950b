// The conformance checks against drives on CAN, in virtual time: the reference drive passes, the makers' drives depart
// only as their manuals document, and every planted defect is found.
#include <deque>
#include <gmock/gmock.h>

#include "axis/object_catalogue.hpp"
#include "canopen/crc16.hpp"
#include "links/link_error.hpp"
#include "tools/conform/conform_can_rig.hpp"

namespace servodrome::master::conform::test {
namespace conform_can_test {
namespace {

TEST(ConformCan, TheReferenceDriveIsClean) {
  CanRig rig("generic402");
  const Report report = rig.run();
  EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::departure}), "");
  if (std::getenv("CONFORM_SHOW") != nullptr) fmt::print("{}", text_of(report, {Verdict::pass, Verdict::skipped}));
}

class Makers : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Products, Makers, testing::Values("ismc", "pronet", "ismk"));

TEST_P(Makers, DepartWhereTheirManualsSay) {
  CanRig rig(GetParam());
  const Report report = rig.run();
  expect_departures_only(report);
}

// The encoder of the ProNet manual's examples (ch. 4): a revolution must follow the encoder of the drive.
TEST(ConformCan, RevolutionsAreThoseOfTheEncoderThatIsFitted) {
  CanRig rig("pronet", "[axis.encoder]\ncounts_per_revolution = 10000\n");
  expect_departures_only(rig.run());
}

// ---- Planted defects: each simulates one wrong behaviour of the reference drive, which a certain check must find ----

void put_abort(Frame& frame, std::uint32_t code) {
  for (unsigned i = 0; i < 4; ++i) frame.data[4 + i] = static_cast<std::uint8_t>(code >> 8 * i);
}

// A defect modifies the frames in both directions.
struct Defect {
  const char* name;
  const char* check;                              // the check that must find it
  std::function<bool(CanRig&, Frame&)> to_drive;  // false: the frame is lost
  std::function<bool(CanRig&, Frame&)> from_drive;
};

// Modifies the bits of 6041h.
std::function<bool(CanRig&, Frame&)> statusword(std::function<unsigned(CanRig&, unsigned)> change) {
  return [change = std::move(change)](CanRig& rig, Frame& frame) {
    if (is_answer(frame, 0x6041)) put_word(frame, change(rig, word_in(frame)));
    return true;
  };
}
std::function<bool(CanRig&, Frame&)> abort_code(std::uint32_t from, std::uint32_t to) {
  return [=](CanRig&, Frame& frame) {
    std::uint32_t code = 0;
    std::memcpy(&code, &frame.data[4], sizeof code);
    if (frame.id == 0x585 && frame.data[0] == 0x80 && code == from) put_abort(frame, to);
    return true;
  };
}
std::function<bool(CanRig&, Frame&)> controlword(std::function<unsigned(CanRig&, unsigned)> change) {
  return [change = std::move(change)](CanRig& rig, Frame& frame) {
    if (is_write(frame, 0x6040)) put_word(frame, change(rig, word_in(frame)));
    return true;
  };
}
// Replaces the refusal of a write by a confirmation.
std::function<bool(CanRig&, Frame&)> confirmed(std::uint16_t index) {
  return [=](CanRig& rig, Frame& frame) {
    const bool refused =
        rig.writes && frame.id == 0x585 && frame.data[0] == 0x80 && (frame.data[1] | frame.data[2] << 8) == index;
    if (refused) frame.data = {0x60, frame.data[1], frame.data[2], frame.data[3]};
    return true;
  };
}
// Replaces a number that the master writes.
std::function<bool(CanRig&, Frame&)> written(std::uint16_t index, std::uint8_t sub, unsigned from, unsigned to) {
  return [=](CanRig&, Frame& frame) {
    if (is_write(frame, index) && frame.data[3] == sub && word_in(frame) == from) put_word(frame, to);
    return true;
  };
}

// In the cyclic modes RPDO 1 has controlword and target, TPDO 1 statusword and position, TPDO 2 the actual value.
bool is_targets(const Frame& frame) { return frame.id == 0x205; }
std::int32_t target_in(const Frame& frame) {
  std::int32_t value = 0;
  std::memcpy(&value, &frame.data[2], frame.length == 4 ? 2 : 4);
  return frame.length == 4 ? static_cast<std::int16_t>(value) : value;
}
void put_target(Frame& frame, std::int32_t value) { std::memcpy(&frame.data[2], &value, frame.length == 4 ? 2 : 4); }
std::function<bool(CanRig&, Frame&)> cyclic_controlword(std::function<unsigned(unsigned)> change) {
  return [change = std::move(change)](CanRig&, Frame& frame) {
    if (!is_targets(frame)) return true;
    const unsigned word = change(static_cast<unsigned>(frame.data[0] | frame.data[1] << 8));
    frame.data[0] = static_cast<std::uint8_t>(word);
    frame.data[1] = static_cast<std::uint8_t>(word >> 8);
    return true;
  };
}
std::function<bool(CanRig&, Frame&)> cyclic_statusword(std::function<unsigned(unsigned)> change) {
  return [change = std::move(change)](CanRig&, Frame& frame) {
    if (frame.id != 0x185) return true;
    const unsigned word = change(static_cast<unsigned>(frame.data[0] | frame.data[1] << 8));
    frame.data[0] = static_cast<std::uint8_t>(word);
    frame.data[1] = static_cast<std::uint8_t>(word >> 8);
    return true;
  };
}
std::function<bool(CanRig&, Frame&)> targets(std::function<std::int32_t(std::int32_t)> change) {
  return [change = std::move(change)](CanRig&, Frame& frame) {
    if (is_targets(frame) && (frame.data[0] & 0x0F) == 0x0F) put_target(frame, change(target_in(frame)));
    return true;
  };
}
// Delays the targets by 400 ms.
std::function<std::int32_t(std::int32_t)> late() {
  return [before = std::deque<std::int32_t>()](std::int32_t target) mutable {
    before.push_back(target);
    if (before.size() > 100) before.pop_front();
    return before.front();
  };
}
// Adds an error to the target that grows by `step` in each cycle.
std::function<std::int32_t(std::int32_t)> drifting(std::int32_t step) {
  return [step, sum = 0](std::int32_t target) mutable { return target + (sum += step); };
}
// Makes the position shown by SDO drift while the axis is enabled and no PDO commands a target.
std::function<bool(CanRig&, Frame&)> creeping() {
  return [sum = 0](CanRig& rig, Frame& frame) mutable {
    if (!is_answer(frame, 0x6064) || (rig.control & 0x0F) != 0x0F) return true;
    std::int32_t position = 0;
    std::memcpy(&position, &frame.data[4], sizeof position);
    position += sum += 100;
    std::memcpy(&frame.data[4], &position, sizeof position);
    return true;
  };
}
// Shows a change of the mode of operation but does not make it.
Defect mode_stays(const char* name, const char* check, std::uint8_t mode) {
  return {name, check,
          [mode](CanRig&, Frame& frame) {
            if (is_write(frame, 0x6060) && frame.data[4] == 1) frame.data[4] = mode;
            return true;
          },
          [](CanRig& rig, Frame& frame) {
            if (is_answer(frame, 0x6061)) frame.data[4] = static_cast<std::uint8_t>(rig.mode);
            return true;
          }};
}
// Modifies requests or answers of LSS.
std::function<bool(CanRig&, Frame&)> lss(std::uint32_t can_id, std::uint8_t command,
                                         std::function<bool(Frame&)> change) {
  return [=, change = std::move(change)](CanRig&, Frame& frame) {
    return frame.id != can_id || frame.data[0] != command || change(frame);
  };
}
std::function<bool(CanRig&, Frame&)> lss_error_hidden(std::uint8_t command) {
  return lss(0x7E4, command, [](Frame& frame) {
    frame.data[1] = 0;
    return true;
  });
}
std::function<bool(CanRig&, Frame&)> probe_status(std::function<unsigned(unsigned)> change) {
  return [change = std::move(change)](CanRig&, Frame& frame) {
    if (is_answer(frame, 0x60B9)) put_word(frame, change(word_in(frame)));
    return true;
  };
}
// Replaces the client's abort by the end of its block download.
std::function<bool(CanRig&, Frame&)> block_kept() {
  return [value = std::array<std::byte, 4>{}](CanRig&, Frame& frame) mutable {
    if (frame.id != 0x605) return true;
    if (frame.data[0] == 0x81) std::memcpy(value.data(), &frame.data[1], value.size());
    if (frame.data[0] == 0x80) {
      const std::uint16_t crc = canopen::crc16(value);
      frame.data = {0xCD, static_cast<std::uint8_t>(crc), static_cast<std::uint8_t>(crc >> 8)};
    }
    return true;
  };
}
unsigned always_followed(unsigned word) { return word | 0x1000U; }
unsigned never_followed(unsigned word) { return word & ~0x1000U; }
unsigned never_halted(unsigned word) { return word & ~0x0100U; }

const std::vector<Defect> defects{
    {"set-points are never acknowledged", "pp.acknowledge", {}, statusword([](CanRig& rig, unsigned word) {
       return rig.mode == 1 ? word & ~0x1000U : word;
     })},
    {"target reached comes too early", "pp.not-reached-under-way", {}, statusword([](CanRig& rig, unsigned word) {
       return rig.mode == 1 ? word | 0x0400U : word;
     })},
    {"a set-point never replaces another",
     "pp.change-at-once",
     controlword([](CanRig& rig, unsigned word) { return rig.mode == 1 ? word & ~0x20U : word; }),
     {}},
    {"relative targets are taken for absolute",
     "pp.relative",
     controlword([](CanRig& rig, unsigned word) { return rig.mode == 1 ? word & ~0x40U : word; }),
     {}},
    {"halt is ignored", "pp.halt", controlword([](CanRig&, unsigned word) { return word & ~0x100U; }), {}},
    {"halt is ignored in profile velocity",
     "pv.halt",
     controlword([](CanRig&, unsigned word) { return word & ~0x100U; }),
     {}},
    {"speed is always zero", "pv.zero-speed", {}, statusword([](CanRig& rig, unsigned word) {
       return rig.mode == 3 ? word | 0x1000U : word;
     })},
    {"home is attained without reference",
     "homing.not-attained-while-searching",
     {},
     statusword([](CanRig& rig, unsigned word) { return rig.mode == 6 ? word | 0x1400U : word; })},
    {"the voltage bit is missing", "power.voltage-enabled", {}, statusword([](CanRig&, unsigned word) {
       return word & ~0x10U;
     })},
    {"the remote bit is missing", "power.remote", {}, statusword([](CanRig&, unsigned word) {
       return word & ~0x200U;
     })},
    {"the quick stop bit is 0", "power.statusword-operation-enabled", {}, statusword([](CanRig&, unsigned word) {
       return (word & 0x6F) == 0x27 ? word & ~0x20U : word;
     })},
    {"disable voltage is ignored",
     "power.transition-9",
     [](CanRig& rig, Frame& frame) {
       if (is_write(frame, 0x6040) && (word_in(frame) & 0x82) == 0 && rig.before == 0x0F) put_word(frame, 0x0F);
       return true;
     },
     {}},
    {"a fault cannot be reset", "fault.reset", controlword([](CanRig&, unsigned word) { return word & ~0x80U; }), {}},
    {"emergencies are missing", "fault.emergency", {}, [](CanRig&, Frame& frame) { return frame.id != 0x85; }},
    {"the error register stays 0",
     "fault.error-code",
     {},
     [](CanRig&, Frame& frame) {
       if (is_answer(frame, 0x1001)) frame.data[4] = 0;
       return true;
     }},
    {"an unsupported mode is taken",
     "mode.unsupported",
     {},
     [confirm = confirmed(0x6060)](CanRig& rig, Frame& frame) {
       if (is_answer(frame, 0x6061)) frame.data[4] = static_cast<std::uint8_t>(rig.mode);
       return confirm(rig, frame);
     }},
    {"the abort code of an absent object is another", "abort.no-object", {}, abort_code(0x06020000, 0x08000000)},
    {"the abort code of an absent sub-index is another", "abort.no-sub-index", {}, abort_code(0x06090011, 0x06020000)},
    {"the abort code of a constant is another", "abort.read-only", {}, abort_code(0x06010002, 0x06010000)},
    {"the abort code of the toggle bit is another", "sdo.toggle", {}, abort_code(0x05030000, 0x08000000)},
    {"values out of range are taken", "abort.value-range", {}, confirmed(0x6098)},
    {"any signature stores", "identity.store-signature", {}, confirmed(0x1010)},
    {"heartbeats come at half the rate",
     "nmt.heartbeat",
     [](CanRig&, Frame& frame) {
       if (is_write(frame, 0x1017)) put_word(frame, 2U * word_in(frame));
       return true;
     },
     {}},
    {"the loss of a heartbeat is not told",
     "nmt.heartbeat-consumer",
     {},
     [](CanRig&, Frame& frame) { return frame.id != 0x85; }},
    {"stop is taken for pre-operational",
     "nmt.transitions",
     [](CanRig&, Frame& frame) {
       if (frame.id == 0 && frame.data[0] == 0x02) frame.data[0] = 0x80;
       return true;
     },
     {}},
    {"the boot-up is missing",
     "nmt.reset-communication",
     {},
     [](CanRig&, Frame& frame) { return frame.id != 0x705 || frame.data[0] != 0; }},
    {"a mapping changes while its PDO is valid", "pdo.tpdo-mapping-while-valid", {}, confirmed(0x1A00)},
    {"an identifier changes while its PDO is valid", "pdo.rpdo-identifier-while-valid", {}, confirmed(0x1400)},
    {"each SYNC is answered, whatever the type", "pdo.synchronous", written(0x1800, 2, 3, 1), {}},
    {"the inhibit time is ignored", "pdo.inhibit-time", written(0x1800, 3, 500, 0), {}},
    {"the event timer is slow", "pdo.event-timer", written(0x1800, 5, 20, 40), {}},
    {"a short RPDO is taken",
     "pdo.rpdo-length",
     [](CanRig&, Frame& frame) {
       if (frame.id == 0x205) frame.length = 4;
       return true;
     },
     {}},
    {"a synchronous RPDO acts at once", "pdo.rpdo-synchronous", written(0x1400, 2, 1, 255), {}},
    {"a block is changed on its way",
     "sdo.block-download",
     [](CanRig&, Frame& frame) {
       if (frame.id == 0x605 && frame.data[0] == 0x81) frame.data[1] ^= 1;
       return true;
     },
     {}},
    {"a block with a wrong CRC is taken",
     "sdo.block-crc",
     {},
     [](CanRig&, Frame& frame) {
       if (frame.id == 0x585 && frame.data[0] == 0x80 && frame.data[4] == 0x04 && frame.data[6] == 0x04)
         frame.data = {0xA1};
       return true;
     }},
    {"a block that is aborted is taken", "sdo.block-abort", block_kept(), {}},
    {"the sequence numbers of a block are not looked at",
     "sdo.block-repeat",
     [](CanRig&, Frame& frame) {
       if (frame.id == 0x605 && frame.data[0] == 0x82) frame.data[0] = 0x81;
       return true;
     },
     {}},
    {"the abort code of a sequence number is another", "sdo.block-sequence", {}, abort_code(0x05040003, 0x08000000)},
    {"a touch probe is always on", "probe.first", {}, probe_status([](unsigned word) { return word | 0x0001U; })},
    {"the touch probes are mixed up", "probe.second", {}, probe_status([](unsigned word) {
       return word >> 8 | (word & 0xFF) << 8;
     })},
    {"a touch probe never latches", "probe.latch", {}, probe_status([](unsigned word) { return word & ~0x0202U; })},
    {"a touch probe latches another position",
     "probe.latch",
     {},
     [](CanRig&, Frame& frame) {
       if (is_answer(frame, 0x60BA)) frame.data[6] ^= 0x04;
       return true;
     }},
    {"a touch probe latches again and again",
     "probe.latch",
     {},
     [count = 0](CanRig&, Frame& frame) mutable {
       if (is_answer(frame, 0x60BA)) frame.data[4] = static_cast<std::uint8_t>(++count);
       return true;
     }},
    {"a touch probe latches when it is off", "probe.off", {}, probe_status([](unsigned word) {
       return word | 0x0002U;
     })},
    {"bit 31 of 1012h is lost",
     "time.consumer",
     [](CanRig&, Frame& frame) {
       if (is_write(frame, 0x1012)) frame.data[7] &= 0x7F;
       return true;
     },
     {}},
    {"a restricted identifier is taken", "time.identifier", {}, confirmed(0x1012)},
    {"any product code selects",
     "lss.selective",
     lss(0x7E5, 0x41,
         [](Frame& frame) {
           const std::uint32_t own = 0x34303252;
           std::memcpy(&frame.data[1], &own, sizeof own);
           return true;
         }),
     {}},
    {"a global switch is ignored", "lss.global", lss(0x7E5, 0x04, [](Frame& frame) { return frame.data[1] != 1; }), {}},
    {"LSS tells another node-ID",
     "lss.inquire",
     {},
     lss(0x7E4, 0x5E,
         [](Frame& frame) {
           ++frame.data[1];
           return true;
         })},
    {"any serial number is identified",
     "lss.identify",
     lss(0x7E5, 0x4A,
         [](Frame& frame) {
           frame.data[1] = frame.data[2] = frame.data[3] = frame.data[4] = 0;
           return true;
         }),
     {}},
    {"any node-ID is taken", "lss.node-id", {}, lss_error_hidden(0x11)},
    {"any bit rate is taken", "lss.bit-timing", {}, lss_error_hidden(0x13)},
    {"a node without node-ID keeps silent", "lss.fastscan", {}, lss(0x7E4, 0x50, [](Frame&) { return false; })},
    {"targets are said to be followed without power", "csp.follows", {}, cyclic_statusword(always_followed)},
    {"the axis drifts from a target that stays", "csp.at-rest", targets(drifting(100)), {}},
    {"the axis creeps in cyclic position", "csp.no-targets", {}, creeping()},
    {"the position is late", "csp.tracks", targets(late()), {}},
    {"halt is ignored in cyclic position", "csp.halt", cyclic_controlword(never_halted), {}},
    {"targets are said to be followed in a halt", "csp.halt", {}, cyclic_statusword([](unsigned word) {
       return (word & 0x6F) == 0x27 ? word | 0x1000U : word;
     })},
    mode_stays("cyclic position is not left", "csp.leave", 8),
    {"targets are never said to be followed", "csv.follows", {}, cyclic_statusword(never_followed)},
    {"the axis turns with a target of 0",
     "csv.at-rest",
     targets([](std::int32_t target) { return target + 30000; }),
     {}},
    {"the axis creeps in cyclic velocity", "csv.no-targets", {}, creeping()},
    {"half the velocity", "csv.tracks", targets([](std::int32_t target) { return target / 2; }), {}},
    {"halt is ignored in cyclic velocity", "csv.halt", cyclic_controlword(never_halted), {}},
    mode_stays("cyclic velocity is not left", "csv.leave", 9),
    {"torque is said to be followed without power", "cst.follows", {}, cyclic_statusword(always_followed)},
    {"there is torque with a target of 0",
     "cst.at-rest",
     targets([](std::int32_t target) { return target + 100; }),
     {}},
    {"the axis creeps in cyclic torque", "cst.no-targets", {}, creeping()},
    {"no torque is shown",
     "cst.tracks",
     {},
     [](CanRig&, Frame& frame) {
       if (frame.id == 0x285 && frame.length == 2) frame.data[0] = frame.data[1] = 0;
       return true;
     }},
    mode_stays("cyclic torque is not left", "cst.leave", 10),
    {"there is no data record",
     "ip.data-record",
     {},
     [](CanRig&, Frame& frame) {
       if (is_answer(frame, 0x60C1)) {
         frame.data[0] = 0x80;
         put_abort(frame, 0x06020000);
       }
       return true;
     }},
    {"interpolation is active without bit 4",
     "ip.active",
     cyclic_controlword([](unsigned word) { return (word & 0x1F) == 0x0F ? word | 0x10U : word; }),
     {}},
    {"the axis drifts from a position that stays", "ip.at-rest", targets(drifting(100)), {}},
    {"the axis creeps in interpolated position", "ip.no-targets", {}, creeping()},
    {"the interpolated position is late", "ip.tracks", targets(late()), {}},
    {"halt is ignored in interpolated position", "ip.halt", cyclic_controlword(never_halted), {}},
    {"interpolated position is not left", "ip.leave",
     [stays = mode_stays("", "", 7),
      active = cyclic_controlword([](unsigned word) { return (word & 0x1F) == 0x0F ? word | 0x10U : word; })](
         CanRig& rig, Frame& frame) { return stays.to_drive(rig, frame) && active(rig, frame); },
     mode_stays("", "", 7).from_drive},
};

class CanDefects : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Planted, CanDefects, testing::Range(std::size_t{0}, defects.size()));

TEST_P(CanDefects, IsFound) {
  const Defect& defect = defects[GetParam()];
  CanRig rig("generic402");
  const RunOptions options{.only = {defect.check}};
  const Report sound = rig.run(options);
  ASSERT_EQ(sound.count(Verdict::pass), 1U) << defect.check << " passes without the defect\n"
                                            << text_of(sound, {Verdict::fail, Verdict::skipped});
  rig.to_drive = [&](Frame& frame) {
    rig.before = rig.control;
    if (frame.id == 0x605) rig.writes = (frame.data[0] & 0xE0) == 0x20;
    if (is_write(frame, 0x6060)) rig.mode = static_cast<std::int8_t>(frame.data[4]);
    const bool kept = !defect.to_drive || defect.to_drive(rig, frame);
    if (is_write(frame, 0x6040)) rig.control = word_in(frame);
    return kept;
  };
  if (defect.from_drive) rig.from_drive = [&](Frame& frame) { return defect.from_drive(rig, frame); };
  const Report report = rig.run(options);
  EXPECT_THAT(failed(report), testing::ElementsAre(defect.check)) << defect.name << "\n"
                                                                  << text_of(report, {Verdict::pass, Verdict::skipped});
  for (const Outcome& outcome : report.outcomes) {
    EXPECT_TRUE(std::any_of(outcome.observations.begin(), outcome.observations.end(), [](const Observation& one) {
      return !one.met && !one.sent.empty() && !one.expected.empty() && !one.seen.empty();
    }));
  }
}

// After a run everything must be as before: the objects, the NMT state, the position.
TEST(ConformCan, TheDriveIsAsBefore) {
  CanRig rig("generic402");
  const auto values = [&] {
    std::map<ObjectAddress, std::vector<std::byte>> all;
    for (const NamedObject& object : ObjectCatalogue::standard().objects()) {
      const std::uint16_t index = object.address.index;
      // Excludes the error history and measured values, which change anyway.
      const bool measured = index == 0x1003 || index == 0x6040 || index == 0x6041 || index == 0x6061 ||
                            (index >= 0x6062 && index <= 0x606C && index != 0x6065 && index != 0x6066 &&
                             index != 0x6067 && index != 0x6068) ||
                            index == 0x6074 || (index >= 0x6077 && index <= 0x6079) || index == 0x60F4 ||
                            index == 0x60FA || index == 0x60FC || index == 0x603F || index == 0x60FD ||
                            index == 0x1013 || (index >= 0x60B9 && index <= 0x60BD);
      if (measured) continue;
      try {
        all[object.address] = rig.sdo.upload(object.address);
      } catch (const SdoError&) {
        continue;
      }
    }
    return all;
  };
  rig.sdo.write<std::uint16_t>(0x1017, 0, 70);  // not stored, so a reset of the node would lose it
  rig.sdo.write<std::uint32_t>(0x6081, 0, 123456);
  rig.sdo.write<std::uint32_t>(0x1801, 1, 0x80000000 | 0x285);
  rig.sdo.write<std::uint8_t>(0x1A01, 0, 0);
  rig.bus.send(0, {0x01, 5});
  const auto before = values();
  const auto position = rig.sdo.read<std::int32_t>(0x6064);
  const Report report = rig.run();
  EXPECT_TRUE(report.problems.empty()) << report.problems.front();
  const auto after = values();
  EXPECT_GT(before.size(), 150U);
  for (const auto& [object, value] : before) EXPECT_EQ(after.at(object), value) << text_of(object);
  Master master(rig.bus);
  EXPECT_TRUE(master.wait_for_state(5, NmtState::operational, 300ms));
  EXPECT_NEAR(rig.sdo.read<std::int32_t>(0x6064), position, 131072) << "within a revolution of where it was";
  EXPECT_EQ(rig.sdo.read<std::uint16_t>(0x6041) & 0x6F, 0x40) << "disabled";
}

// An iSMK travels by 607Ch at the end of homing, unless 6099h:05 is 1 (Table 5-14).
TEST(ConformCan, HomingChecksLeaveTheAxisAndItsPositionValue) {
  for (const char* product : {"generic402", "ismk", "pronet"}) {
    constexpr int start_counts = 1'000'000;
    CanRig rig(product, "", start_counts);
    const auto shaft = [&] { return static_cast<double>(rig.line.axes()[0]->plant().position_counts()); };
    const double value = rig.sdo.read<std::int32_t>(0x6064) - shaft();
    double furthest = 0.0;
    rig.from_drive = [&](Frame&) {
      furthest = std::max(furthest, std::abs(shaft() - start_counts));
      return true;
    };
    const Report report = rig.run({.only = {"homing"}});
    EXPECT_EQ(text_of(report, {Verdict::fail}), "") << product;
    const double revolution = std::string_view(product) == "ismk" ? 65536.0 : 131072.0;
    EXPECT_LT(furthest, revolution * 0.2) << product;
    EXPECT_NEAR(rig.sdo.read<std::int32_t>(0x6064) - shaft(), value, revolution / 25.0) << product;
  }
}

TEST(ConformCan, APositionValueThatCannotBeRestoredIsReported) {
  CanRig rig("generic402", "", 1'000'000);
  rig.to_drive = [&](Frame& frame) {
    if (is_write(frame, 0x607C) && number_in(frame) != 0) frame.data[0] = 0x2F;  // too short: the drive refuses it
    return true;
  };
  const Report report = rig.run({.only = {"homing.attained"}});
  ASSERT_EQ(report.problems.size(), 1U);
  EXPECT_THAT(report.problems[0], testing::HasSubstr("changed the position value by -99999"));
}

TEST(ConformCan, ALostLinkEndsTheRun) {
  CanRig rig("generic402");
  Time lost_at{};
  const auto lose = [&](Frame& frame) {
    if (is_write(frame, 0x60FF) && number_in(frame) != 0 && lost_at == Time{}) lost_at = rig.bus.now();
    return lost_at == Time{};
  };
  rig.to_drive = lose;
  const Report report = rig.run();
  EXPECT_TRUE(report.lost);
  EXPECT_LT(rig.bus.now() - lost_at, 30s);
  EXPECT_EQ(report.count(Verdict::fail), 1U) << text_of(report, {Verdict::fail});
  bool is_after = false;
  for (const Outcome& outcome : report.outcomes) {
    if (is_after) {
      EXPECT_EQ(text_of(outcome), text_of({outcome.check, Verdict::skipped, "the link is lost"}));
    }
    is_after = is_after || outcome.verdict == Verdict::fail;
  }
  ASSERT_FALSE(report.problems.empty());
  EXPECT_THAT(report.problems, testing::Contains(testing::HasSubstr("objects are not restored")));
}

// A program whose output breaks throws in its callback.
struct BrokenOutput {};

TEST(ConformCan, TheDriveIsAsBeforeIfACallbackThrows) {
  CanRig rig("generic402");
  rig.sdo.write<std::uint16_t>(0x1017, 0, 70);
  rig.bus.send(0, {0x01, 5});
  EXPECT_THROW(rig.run({.only = {"nmt.reset-node"}, .after = [](const Outcome&) { throw BrokenOutput{}; }}),
               BrokenOutput);
  EXPECT_EQ(rig.sdo.read<std::uint16_t>(0x1017), 70);
  Master master(rig.bus);
  EXPECT_TRUE(master.wait_for_state(5, NmtState::operational, 300ms));
}

const FalseCanClient::Change link_fails = [](Frame&) -> bool {
  throw links::LinkError(std::make_error_code(std::errc::connection_reset), "the test");
};

TEST(ConformCan, AnExceptionOfRestoringDoesNotReplaceThatOfACallback) {
  CanRig rig("generic402");
  rig.sdo.write<std::uint16_t>(0x1017, 0, 70);
  rig.bus.send(0, {0x01, 5});  // restoring this state by an NMT command throws MasterError
  const auto break_all = [&](const Outcome&) {
    rig.to_drive = link_fails;
    throw BrokenOutput{};
  };
  EXPECT_THROW(rig.run({.only = {"nmt.other-node"}, .after = break_all}), BrokenOutput);
}

TEST(ConformCan, TheDriveMonitorsThisProgramInChecksThatMoveTheAxis) {
  for (const bool watch : {true, false}) {
    CanRig rig("generic402");
    const auto before = rig.sdo.read<std::uint32_t>(0x1016, 1);
    const auto option = rig.sdo.read<std::int16_t>(0x6007);
    std::uint32_t entry = before;
    std::vector<std::uint32_t> entries_in_motion;
    rig.to_drive = [&](Frame& frame) {
      if (is_write(frame, 0x1016) && frame.data[3] == 1) entry = number_in(frame);
      if (is_write(frame, 0x60FF) && number_in(frame) != 0) entries_in_motion.push_back(entry);
      return true;
    };
    const Report report = rig.run({.watch = watch, .only = {"pv.halt"}});
    EXPECT_EQ(report.count(Verdict::pass), 1U) << text_of(report, {Verdict::fail, Verdict::skipped});
    EXPECT_THAT(entries_in_motion, testing::ElementsAre(watch ? 0x7B05DCU : before));
    EXPECT_EQ(rig.sdo.read<std::uint32_t>(0x1016, 1), before);
    EXPECT_EQ(rig.sdo.read<std::int16_t>(0x6007), option);
  }
}

// The link fails as soon as the axis has its velocity.
TEST(ConformCan, TheAxisStopsIfTheLinkFails) {
  CanRig rig("generic402");
  bool failed_link = false;
  rig.to_drive = [&](Frame& frame) {
    if (failed_link) return link_fails(frame);
    failed_link = is_write(frame, 0x60FF) && number_in(frame) != 0;
    return true;
  };
  const Report report = rig.run({.only = {"pv.halt"}});
  EXPECT_THAT(failed(report), testing::ElementsAre("pv.halt"));
  const auto counts_in_a_second = [&] {
    const auto start = rig.line.axes()[0]->plant().position_counts();
    rig.line.run_until(rig.line.now() + 1s);
    return std::abs(static_cast<double>(rig.line.axes()[0]->plant().position_counts() - start));
  };
  EXPECT_GT(counts_in_a_second(), 10'000.0);
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

TEST(ConformCan, SafeNeverEnables) {
  CanRig rig("generic402");
  const auto start = rig.line.axes()[0]->plant().position_counts();
  unsigned enables = 0;
  rig.to_drive = [&](Frame& frame) {
    if (is_write(frame, 0x6040) && (word_in(frame) & 0x0F) == 0x0F) ++enables;
    return true;
  };
  const Report report = rig.run({.safe = true});
  // Safe checks include commands that are not valid in the present state; these must have no effect.
  EXPECT_EQ(report.count(Verdict::fail), 0U);
  EXPECT_GT(report.count(Verdict::pass), 50U);
  EXPECT_EQ(rig.line.axes()[0]->plant().position_counts(), start);
  EXPECT_LE(enables, 1U);
}

TEST(ConformCan, AnInterruptedRunLeavesTheAxisAtRest) {
  for (const char* check : {"pp", "csp.tracks", "csv.tracks", "probe.latch"}) {
    CanRig rig("generic402");
    int left = 400;
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.cancelled = [&] { return --left < 0; }});
    const Report report = run_checks(subject, {.only = {check}});
    EXPECT_TRUE(report.cancelled) << check;
    EXPECT_EQ(rig.sdo.read<std::uint16_t>(0x6041) & 0x6F, 0x40) << check;
    EXPECT_NEAR(rig.sdo.read<std::int32_t>(0x606C), 0, 1000) << check;
  }
}

// --revolutions limits every motion; the speed limit is one revolution per second.
TEST(ConformCan, MotionsWithTargetsInEachCycleStayWithinBounds) {
  constexpr double revolution = 131072.0;
  for (const double revolutions : {0.1, 0.5}) {
    CanRig rig("generic402");
    double start = 0.0;
    double furthest = 0.0;
    double last = 0.0;
    Time last_time{};
    double fastest = 0.0;
    const auto position = [&] { return static_cast<double>(rig.line.axes()[0]->plant().position_counts()); };
    rig.from_drive = [&](Frame&) {
      const double now = position();
      furthest = std::max(furthest, std::abs(now - start));
      if (rig.bus.now() - last_time >= 20ms) {
        fastest =
            std::max(fastest, std::abs(now - last) / std::chrono::duration<double>(rig.bus.now() - last_time).count());
        last = now;
        last_time = rig.bus.now();
      }
      return true;
    };
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.revolutions = revolutions});
    run_checks(subject, {.only = {"csp", "csv", "cst", "ip"},
                         .before =
                             [&](const Check&) {
                               start = last = position();
                               last_time = rig.bus.now();
                               furthest = fastest = 0.0;
                             },
                         .after =
                             [&](const Outcome& outcome) {
                               EXPECT_NE(outcome.verdict, Verdict::fail) << text_of(outcome);
                               EXPECT_LE(furthest, revolution * (revolutions + 0.01)) << outcome.check->id;
                               EXPECT_LE(fastest, revolution * 1.1) << outcome.check->id;
                               if (outcome.check->demand == Demand::motion) {
                                 EXPECT_GT(furthest, revolution * revolutions / 50.0) << outcome.check->id;
                               }
                             }});
  }
}

TEST(ConformCan, AnEnabledAxisIsNotTouched) {
  CanRig rig("generic402");
  Axis402(rig.sdo).enable();
  EXPECT_THROW(rig.run(), MasterError);
  EXPECT_EQ(rig.sdo.read<std::uint16_t>(0x6041) & 0x6F, 0x27);
}

}  // namespace
}  // namespace conform_can_test
}  // namespace servodrome::master::conform::test
