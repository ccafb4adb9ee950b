#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// 8700h: no SYNC for two periods 1006h while a cyclic synchronous mode needs SYNC. The time begins with the need, so a
// SYNC of long ago, or none at all, makes no difference.
namespace servodrome {
namespace sync_watch_test {
namespace {

using drive::PowerState;

template <typename Product>
void expect_two_periods_from_the_need(bool old_sync) {
  test::Rig<Product> rig;
  ASSERT_EQ(rig.set(0x1006, 0, 10000), dictionary::AbortCode::none);
  rig.send(0, {1, 0});
  rig.run_ms(10);
  if (old_sync) rig.send(0x80, {});
  rig.run_ms(1000);
  rig.set(0x6060, 0, 8);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(18);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  rig.send(0x80, {});
  rig.run_ms(19);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  rig.run_ms(3);
  EXPECT_EQ(rig.get(0x603F), 0x8700);
  EXPECT_TRUE(rig.device.drive().any_fault());
}

template <typename Product>
void expect_watched_without_any_sync() {
  test::Rig<Product> rig;
  ASSERT_EQ(rig.set(0x1006, 0, 10000), dictionary::AbortCode::none);
  rig.send(0, {1, 0});
  rig.set(0x6060, 0, 8);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(18);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  rig.run_ms(4);
  EXPECT_EQ(rig.get(0x603F), 0x8700);
}

TEST(SyncWatch, BeginsWithTheNeed) {
  for (const bool old_sync : {false, true}) {
    expect_two_periods_from_the_need<products::Ismc>(old_sync);
    expect_two_periods_from_the_need<products::Generic402>(old_sync);
  }
}

TEST(SyncWatch, WithoutAnySync) {
  expect_watched_without_any_sync<products::Ismc>();
  expect_watched_without_any_sync<products::Generic402>();
}

}  // namespace
}  // namespace sync_watch_test
}  // namespace servodrome
