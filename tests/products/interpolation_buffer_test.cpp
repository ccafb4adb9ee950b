#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/pronet/pronet.hpp"

// Values that the buffer of interpolated position, 60C4h, and the period 60C2h refuse.
namespace servodrome {
namespace interpolation_buffer_test {
namespace {

using dictionary::AbortCode;
using Rig = test::Rig<products::Generic402>;

struct Interpolating : Rig {
  explicit Interpolating(std::int64_t size) {
    set(0x60C4, 2, size);
    set(0x6060, 0, 7);
    EXPECT_TRUE(enable());
  }
  AbortCode record(std::int64_t position) { return set(0x60C1, 1, position); }
};

TEST(InterpolationBuffer, ARecordTooManyIsRefused) {
  for (const auto& [size, fits] : {std::pair{0, 1}, {1, 1}, {4, 4}, {64, 64}}) {
    SCOPED_TRACE(size);
    Interpolating axis(size);
    for (int n = 1; n <= fits; ++n) EXPECT_EQ(axis.record(10 * n), AbortCode::none) << n;
    EXPECT_EQ(axis.get(0x60C4, 4), fits);
    EXPECT_EQ(axis.record(10 * fits + 10), AbortCode::device_state);
    EXPECT_EQ(axis.get(0x60C1, 1), 10 * fits) << "the object has what was taken";
    // The axis moves to all accepted records, and to no others.
    axis.control(0x1F);
    axis.run_ms(2);
    if (fits > 1) {
      EXPECT_EQ(axis.record(10 * fits + 10), AbortCode::none) << "there is room again";
    }
    axis.run_ms(200);
    EXPECT_EQ(axis.get(0x6062), 10 * fits + (fits > 1 ? 10 : 0));
  }
}

// The axis approaches a far first record by the profile's ramps. Bit 12 equals bit 4 of the controlword during this
// ("ip mode active").
TEST(InterpolationBuffer, AFarFirstRecordIsCaughtUpWith) {
  Interpolating axis(1);
  for (const std::uint16_t ramp : std::to_array<std::uint16_t>({0x6083, 0x6084})) axis.set(ramp, 0, 10 * 131072);
  EXPECT_EQ(axis.record(131072), AbortCode::none);
  axis.control(0x1F);
  axis.run_ms(100);
  EXPECT_NEAR(axis.device.drive().axis().generator.velocity() / 131072.0, 1.0, 0.1);
  EXPECT_EQ(axis.status() & 0x1000, 0x1000);
  axis.run_ms(1000);
  EXPECT_EQ(axis.get(0x6062), 131072);
  axis.control(0x0F);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x1000, 0);
}

TEST(InterpolationBuffer, ARingTakesTheNewest) {
  Interpolating axis(4);
  axis.set(0x60C4, 3, 1);
  for (int n = 1; n <= 10; ++n) EXPECT_EQ(axis.record(10 * n), AbortCode::none);
  EXPECT_EQ(axis.get(0x60C4, 4), 4);
  axis.control(0x1F);
  axis.run_ms(100);
  EXPECT_EQ(axis.get(0x6062), 100);
  EXPECT_EQ(axis.get(0x1001), 0);
}

TEST(InterpolationBuffer, ClearedItTakesAgain) {
  Interpolating axis(2);
  EXPECT_EQ(axis.record(1), AbortCode::none);
  EXPECT_EQ(axis.record(2), AbortCode::none);
  EXPECT_EQ(axis.record(3), AbortCode::device_state);
  EXPECT_EQ(axis.set(0x60C4, 6, 0), AbortCode::none);
  EXPECT_EQ(axis.get(0x60C4, 4), 0);
  EXPECT_EQ(axis.record(3), AbortCode::none);
}

// If records are not accepted, the object accepts any value.
TEST(InterpolationBuffer, OutsideOfTheModeNothingWaits) {
  Rig axis;
  for (int n = 1; n <= 5; ++n) EXPECT_EQ(axis.set(0x60C1, 1, 1000 * n), AbortCode::none);
  EXPECT_EQ(axis.get(0x60C4, 4), 0);
  axis.set(0x6060, 0, 7);
  ASSERT_TRUE(axis.enable());
  axis.control(0x1F);
  axis.run_ms(50);
  EXPECT_EQ(axis.get(0x6062), 0);
}

// Process data have no answer: the drive sends one EMCY, and sets bit 7.
TEST(InterpolationBuffer, LostInProcessDataIsTold) {
  Interpolating axis(2);
  axis.set(0x1400, 1, 0x80000000 | axis.get(0x1400, 1));
  axis.set(0x1600, 0, 0);
  axis.set(0x1600, 1, 0x60C10120);
  axis.set(0x1600, 0, 1);
  axis.set(0x1400, 2, 255);
  axis.set(0x1400, 1, 0x200 + axis.device.node_id());
  axis.send(0, {1, 0});
  const auto emergencies = [&](std::uint16_t code) {
    int count = 0;
    for (const canopen::Frame& frame : axis.sent) {
      if (frame.id == 0x80U + axis.device.node_id() && frame.data[0] + (frame.data[1] << 8) == code) ++count;
    }
    return count;
  };
  const auto record = [&](std::uint8_t value) {
    axis.send(0x200U + axis.device.node_id(), {value, 0, 0, 0});
    axis.run_ms(1);
  };
  for (const std::uint8_t value : std::to_array<std::uint8_t>({1, 2, 2, 2})) record(value);
  EXPECT_EQ(emergencies(0x6300), 0) << "what says the same again loses nothing";
  EXPECT_EQ(axis.status() & 0x80, 0);
  for (std::uint8_t value = 3; value < 10; ++value) record(value);
  EXPECT_EQ(emergencies(0x6300), 1);
  EXPECT_EQ(axis.status() & 0x80, 0x80);
  EXPECT_EQ(axis.device.drive().state(), drive::PowerState::operation_enabled);
  axis.set(0x60C4, 6, 0);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x80, 0);
  EXPECT_EQ(emergencies(0x0000), 1);
}

// 607Dh is set while the axis moves to a record: the axis no longer follows that record, and the next one, which the
// limits clip, causes no jump.
TEST(InterpolationBuffer, SoftwareLimitsSetUnderWayEndTheRecord) {
  Interpolating axis(8);
  constexpr std::int64_t turn = 131072;
  axis.set(0x6083, 0, 20 * turn);
  axis.set(0x6084, 0, 20 * turn);
  axis.set(0x6085, 0, 100 * turn);
  axis.set(0x60C2, 1, 200);
  axis.control(0x1F);
  axis.run_ms(10);
  axis.record(2 * turn);
  axis.run_ms(30);
  const auto turns = [&] { return static_cast<double>(axis.plant.position_counts()) / turn; };
  EXPECT_GT(turns(), 0.1);
  axis.set(0x607D, 1, -1000);
  axis.set(0x607D, 2, turn / 2);
  double furthest = 0.0;
  double fastest_back = 0.0;
  for (int i = 0; i < 3000; ++i) {
    axis.run_ms(0.5);
    if (i == 40) axis.record(2 * turn);
    furthest = std::max(furthest, turns());
    fastest_back = std::min(fastest_back, axis.plant.velocity_rpm());
  }
  EXPECT_LT(furthest, 1.0) << "0.5 at most from 600 rpm by the quick stop";
  EXPECT_GT(fastest_back, -600.0);
  EXPECT_NEAR(turns(), 0.5, 0.001) << "the second record ends at the limit";
  EXPECT_NE(axis.status() & 0x800, 0);
}

// --- 60C2h

template <typename RigType>
void refuses_impossible_periods(RigType&& rig) {
  const std::int64_t value = rig.get(0x60C2, 1);
  const std::int64_t index = rig.get(0x60C2, 2);
  EXPECT_EQ(rig.set(0x60C2, 1, 0), AbortCode::value_invalid);
  for (const int impossible : {-128, -7, 1, 63}) EXPECT_EQ(rig.set(0x60C2, 2, impossible), AbortCode::value_invalid);
  EXPECT_EQ(rig.get(0x60C2, 1), value);
  EXPECT_EQ(rig.get(0x60C2, 2), index);
  for (const int possible : {1, 2, 255}) EXPECT_EQ(rig.set(0x60C2, 1, possible), AbortCode::none);
  for (const int possible : {-6, -3, 0}) EXPECT_EQ(rig.set(0x60C2, 2, possible), AbortCode::none);
}

TEST(InterpolationPeriod, ImpossibleOnesAreRefused) {
  refuses_impossible_periods(Rig{});
  refuses_impossible_periods(test::Rig<products::Generic402Ec>{});
  refuses_impossible_periods(test::Rig<products::IsmkEa>{test::ismk_plant(), test::ismk_settings()});
  refuses_impossible_periods(test::FactoryJmcRig{});
}

// Manuals with another range: 1 to 4 ms, with a fault for 0 (ISMC, ch. 4.6.2; ch. 5, 6553h); UINT8 (ProNet, ch. 7.5.3,
// 60C2h).
TEST(InterpolationPeriod, AsTheManualPrintsIt) {
  test::Rig<products::Ismc> ismc;
  EXPECT_EQ(ismc.set(0x60C2, 1, 0), AbortCode::none);
  EXPECT_NE(ismc.set(0x60C2, 1, 5), AbortCode::none);
  test::Rig<products::Pronet> pronet;
  EXPECT_EQ(pronet.set(0x60C2, 1, 0), AbortCode::none);
  EXPECT_EQ(pronet.set(0x60C2, 2, 63), AbortCode::none);
}

}  // namespace
}  // namespace interpolation_buffer_test
}  // namespace servodrome
