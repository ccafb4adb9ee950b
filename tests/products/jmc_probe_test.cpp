#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// Touch probes 60B8h to 60BDh of the JMC EC drives (Tables 204 to 209, Table 219) on a turning axis: DI3 and DI4 have
// cams at known counts, so the positions are known to the count.
namespace servodrome {
namespace jmc_probe_test {
namespace {

using dictionary::AbortCode;
using test::JmcRig;

// Bits of one probe; the second's are shifted by 8.
constexpr int on = 0x01;
constexpr int continuous = 0x02;
constexpr int by_index = 0x04;
constexpr int by_object = 0x08;
constexpr int rising = 0x10;
constexpr int falling = 0x20;
constexpr int stored_rising = 0x02;
constexpr int stored_falling = 0x04;

constexpr int cam_1_from = 1500;
constexpr int cam_1_to = 1800;  // first count behind
constexpr int cam_2_from = 2500;
constexpr int cam_2_to = 2600;
constexpr int index_at = 3000;

plant::Parameters with_cams() {
  plant::Parameters parameters = test::jmc_plant();
  parameters.encoder.index_position_counts = index_at;
  parameters.encoder.index_width_counts = 2;
  parameters.switches[0].wire = 3;  // DI3 (ch. 3.1.2)
  parameters.switches[0].from_counts = cam_1_from;
  parameters.switches[0].to_counts = cam_1_to - 1;
  parameters.switches[1].wire = 4;  // DI4
  parameters.switches[1].from_counts = cam_2_from;
  parameters.switches[1].to_counts = cam_2_to - 1;
  parameters.switch_count = 2;
  return parameters;
}

struct ProbeRig : JmcRig {
  ProbeRig() : JmcRig(with_cams(), test::jmc_settings()) {
    set(0x6060, 0, 1);
    set(0x607F, 0, 400000);
    set(0x60C5, 0, 1000000);
    set(0x60C6, 0, 1000000);
    set(0x6081, 0, 20000);
    EXPECT_TRUE(enable());
    run_ms(120);
  }
  void move_to(std::int64_t target) {
    set(0x607A, 0, target);
    control(0x1F);
    run_ms(5);
    control(0x0F);
    ASSERT_GE(run_until([this] { return (status() & 0x0400) != 0 && !device.drive().in_motion(); }, 5000), 0);
    run_ms(20);
  }
  int status_of(int probe) { return static_cast<int>(get(0x60B9) >> (8 * probe)) & 0xFF; }
};

TEST(JmcProbe, BothEdgesOfBothProbes) {
  ProbeRig rig;
  EXPECT_EQ(rig.get(0x60B9), 0);
  EXPECT_EQ(rig.set(0x60B8, 0, (on | rising | falling) * 0x0101), AbortCode::none);
  EXPECT_EQ(rig.get(0x60B9), 0x0101) << "on";
  rig.move_to(4000);
  EXPECT_EQ(rig.get(0x60B9), (on | stored_rising | stored_falling) * 0x0101);
  EXPECT_EQ(rig.get(0x60BA), cam_1_from);
  EXPECT_EQ(rig.get(0x60BB), cam_1_to);
  EXPECT_EQ(rig.get(0x60BC), cam_2_from);
  EXPECT_EQ(rig.get(0x60BD), cam_2_to);
  // 60FDh bits 9 and 10 show the inputs.
  rig.move_to(1600);
  EXPECT_EQ(rig.get(0x60FD), 1 << 9);
  rig.move_to(2550);
  EXPECT_EQ(rig.get(0x60FD), 1 << 10);
}

// Single: a second edge does not change value and status (ETG.6010). Continuous: every edge does.
TEST(JmcProbe, OnceAndContinuously) {
  ProbeRig rig;
  rig.set(0x60B8, 0, (on | rising) | (on | continuous | rising) << 8);
  rig.move_to(4000);
  rig.move_to(0);  // approaches the cams from above: the rising edges are at their upper ends
  EXPECT_EQ(rig.get(0x60BA), cam_1_from);
  EXPECT_EQ(rig.get(0x60BC), cam_2_to - 1);
  EXPECT_EQ(rig.status_of(0), on | stored_rising);
  EXPECT_EQ(rig.status_of(1), on | stored_rising) << "bits 6 and 7 stay 0";
}

// Edges that are not enabled are not latched; switching off clears the status, switching on arms again.
TEST(JmcProbe, EnablesAndArming) {
  ProbeRig rig;
  rig.set(0x60B8, 0, on | falling);
  rig.move_to(2000);
  EXPECT_EQ(rig.status_of(0), on | stored_falling);
  EXPECT_EQ(rig.get(0x60BA), 0);
  EXPECT_EQ(rig.get(0x60BB), cam_1_to);
  rig.set(0x60B8, 0, 0);
  EXPECT_EQ(rig.get(0x60B9), 0);
  EXPECT_EQ(rig.get(0x60BB), cam_1_to) << "the value stays";
  rig.move_to(0);
  EXPECT_EQ(rig.get(0x60BB), cam_1_to) << "off";
  rig.set(0x60B8, 0, on | rising);
  rig.move_to(1700);
  EXPECT_EQ(rig.status_of(0), on | stored_rising);
  EXPECT_EQ(rig.get(0x60BA), cam_1_from);
}

// Source 01 is the encoder's Z; 10 is "not used" in the manual (object 60B8h), 11 is reserved: neither latches (D-30).
TEST(JmcProbe, Sources) {
  ProbeRig rig;
  rig.set(0x60B8, 0, (on | by_index | rising | falling) | (on | by_object | rising) << 8);
  rig.move_to(4000);
  EXPECT_EQ(rig.status_of(0), on | stored_rising | stored_falling);
  EXPECT_EQ(rig.get(0x60BA), index_at);
  EXPECT_EQ(rig.get(0x60BB), index_at + 2);
  EXPECT_EQ(rig.status_of(1), on);
  EXPECT_EQ(rig.get(0x60BC), 0);
  EXPECT_EQ(rig.device.dictionary().find(0x60D0, 1), nullptr);
}

// The unit is that of 6064h: it includes gear and home.
TEST(JmcProbe, PositionsAreCommandUnits) {
  ProbeRig rig;
  rig.control(0x00);
  rig.run_ms(250);
  EXPECT_EQ(rig.set(0x6092, 1, 8000), AbortCode::none);  // 8000 units per turn
  EXPECT_TRUE(rig.enable());
  rig.run_ms(120);
  rig.move_to(1000);  // 500 counts
  rig.set(0x6060, 0, 6);
  rig.set(0x6098, 0, 35);
  rig.control(0x1F);
  rig.run_ms(10);
  rig.control(0x0F);
  rig.set(0x6060, 0, 1);
  const std::int64_t home = rig.plant.position_counts() * 2 - rig.get(0x6064);
  rig.set(0x60B8, 0, on | rising);
  rig.move_to(5000);
  EXPECT_NEAR(static_cast<double>(rig.get(0x60BA)), static_cast<double>(2 * cam_1_from - home), 1.0);
}

}  // namespace
}  // namespace jmc_probe_test
}  // namespace servodrome
