#include <gtest/gtest.h>

#include "frames.hpp"
#include "ismk_rig.hpp"

// Differences between the iSMK's CANopen interface and CiA 301 (ch. 9 of its manual), interpolation on SYNC, storing
// and restarting.
namespace servodrome {
namespace ismk_canopen_test {
namespace {

using dictionary::AbortCode;
using test::frame_of;
using test::IsmkRig;

std::string sdo(IsmkRig& rig, const char* request) {
  rig.sent.clear();
  rig.device.receive(frame_of(request), rig.now());
  rig.drain();
  return rig.sent.empty() ? "" : test::text_of(rig.sent.back());
}

std::size_t frames_of(IsmkRig& rig, std::uint32_t id) {
  return static_cast<std::size_t>(
      std::count_if(rig.sent.begin(), rig.sent.end(), [id](const canopen::Frame& frame) { return frame.id == id; }));
}

// Table 9-8
TEST(IsmkCanopen, AbortCodesOfTheTable) {
  IsmkRig rig;
  rig.run_ms(5);
  EXPECT_EQ(sdo(rig, "601 # A0 41 60 00 00 00 00 00"), "581 # 80 41 60 00 01 00 04 05") << "no block transfer";
  EXPECT_EQ(sdo(rig, "601 # 2B 41 60 00 00 00 00 00"), "581 # 80 41 60 00 02 00 01 06") << "read only";
  EXPECT_EQ(sdo(rig, "601 # 40 10 10 01 00 00 00 00"), "581 # 80 10 10 01 00 00 02 06") << "no 1010h";
  EXPECT_EQ(sdo(rig, "601 # 40 99 60 07 00 00 00 00"), "581 # 80 99 60 07 11 00 09 06");
  EXPECT_EQ(sdo(rig, "601 # 23 60 60 00 01 00 00 00"), "581 # 80 60 60 00 12 00 07 06") << "too long";
  EXPECT_EQ(sdo(rig, "601 # 2F 40 60 00 06 00 00 00"), "581 # 80 40 60 00 13 00 07 06") << "too short";
  EXPECT_EQ(sdo(rig, "601 # 2F 60 60 00 02 00 00 00"), "581 # 80 60 60 00 30 00 09 06");
  EXPECT_EQ(sdo(rig, "601 # 2F 60 60 00 08 00 00 00"), "581 # 80 60 60 00 31 00 09 06");
  EXPECT_EQ(sdo(rig, "601 # 2F 60 60 00 F0 00 00 00"), "581 # 80 60 60 00 32 00 09 06");
  // A method with a hard stop, which Table 5-15 does not have, and 607Eh while enabled (ch. 5.2).
  EXPECT_EQ(sdo(rig, "601 # 2F 98 60 00 FF 00 00 00"), "581 # 80 98 60 00 30 00 09 06");
  EXPECT_EQ(sdo(rig, "601 # 2F 98 60 00 00 00 00 00"), "581 # 60 98 60 00 00 00 00 00") << "the factory value";
  rig.control(0x0F);
  rig.run_ms(2);
  EXPECT_EQ(sdo(rig, "601 # 2F 7E 60 00 01 00 00 00"), "581 # 80 7E 60 00 22 00 00 08");
  // Only objects with the letter M (Table 9-13).
  rig.set(0x1800, 1, 0x80000181);
  rig.set(0x1A00, 0, 0);
  EXPECT_EQ(sdo(rig, "601 # 23 00 1A 01 10 00 67 60"), "581 # 80 00 1A 01 41 00 04 06");
}

// Table 9-9, ch. 9.3.2 compared with ch. 8.4.2: the remaining bytes of an upload are the sign extension of the stored
// value.
TEST(IsmkCanopen, PaddingIsTheSign) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x2FF0, 9, 600);
  EXPECT_EQ(sdo(rig, "601 # 40 F0 2F 09 00 00 00 00"), "581 # 4B F0 2F 09 58 02 00 00");
  rig.set(0x2FF0, 9, -2);
  EXPECT_EQ(sdo(rig, "601 # 40 F0 2F 09 00 00 00 00"), "581 # 4B F0 2F 09 FE FF FF FF");
  EXPECT_EQ(sdo(rig, "601 # 40 60 60 00 00 00 00 00"), "581 # 4F 60 60 00 FC FF FF FF");
  rig.set(0x2605, 1, 0xFFFF);
  EXPECT_EQ(sdo(rig, "601 # 40 05 26 01 00 00 00 00"), "581 # 4B 05 26 01 FF FF FF FF") << "an UNSIGNED16 likewise";
}

// Ch. 9.3.3.3: TPDO 1 of the example, its inhibit time in milliseconds; RPDOs are of type 254 and act at once.
TEST(IsmkCanopen, PdosOfTheExample) {
  IsmkRig rig;
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x1400, 2), 254);
  rig.set(0x1800, 1, 0x80000181);
  rig.set(0x1A00, 0, 0);
  rig.set(0x1A00, 1, 0x60630020);
  rig.set(0x1A00, 2, 0x60410010);
  rig.set(0x1A00, 0, 2);
  rig.set(0x1800, 3, 50);
  rig.set(0x1800, 1, 0x181);
  rig.send(0x000, {0x01, 0x01});
  rig.set(0x6060, 0, -3);
  rig.send(0x201, {0x0F, 0x00});
  EXPECT_EQ(rig.get(0x6040), 0x0F);
  rig.set(0x60FF, 0, 1789570);
  rig.run_ms(100);
  rig.sent.clear();
  rig.run_ms(500);
  EXPECT_EQ(frames_of(rig, 0x181), 10U) << "50 ms apart";
  EXPECT_EQ(rig.sent.back().length, 6);
  // At every SYNC, and by the event timer.
  rig.control(0x06);
  rig.run_ms(1000);
  rig.set(0x1800, 1, 0x80000181);
  rig.set(0x1800, 3, 0);
  rig.set(0x1800, 2, 1);
  rig.set(0x1800, 1, 0x181);
  rig.sent.clear();
  for (int i = 0; i < 5; ++i) {
    rig.send(0x080, {});
    rig.run_ms(1);
  }
  EXPECT_EQ(frames_of(rig, 0x181), 5U);
  rig.set(0x1800, 1, 0x80000181);
  rig.set(0x1800, 2, 254);
  rig.set(0x1800, 5, 20);
  rig.set(0x1800, 1, 0x181);
  rig.sent.clear();
  rig.run_ms(205);
  EXPECT_NEAR(static_cast<double>(frames_of(rig, 0x181)), 10.0, 1.0);
}

// "Supports all 256 transmission modes" (ch. 9.3.3.3), in both directions: types that CiA 301 reserves work like 254.
TEST(IsmkCanopen, EveryTransmissionType) {
  IsmkRig rig;
  rig.run_ms(5);
  for (int type = 0; type < 256; ++type) {
    EXPECT_EQ(rig.set(0x1400, 2, type), AbortCode::none) << type;
    EXPECT_EQ(rig.get(0x1400, 2), type);
    rig.set(0x1800, 1, 0x80000181);
    EXPECT_EQ(rig.set(0x1800, 2, type), AbortCode::none) << type;
    EXPECT_EQ(rig.get(0x1800, 2), type);
  }
  rig.set(0x1A00, 0, 0);
  rig.set(0x1A00, 1, 0x60600008);
  rig.set(0x1A00, 0, 1);
  rig.send(0x000, {0x01, 0x01});
  for (const int type : {241, 247, 251, 254}) {
    rig.set(0x1800, 1, 0x80000181);
    rig.set(0x1800, 2, type);
    rig.set(0x1800, 1, 0x181);
    rig.run_ms(5);
    rig.sent.clear();
    for (int i = 0; i < 300; ++i) rig.send(0x080, {});
    EXPECT_EQ(frames_of(rig, 0x181), 0U) << type << " is not of the SYNC";
    rig.set(0x6060, 0, rig.get(0x6060) == 3 ? 1 : 3);
    rig.run_ms(5);
    EXPECT_EQ(frames_of(rig, 0x181), 1U) << type << " on change";
    rig.set(0x1800, 1, 0x80000181);
    rig.set(0x1800, 5, 20);
    rig.set(0x1800, 1, 0x181);
    rig.sent.clear();
    rig.run_ms(205);
    EXPECT_NEAR(static_cast<double>(frames_of(rig, 0x181)), 10.0, 1.0) << type << " by the event timer";
    rig.set(0x1800, 1, 0x80000181);
    rig.set(0x1800, 5, 0);
  }
  for (const int type : {241, 251, 252, 253}) {
    rig.set(0x1400, 2, type);
    rig.send(0x201, {0x06, 0x00});
    rig.send(0x201, {0x07, 0x00});
    EXPECT_EQ(rig.get(0x6040), 0x07) << type;
  }
}

// Ch. 9.3.3.4, Table 9-26: 1000 ms x 3 from the first remote frame on; 6007h decides whether the drive reacts.
TEST(IsmkCanopen, NodeProtection) {
  for (const int option : {0, 1}) {
    IsmkRig rig;
    rig.run_ms(5);
    rig.set(0x6007, 0, option);
    rig.send(0x000, {0x01, 0x01});
    rig.set(0x6060, 0, -3);
    rig.control(0x0F);
    rig.sent.clear();
    rig.send(0x701, {}, true);
    EXPECT_EQ(test::text_of(rig.sent.back()), "701 # 05");
    rig.send(0x701, {}, true);
    EXPECT_EQ(test::text_of(rig.sent.back()), "701 # 85");
    rig.run_ms(2900);
    EXPECT_EQ(rig.status() & 0xFF, 0x37);
    rig.run_ms(200);
    EXPECT_EQ(rig.status() & 0xFF, option == 1 ? 0x38 : 0x37);
    EXPECT_EQ(rig.get(0x603F), option == 1 ? 0x8100 : 0);
    EXPECT_EQ(rig.get(0x2602), option == 1 ? 0x1000 : 0);
    EXPECT_EQ(rig.device.node().nmt_state(), canopen::NmtState::operational);
    rig.sent.clear();
    rig.send(0x000, {0x02, 0x01});
    rig.run_ms(5);
    EXPECT_EQ(rig.status() & 0xFF, option == 1 ? 0x38 : 0x37) << "a stopped node is no lost one";
  }
  EXPECT_EQ(IsmkRig().set(0x100E, 0, 0x43F), AbortCode::value_invalid);
}

// --- Interpolation (ch. 9.5)

struct Interpolating : IsmkRig {
  explicit Interpolating(int period_code, int clock_mode = 1) {
    run_ms(5);
    set(0x3011, 1, period_code);
    set(0x3011, 2, clock_mode);
    set(0x6060, 0, 7);
    send(0x000, {0x01, 0x01});
    control(0x0F);
    run_ms(5);
    control(0x1F);
  }
  // One SYNC with its target before it.
  void step(std::int64_t target, double period_ms) {
    set(0x607A, 0, target);
    send(0x080, {});
    run_ms(period_ms);
  }
};

TEST(IsmkInterpolation, TargetsAreFollowedOnTheSyncOfEveryPeriod) {
  for (const int code : {0, 1, 2, 3}) {
    const double period_ms = 1 << code;
    Interpolating rig(code);
    double worst = 0.0;
    const auto place = [](double t_ms) { return 30000.0 * (1.0 - std::cos(t_ms * 0.00628)); };
    for (double t = 0.0; t < 1000.0; t += period_ms) {
      rig.step(std::llround(place(t)), period_ms);
      if (t > 100.0) worst = std::max(worst, std::abs(static_cast<double>(rig.get(0x60F4))));
    }
    EXPECT_EQ(rig.get(0x3011, 4), 0) << "no SYNC lost with " << period_ms << " ms";
    EXPECT_LT(worst, 300.0);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), place(1000.0), 400.0);
    // 0Fh interrupts (Table 5-4).
    rig.control(0x0F);
    const std::int64_t here = rig.get(0x6063);
    rig.step(here + 50000, 20.0);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), static_cast<double>(here), 300.0);
  }
}

TEST(IsmkInterpolation, LostAndUnexpectedSyncsAreCounted) {
  Interpolating rig(2);
  for (int i = 0; i < 20; ++i) rig.step(0, 4.0);
  EXPECT_EQ(rig.get(0x3011, 4), 0);
  rig.run_ms(12.0);  // three are missing
  rig.step(0, 4.0);
  EXPECT_EQ(rig.get(0x3011, 4), 3);
  for (int i = 0; i < 10; ++i) rig.step(0, 1.0);  // a different period than the configured one
  EXPECT_GT(rig.get(0x3011, 4), 8);
  EXPECT_EQ(rig.status() & 0xFF, 0x37) << "it is counted, no more";
}

TEST(IsmkInterpolation, WithoutTheClockTargetsActWhenWritten) {
  Interpolating rig(2, 0);
  for (int i = 0; i <= 100; ++i) {
    rig.set(0x607A, 0, 200 * i);
    rig.run_ms(4.0);
  }
  rig.run_ms(50.0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 20000.0, 65.0);
}

// --- Storing (ch. 7, 'Object list'; ch. 7.10, 2FF0.01 and 2FF0.03; ch. 7.14, 2FFFh; ch. 9.3.3.4; Table 10-5, 800.0)

void restart(IsmkRig& rig) {
  EXPECT_EQ(rig.set(0x2FFF, 0, 0xAA55), AbortCode::none);
  rig.sent.clear();
  rig.run_ms(15);
  const auto boots = [&](const canopen::Frame& frame) {
    return frame.id == 0x700U + rig.device.node_id() && frame.data[0] == 0;
  };
  ASSERT_TRUE(std::none_of(rig.sent.begin(), rig.sent.end(), boots)) << "the answer leaves first";
  rig.run_ms(10);
  ASSERT_GE(frames_of(rig, 0x700U + rig.device.node_id()), 1U);
  EXPECT_EQ(rig.sent.back().data[0], 0) << "boot-up";
}

// The encoder knows the position within one turn after a restart, as after a power cycle.
TEST(IsmkStorage, ARestartKeepsThePositionWithinTheTurn) {
  IsmkRig rig;
  rig.plant.set_position_counts(200000);
  rig.run_ms(5);
  ASSERT_NE(rig.feedback.single_turn_counts, 0U);
  ASSERT_NE(static_cast<std::int64_t>(rig.feedback.single_turn_counts), rig.feedback.position_counts);
  restart(rig);
  const std::int64_t restarted = rig.get(0x6063);
  EXPECT_EQ(restarted, rig.feedback.single_turn_counts);
  rig.device.power_on(rig.feedback, rig.now());
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x6063), restarted);
}

TEST(IsmkStorage, WhatIsStoredAndWhatIsNot) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x6083, 0, 12345);   // S
  rig.set(0x6081, 0, 12345);   // not S
  rig.set(0x1017, 0, 100);     // ch. 9.3.3.4
  rig.set(0x6410, 0x12, 200);  // motor data
  rig.set(0x6060, 0, 3);
  restart(rig);
  EXPECT_EQ(rig.get(0x6083), 107374) << "not stored";
  rig.set(0x6083, 0, 12345);
  rig.set(0x6410, 0x12, 200);
  EXPECT_EQ(rig.set(0x2FF0, 1, 1), AbortCode::none);
  EXPECT_EQ(rig.get(0x2FF0, 1), 0);
  rig.set(0x6081, 0, 12345);
  rig.set(0x1017, 0, 100);
  restart(rig);
  EXPECT_EQ(rig.get(0x6083), 12345);
  EXPECT_EQ(rig.get(0x6081), 0);
  EXPECT_EQ(rig.get(0x1017), 0);
  EXPECT_EQ(rig.get(0x6060), -4);
  EXPECT_EQ(rig.get(0x6410, 0x12), 150) << "motor parameters are stored apart";
  rig.set(0x6410, 0x12, 200);
  EXPECT_EQ(rig.set(0x2FF0, 3, 1), AbortCode::none);
  restart(rig);
  EXPECT_EQ(rig.get(0x6410, 0x12), 200);
  // 10 initialises the control parameters; permanently, if they are stored.
  EXPECT_EQ(rig.set(0x2FF0, 1, 10), AbortCode::none);
  EXPECT_EQ(rig.get(0x6083), 107374);
  EXPECT_EQ(rig.get(0x6410, 0x12), 200);
  restart(rig);
  EXPECT_EQ(rig.get(0x6083), 12345);
  rig.set(0x2FF0, 1, 10);
  rig.set(0x2FF0, 1, 1);
  restart(rig);
  EXPECT_EQ(rig.get(0x6083), 107374);
  for (const int command : {2, 9}) EXPECT_EQ(rig.set(0x2FF0, 1, command), AbortCode::value_invalid);
}

// The shape of the ramps follows 60FBh sub 4, also back to the factory setting.
TEST(IsmkStorage, InitialisingTakesBackTheSCurve) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x6060, 0, 1);
  const drive::Axis& axis = rig.device.drive().axis();
  rig.set(0x60FB, 4, 3);
  EXPECT_EQ(axis.shape(), drive::RampShape::sin2);
  EXPECT_EQ(rig.set(0x2FF0, 1, 10), AbortCode::none);
  EXPECT_EQ(rig.get(0x60FB, 4), 1);
  EXPECT_EQ(axis.shape(), drive::RampShape::linear);
}

// 100Bh and 2F81h: save and restart (ch. 8.1 and 9.3.3.1).
TEST(IsmkStorage, AddressAndBitRateActAfterSaveAndRestart) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x100B, 0, 42);
  rig.set(0x2F81, 0, 100);
  rig.run_ms(5);
  EXPECT_EQ(rig.device.node_id(), 1);
  EXPECT_EQ(rig.device.bit_rate(), 500000U);
  rig.set(0x2FF0, 1, 1);
  restart(rig);
  EXPECT_EQ(rig.device.node_id(), 42);
  EXPECT_EQ(rig.device.bit_rate(), 1000000U);
  EXPECT_EQ(rig.get(0x1014), 0x80 + 42);
  EXPECT_EQ(rig.get(0x100E), 0x700 + 42);
}

TEST(IsmkStorage, RestartForgetsHomeAndLetsGo) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 35);
  rig.control(0x0F);
  rig.run_ms(5);
  rig.control(0x1F);
  rig.run_ms(50);
  EXPECT_TRUE(rig.device.drive().homed());
  EXPECT_EQ(rig.set(0x2FF0, 1, 10), AbortCode::device_state) << "while enabled";
  EXPECT_EQ(rig.set(0x2FFF, 0, 0x55AA), AbortCode::device_state) << "no boot loader";
  EXPECT_EQ(rig.set(0x2FFF, 0, 1), AbortCode::value_invalid);
  restart(rig);
  EXPECT_FALSE(rig.device.drive().homed());
  EXPECT_FALSE(rig.device.drive().energised());
  EXPECT_EQ(rig.status() & 0xC0FF, 0x4031);
}

}  // namespace
}  // namespace ismk_canopen_test
}  // namespace servodrome
