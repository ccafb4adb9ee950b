// Homing ends when the shaft is at rest, whatever the drive reports. With a load that lags, the demand reaches home
// before the shaft does.
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"

namespace servodrome::master::test {
namespace home_at_rest_test {
namespace {

using testing::HasSubstr;

HomingRequest to_the_index(const AxisUnits& units) {
  return {.method = 33,
          .switch_speed = static_cast<std::uint32_t>(2 * units.velocity),
          .zero_speed = static_cast<std::uint32_t>(units.velocity),
          .acceleration = static_cast<std::uint32_t>(100 * units.acceleration)};
}

class HomeAtRest : public testing::TestWithParam<RigCase> {};
constexpr const char* lags = "[axis.load]\ninertia_kgm2 = 1e-4\n";
constexpr const char* lags_behind_stiff_loops = "[axis.load]\ninertia_kgm2 = 1e-2\n";
INSTANTIATE_TEST_SUITE_P(Every, HomeAtRest,
                         testing::Values(RigCase{"generic402", RigCase::BusKind::can, lags_behind_stiff_loops},
                                         RigCase{"ismc", RigCase::BusKind::can, lags_behind_stiff_loops},
                                         RigCase{"ismk", RigCase::BusKind::can, lags},
                                         RigCase{"jmc_ec", RigCase::BusKind::ethercat, lags}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(HomeAtRest, IsDoneWhenTheShaftStands) {
  AxisRig rig(GetParam());
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  double rpm_as_shown = 0.0;  // at the time when the drive reported homing attained
  axis.home(to_the_index(axis.units().value_or(AxisUnits{131072, 131072, 131072})), 30s,
            [&](const AxisStatus&) { rpm_as_shown = rig.drive().plant().velocity_rpm(); });
  EXPECT_GT(std::abs(rpm_as_shown), 3.0);
  const double at = rig.shaft_counts();
  for (int i = 0; i < 50; ++i) {
    EXPECT_NEAR(rig.drive().plant().velocity_rpm(), 0.0, 2.0);
    rig.objects().wait(4ms);
    EXPECT_NEAR(rig.shaft_counts(), at, 30.0);  // the load still swings a little
  }
}

// With these gains the load oscillates permanently: the drive reports homing attained, but the shaft does not rest.
TEST(HomeThatSwings, IsNotDone) {
  AxisRig rig({"jmc_ec", RigCase::BusKind::ethercat, "[axis.load]\ninertia_kgm2 = 1e-3\n"});
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  EXPECT_THAT(problem_of([&] {
                axis.home(to_the_index(axis.units().value_or(AxisUnits{131072, 131072, 131072})), 30s);
              }),
              HasSubstr("homing by method 33 is attained, but the shaft does not come to rest"));
}

}  // namespace
}  // namespace home_at_rest_test
}  // namespace servodrome::master::test
