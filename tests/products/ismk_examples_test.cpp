#include <gtest/gtest.h>

#include "frames.hpp"
#include "ismk_rig.hpp"

// The worked examples of the CANopen chapter of the iSMK manual (ch. 9.3.2), byte by byte, and their motions. The
// refusal of ch. 9.3.2 is omitted: it shows the format of an abort with a code that 607Ah cannot return.
//
// Statusword bit 9 is 0 in all printed words, although the text says that it is 1 for bus control (Table 5-5): they
// come from a drive with the function Enable on one of its inputs, and the drive of this test has it too (C7).
namespace servodrome {
namespace ismk_examples_test {
namespace {

using test::frame_of;
using test::IsmkRig;

struct Step {
  const char* request;
  const char* response;
  double wait_ms = 2.0;  // afterwards
};

const std::vector<Step> homing{
    {"601 # 2B 40 60 00 0F 00 00 00", "581 # 60 40 60 00 0F 00 00 00", 20},
    {"601 # 2F 60 60 00 06 00 00 00", "581 # 60 60 60 00 06 00 00 00"},
    {"601 # 2F 98 60 00 21 00 00 00", "581 # 60 98 60 00 21 00 00 00"},
    {"601 # 23 99 60 01 03 9D 36 00", "581 # 60 99 60 01 03 9D 36 00"},
    {"601 # 23 99 60 02 82 4E 1B 00", "581 # 60 99 60 02 82 4E 1B 00"},
    {"601 # 2B 40 60 00 1F 00 00 00", "581 # 60 40 60 00 1F 00 00 00", 2000},
    {"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 37 C0 FF FF"},  // ch. 8.3.2: while the drive is enabled
    {"601 # 2B 40 60 00 06 00 00 00", "581 # 60 40 60 00 06 00 00 00"},
    {"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 31 C0 FF FF"},  // Table 9-9: after 06 (C6)
};

const std::vector<Step> positioning{
    {"601 # 2B 40 60 00 2F 00 00 00", "581 # 60 40 60 00 2F 00 00 00"},
    {"601 # 2F 60 60 00 01 00 00 00", "581 # 60 60 60 00 01 00 00 00"},
    {"601 # 23 7A 60 00 50 C3 00 00", "581 # 60 7A 60 00 50 C3 00 00"},
    {"601 # 23 81 60 00 03 9D 36 00", "581 # 60 81 60 00 03 9D 36 00"},
    {"601 # 23 83 60 00 6E A3 01 00", "581 # 60 83 60 00 6E A3 01 00"},
    {"601 # 23 84 60 00 6E A3 01 00", "581 # 60 84 60 00 6E A3 01 00"},
    {"601 # 2B 40 60 00 3F 00 00 00", "581 # 60 40 60 00 3F 00 00 00", 400},
    {"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 37 D4 FF FF"},  // ch. 8.3.2: the start bit is still set
    {"601 # 2B 40 60 00 4F 00 00 00", "581 # 60 40 60 00 4F 00 00 00"},
    {"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 37 C4 FF FF"},  // ch. 9.3.2
    {"601 # 2B 40 60 00 5F 00 00 00", "581 # 60 40 60 00 5F 00 00 00", 400},
    {"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 37 D4 FF FF"},
};

const std::vector<Step> speed{
    {"601 # 2F 60 60 00 03 00 00 00", "581 # 60 60 60 00 03 00 00 00"},
    {"601 # 23 FF 60 00 7E B1 E4 FF", "581 # 60 FF 60 00 7E B1 E4 FF"},
    {"601 # 2B 40 60 00 2F 00 00 00", "581 # 60 40 60 00 2F 00 00 00"},
    {"601 # 23 83 60 00 6E A3 01 00", "581 # 60 83 60 00 6E A3 01 00"},
    {"601 # 23 84 60 00 6E A3 01 00", "581 # 60 84 60 00 6E A3 01 00", 200},
};

std::string answer(IsmkRig& rig, const Step& step) {
  rig.sent.clear();
  rig.device.receive(frame_of(step.request), rig.now());
  rig.drain();
  std::string text;
  for (const canopen::Frame& frame : rig.sent) {
    if (frame.id == 0x581) text += test::text_of(frame);
  }
  rig.run_ms(step.wait_ms);
  return text;
}

void run(IsmkRig& rig, const std::vector<Step>& steps) {
  for (const Step& step : steps) EXPECT_EQ(answer(rig, step), step.response) << step.request;
}

TEST(IsmkExamples, ByteByByte) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x2010, 3, 0x0001);
  rig.run_ms(5);
  run(rig, {{"601 # 23 7A 60 00 A0 86 01 00", "581 # 60 7A 60 00 A0 86 01 00"}});  // ch. 9.3.2
  run(rig, homing);
  EXPECT_TRUE(rig.device.drive().homed());
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 0.0, 65.0);
  run(rig, positioning);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 100000.0, 65.0) << "50000 absolute, then 50000 relative";
  run(rig, speed);
  EXPECT_NEAR(rig.device.drive().axis().velocity() * 60.0 / 65536.0, -100.0, 3.0);
}

// Table 9-16, ch. 9.3.3.5: boot-up and heartbeat.
TEST(IsmkExamples, Heartbeat) {
  IsmkRig rig;
  ASSERT_FALSE(rig.sent.empty());
  EXPECT_EQ(test::text_of(rig.sent.front()), "701 # 00");
  rig.sent.clear();
  rig.send(0x000, {0x01, 0x01});
  rig.set(0x1017, 0, 10);
  rig.sent.clear();
  rig.run_ms(25);
  ASSERT_GE(rig.sent.size(), 2U);
  EXPECT_EQ(test::text_of(rig.sent.back()), "701 # 05");
}

}  // namespace
}  // namespace ismk_examples_test
}  // namespace servodrome
