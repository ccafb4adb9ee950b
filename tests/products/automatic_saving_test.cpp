#include <gtest/gtest.h>

#include "dictionary/medium.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// A device that saves single objects by itself saves no others: values that were restored by 1011h stay restored, and
// values of a trial are lost at power-off.
namespace servodrome {
namespace automatic_saving_test {
namespace {

using dictionary::AbortCode;

template <typename Product>
struct Axis {
  void power_cycle() { rig.device.power_on(rig.feedback, rig.now()); }
  void save_all() { ASSERT_EQ(rig.set(0x1010, 1, dictionary::save_signature), AbortCode::none); }
  void restore_all() { ASSERT_EQ(rig.set(0x1011, 1, dictionary::load_signature), AbortCode::none); }

  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
  test::Rig<Product> rig{test::default_plant(), {.store = &medium}};
};

TEST(AutomaticSaving, BusSettingsOfIsmc) {
  Axis<products::Ismc> axis;
  const std::int64_t factory = axis.rig.get(0x2115);
  ASSERT_EQ(axis.rig.set(0x2115, 0, 123), AbortCode::none);
  axis.save_all();
  axis.restore_all();
  ASSERT_EQ(axis.rig.set(0x2401, 0, 7), AbortCode::none);
  axis.power_cycle();
  EXPECT_EQ(axis.rig.get(0x2115), factory);
  EXPECT_EQ(axis.rig.device.node_id(), 7);
  ASSERT_EQ(axis.rig.set(0x2115, 0, 77), AbortCode::none);
  ASSERT_EQ(axis.rig.set(0x2004, 0, 500000), AbortCode::none);
  axis.power_cycle();
  EXPECT_EQ(axis.rig.get(0x2115), factory) << "a trial";
  EXPECT_EQ(axis.rig.device.bit_rate(), 500000U);
  EXPECT_EQ(axis.rig.device.node_id(), 7);
}

class Lss : public testing::Test {
 protected:
  void command(std::uint8_t specifier, std::uint8_t first = 0, std::uint8_t second = 0) {
    axis.rig.send(0x7E5, {specifier, first, second, 0, 0, 0, 0, 0});
  }
  // Of the last answer; 0xFF: none.
  unsigned error() const {
    const auto& sent = axis.rig.sent;
    return sent.empty() || sent.back().id != 0x7E4 ? 0xFFU : sent.back().data[1];
  }
  Axis<products::Generic402> axis;
};

TEST_F(Lss, StoresNodeIdAndBitRateOnly) {
  const std::int64_t gain = axis.rig.get(0x2010, 1);
  ASSERT_EQ(axis.rig.set(0x2010, 1, gain + 1), AbortCode::none);
  command(4, 1);
  command(17, 5);
  EXPECT_EQ(error(), 0U);
  command(19, 0, 2);
  EXPECT_EQ(error(), 0U);
  command(23);
  EXPECT_EQ(error(), 0U);
  axis.power_cycle();
  EXPECT_EQ(axis.rig.get(0x2010, 1), gain);
  EXPECT_EQ(axis.rig.device.node_id(), 5);
  EXPECT_EQ(axis.rig.device.bit_rate(), 500000U);
}

// CiA 305, cs 21: the node is silent for a delay, switches, and is silent for another delay.
TEST_F(Lss, ActivatesTheBitTimingAfterTheDelay) {
  axis.rig.set(0x1017, 0, 1);
  axis.rig.run_ms(5);
  command(4, 1);
  command(19, 0, 2);
  axis.rig.sent.clear();
  command(21, 10);
  axis.rig.run_ms(9);
  EXPECT_EQ(axis.rig.device.bit_rate(), 1000000U);
  axis.rig.run_ms(2);
  EXPECT_EQ(axis.rig.device.bit_rate(), 500000U);
  axis.rig.run_ms(8);
  EXPECT_TRUE(axis.rig.sent.empty());
  axis.rig.run_ms(3);
  EXPECT_FALSE(axis.rig.sent.empty());
  axis.power_cycle();
  EXPECT_EQ(axis.rig.device.bit_rate(), 1000000U) << "not stored";
}

TEST_F(Lss, APowerCycleEndsAnActivation) {
  command(4, 1);
  command(19, 0, 2);
  command(21, 10);
  axis.rig.run_ms(5);
  axis.power_cycle();
  axis.rig.run_ms(20);
  EXPECT_EQ(axis.rig.device.bit_rate(), 1000000U);
}

}  // namespace
}  // namespace automatic_saving_test
}  // namespace servodrome
