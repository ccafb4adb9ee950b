#include <gtest/gtest.h>

#include "draws.hpp"
#include "drive/homing_figures.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Every homing method of both products on real plants with random geometry: motor, friction, loops, captured edges.
// Home must be at the place of the standard's figure, exact to the count; the resting position must be that of the
// manual.
namespace servodrome {
namespace homing_plant_test {
namespace {

using drive::Counts;
using drive::test::Figure;
using drive::test::Setting;
using drive::test::Start;
using drive::test::World;

plant::Switch region(std::uint8_t wire, Counts from, Counts to) {
  plant::Switch result;
  result.wire = wire;
  result.from_counts = from;
  result.to_counts = to;
  return result;
}

plant::Parameters plant_of(const World& world, Counts start) {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.counts_per_revolution = static_cast<std::int32_t>(world.revolution);
  parameters.encoder.index_position_counts =
      static_cast<std::int32_t>(((world.index % world.revolution) + world.revolution) % world.revolution);
  parameters.encoder.index_width_counts = static_cast<std::int32_t>(world.index_width);
  parameters.encoder.start_position_counts = start;
  parameters.load.low_stop_counts = world.low_stop;
  parameters.load.high_stop_counts = world.high_stop;
  parameters.switches[0] = region(0, plant::no_low_limit, world.negative_limit - 1);
  parameters.switches[1] = region(1, world.positive_limit, plant::no_high_limit);
  parameters.switches[2] = region(2, world.home_from, world.home_to - 1);
  parameters.switch_count = 3;
  return parameters;
}

// A machine of a few turns at a few turns per second.
Setting scaled_setting(const Figure& figure, drive::test::Random& random) {
  Setting setting = random_setting(figure, random);
  constexpr Counts factor = 10;
  World& world = setting.world;
  for (Counts* place : {&world.negative_limit, &world.positive_limit, &world.home_from, &world.home_to, &world.index,
                        &world.revolution, &world.low_stop, &world.high_stop}) {
    *place *= factor;
  }
  setting.config.fast *= static_cast<double>(factor);
  setting.config.slow *= static_cast<double>(factor);
  setting.config.acceleration *= static_cast<double>(factor);
  setting.config.retraction *= factor;
  return setting;
}

template <typename Device>
void find_home_from_every_start() {
  using Rig = test::Rig<Device>;
  const bool is_ismc = std::is_same_v<Device, products::Ismc>;
  int runs = 0;
  for (const drive::Method& method : Device::policy.homing.methods) {
    const Figure& figure = *drive::test::figure_of(method.number);
    drive::test::Random random{static_cast<std::uint32_t>(5000 + method.number)};
    for (int round = 0; round < servodrome::test::draws(10); ++round) {
      for (const Start start : drive::test::starts) {
        const Setting setting = scaled_setting(figure, random);
        const World& world = setting.world;
        const auto& config = setting.config;
        const std::optional<Counts> from = start_position(figure, world, start, random);
        if (!from) continue;
        ++runs;
        SCOPED_TRACE(testing::Message() << "method " << figure.number << " round " << round << " start "
                                        << static_cast<int>(start) << " at " << *from << ", home " << world.home_from
                                        << ".." << world.home_to << ", limits " << world.negative_limit << ".."
                                        << world.positive_limit << ", " << world.revolution << " per turn");
        Rig rig(plant_of(world, *from));
        rig.set(0x6060, 0, 6);
        rig.set(0x6098, 0, figure.number);
        rig.set(0x6099, 1, static_cast<std::int64_t>(config.fast));
        rig.set(0x6099, 2, static_cast<std::int64_t>(config.slow));
        rig.set(0x609A, 0, static_cast<std::int64_t>(config.acceleration));
        rig.set(is_ismc ? 0x2F10 : 0x2050, is_ismc ? 0 : 3, config.retraction);
        ASSERT_TRUE(rig.enable());
        rig.control(0x1F);
        ASSERT_GE(rig.run_until([&] { return (rig.status() & 0x3400) != 0 && (rig.status() & 0x2400) != 0; }, 60000), 0)
            << std::hex << rig.status();
        ASSERT_EQ(rig.status() & 0x3400, 0x1400) << std::hex << rig.status() << " error " << rig.get(0x603F);
        rig.run_ms(400);  // time for the loops to settle against friction

        const Counts home = -rig.device.drive().position_offset();
        const Counts expected = expected_home(figure, world, *from, config.retraction);
        const Counts tolerance = drive::test::is_hard_stop(figure.number) && !figure.index ? 20 : 0;
        ASSERT_NEAR(static_cast<double>(home), static_cast<double>(expected), static_cast<double>(tolerance));
        // The drive's position is the true one, counted from home.
        ASSERT_EQ(rig.get(0x6064), rig.plant.position_counts() - home);
        if (method.returns_to_latch) {
          // Friction may end the last step some counts behind the target (drive::RestRule).
          ASSERT_NEAR(static_cast<double>(rig.get(0x6064)), 0.0, 4.0);
        } else if (figure.approach != 0 && !drive::test::is_hard_stop(figure.number) &&
                   !drive::test::uses_home(figure.number)) {
          // Beyond home by v^2 / 2a and at most the distance of one cycle: the edge is met at the slow speed.
          const double stop = config.slow * config.slow / (2.0 * config.acceleration);
          const double width = figure.index && figure.approach < 0 ? static_cast<double>(world.index_width) : 0.0;
          const double overrun = static_cast<double>(rig.get(0x6064)) * figure.approach + width;
          ASSERT_NEAR(overrun, stop, config.slow * 0.5e-3 * 3.0 + 2.0);
        }
      }
    }
  }
  std::printf("%d homings\n", runs);
  EXPECT_GT(runs, 100 * servodrome::test::draws(10));
}

TEST(HomingOnPlant, OfIsmc) { find_home_from_every_start<products::Ismc>(); }
TEST(HomingOnPlant, OfTheReferenceDrive) { find_home_from_every_start<products::Generic402>(); }

}  // namespace
}  // namespace homing_plant_test
}  // namespace servodrome
