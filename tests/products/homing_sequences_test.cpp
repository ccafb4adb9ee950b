#include <cmath>
#include <gtest/gtest.h>

#include "catalogue/product.hpp"
#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"

// Homing that does not end as planned: its offset leads into a limit switch, or it is cancelled. The test measures the
// true shaft.
namespace servodrome {
namespace homing_sequences_test {
namespace {

using test::Rig;

template <typename RigType>
bool bit(RigType& rig, unsigned number) {
  return (rig.status() >> number & 1U) != 0;
}

// --- The home offset 607Ch and the limit switches

// A home switch at 1 to 2 turns, limit switches 4 turns to either side.
plant::Parameters jmc_between_limits() {
  plant::Parameters parameters = test::jmc_plant();
  parameters.encoder.start_position_counts = 0;
  parameters.switches[0].wire = 0;
  parameters.switches[0].from_counts = 4 * 4000;
  parameters.switches[1].wire = 1;
  parameters.switches[1].from_counts = 1 * 4000;
  parameters.switches[1].to_counts = 2 * 4000;
  parameters.switches[2].wire = 2;
  parameters.switches[2].to_counts = -4 * 4000;
  parameters.switch_count = 3;
  return parameters;
}
struct Jmc : test::JmcRig {
  Jmc(std::int64_t method, std::int64_t offset_turns) : JmcRig(jmc_between_limits(), test::jmc_settings()) {
    open_limits();
    set(0x605A, 0, 2);
    set(0x6060, 0, 6);
    set(0x6098, 0, method);
    set(0x6099, 1, 8000);
    set(0x6099, 2, 5000);
    set(0x609A, 0, 200000);
    set(0x607C, 0, 4000 * offset_turns);
    EXPECT_TRUE(enable());
    control(0x1F);
  }
  double turns() const { return static_cast<double>(plant.position_counts()) / 4000.0; }
};
template <typename RigType>
double furthest_turns(RigType& rig, int milliseconds) {
  double furthest = rig.turns();
  for (int i = 0; i < milliseconds; ++i) {
    rig.run_ms(1);
    furthest = std::max(furthest, rig.turns());
  }
  return furthest;
}

// Chart 45: 609Ah is "the deceleration speed when it reaches the limit". Chart 273: bit 12 complete, bit 13 error.
TEST(HomeOffset, JmcStopsAtALimitSwitch) {
  for (const int method : {24, 19}) {
    SCOPED_TRACE(method);
    Jmc rig(method, 6);
    EXPECT_LT(furthest_turns(rig, 4500), 4.05);
    EXPECT_NEAR(rig.turns(), 4.0, 0.05);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
    EXPECT_TRUE(bit(rig, 13));
    EXPECT_FALSE(bit(rig, 12));
    Jmc short_of_it(method, 2);
    short_of_it.run_ms(4000);
    EXPECT_NEAR(short_of_it.turns(), 3.0, 0.02);
    EXPECT_EQ(short_of_it.get(0x6064), 0) << "travelled to 607Ch (HM)";
    EXPECT_TRUE(bit(short_of_it, 12));
    EXPECT_FALSE(bit(short_of_it, 13));
  }
}

// C35: bit 12 is the error, bit 15 home that is found. Ch. 5.6.1: "the corresponding movement direction is prohibited".
struct Ismk : test::IsmkRig {
  explicit Ismk(std::int64_t offset_turns) : IsmkRig(between_switches(), test::ismk_settings()) {
    set(0x2010, 3, 0x0040);  // DIN1: home
    set(0x2010, 4, 0x0010);  // DIN2: positive limit, normally open by the polarity of 2010h sub 1
    set(0x2010, 1, 0xFD);
    set(0x6060, 0, 6);
    set(0x6098, 0, 19);
    set(0x607C, 0, 65536 * offset_turns);
    EXPECT_TRUE(enable());
    control(0x1F);
  }
  static plant::Parameters between_switches() {
    plant::Parameters parameters = test::ismk_plant();
    parameters.switches[0].wire = 0;
    parameters.switches[0].from_counts = 65536;
    parameters.switches[0].to_counts = 65536 * 100;
    parameters.switches[1].wire = 1;
    parameters.switches[1].from_counts = 65536 * 4;
    parameters.switch_count = 2;
    return parameters;
  }
  double turns() const { return static_cast<double>(plant.position_counts()) / 65536.0; }
};
TEST(HomeOffset, IsmkStopsAtALimitSwitch) {
  Ismk rig(8);
  EXPECT_LT(furthest_turns(rig, 4000), 4.06);
  EXPECT_NEAR(rig.turns(), 4.0, 0.06);
  EXPECT_TRUE(bit(rig, 12));
  EXPECT_FALSE(bit(rig, 15));
  Ismk short_of_it(2);
  short_of_it.run_ms(4000);
  EXPECT_NEAR(short_of_it.turns(), 3.0, 0.02);
  EXPECT_FALSE(bit(short_of_it, 12));
  EXPECT_TRUE(bit(short_of_it, 15));
}

// --- Cancelled on the way to the offset

// Chart 273: "0: Homing incomplete".
TEST(HomingGivenUp, JmcOnTheWayToItsOffset) {
  struct Case {
    const char* what;
    void (*carry_out)(Jmc&);
  };
  const Case cases[] = {
      {"start bit taken away", [](Jmc& rig) { rig.control(0x0F); }},
      {"quick stop",
       [](Jmc& rig) {
         rig.control(0x02);
         rig.run_ms(1000);
         EXPECT_TRUE(rig.enable());
       }},
      {"another mode",
       [](Jmc& rig) {
         rig.set(0x6060, 0, 1);
         rig.run_ms(1000);
         rig.set(0x6060, 0, 6);
       }},
  };
  for (const Case& row : cases) {
    SCOPED_TRACE(row.what);
    Jmc rig(24, 6);
    rig.run_ms(1500);
    ASSERT_GT(rig.turns(), 2.0);
    ASSERT_LT(rig.turns(), 3.9);
    EXPECT_TRUE(bit(rig, 12)) << "home is found";
    row.carry_out(rig);
    rig.run_ms(500);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
    EXPECT_FALSE(bit(rig, 12));
    EXPECT_FALSE(bit(rig, 13));
  }
}

// --- Cancelled while it presses against a hard stop

template <typename Product>
void pressing_given_up(std::int64_t method, bool other_mode) {
  constexpr std::int64_t turn = 131072;
  plant::Parameters parameters = test::default_plant();
  parameters.load.low_stop_counts = -2 * turn;
  parameters.load.high_stop_counts = 2 * turn;
  Rig<Product> rig(parameters);
  rig.set(0x6060, 0, 6);
  ASSERT_EQ(rig.set(0x6098, 0, method), dictionary::AbortCode::none);
  rig.set(0x6099, 1, 2 * turn);
  rig.set(0x6099, 2, turn * 3 / 10);
  rig.set(0x609A, 0, 20 * turn);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  ASSERT_GE(rig.run_until([&] { return std::abs(rig.plant.position_counts()) > 2 * turn - 30; }, 4000), 0);
  rig.run_ms(15);
  const auto torque = [&] { return std::abs(static_cast<double>(rig.device.drive().loops().torque)); };
  const double pressed = torque();
  ASSERT_GT(pressed, 0.3) << "of rated torque";
  if (other_mode) {
    rig.set(0x6060, 0, 1);
  } else {
    rig.control(0x0F);
  }
  rig.run_ms(100);
  for (int i = 0; i < 500; ++i) {
    rig.run_ms(1);
    ASSERT_LT(torque(), 0.5 * pressed) << i;
    ASSERT_NEAR(rig.plant.velocity_rpm(), 0.0, 5.0);
  }
}
TEST(HomingGivenUp, PressesNoMore) {
  for (const int method : {-1, -2, -3, -4}) {
    for (const bool other_mode : {false, true}) {
      SCOPED_TRACE(::testing::Message() << "method " << method << (other_mode ? ", another mode" : ", start bit"));
      pressing_given_up<products::Ismc>(method, other_mode);
      pressing_given_up<products::Generic402>(method, other_mode);
    }
  }
}

}  // namespace
}  // namespace homing_sequences_test
}  // namespace servodrome
