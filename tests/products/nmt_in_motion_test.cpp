// The effect of an NMT command on a moving axis, as in the README of each CAN product.
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

namespace servodrome {
namespace nmt_in_motion_test {
namespace {

enum class After : std::uint8_t { moves_on, fault_reaction, lets_go };

struct Row {
  std::uint8_t command;
  After after;
};

template <typename DeviceType>
void check(const std::vector<Row>& rows, std::int64_t speed) {
  for (const Row& row : rows) {
    SCOPED_TRACE("NMT command " + std::to_string(row.command));
    test::Rig<DeviceType> rig;
    ASSERT_EQ(rig.set(0x6060, 0, 3), dictionary::AbortCode::none);
    ASSERT_TRUE(rig.enable());
    rig.set(0x60FF, 0, speed);
    rig.send(0, {1, 0});
    rig.run_ms(1000);
    const double before = rig.plant.velocity_rpm();
    ASSERT_GT(before, 30.0);
    rig.send(0, {row.command, 0});
    rig.run_ms(1);
    const auto state = rig.device.drive().state();
    if (row.after == After::moves_on) {
      EXPECT_EQ(state, drive::PowerState::operation_enabled);
      rig.run_ms(500);
      EXPECT_NEAR(rig.plant.velocity_rpm(), before, 0.1 * before);
      EXPECT_EQ(rig.device.drive().state(), drive::PowerState::operation_enabled);
    } else if (row.after == After::fault_reaction) {
      EXPECT_TRUE(state == drive::PowerState::fault_reaction_active || state == drive::PowerState::fault);
    } else {
      EXPECT_FALSE(rig.actuation.pwm_enabled);
      EXPECT_EQ(state, drive::PowerState::switch_on_disabled);
    }
  }
}

constexpr std::uint8_t stop = 2;
constexpr std::uint8_t pre_operational = 0x80;
constexpr std::uint8_t reset_node = 0x81;
constexpr std::uint8_t reset_communication = 0x82;

TEST(NmtInMotion, Ismc) {
  check<products::Ismc>({{stop, After::moves_on},
                         {pre_operational, After::moves_on},
                         {reset_communication, After::moves_on},
                         {reset_node, After::lets_go}},
                        500000);
}

TEST(NmtInMotion, Pronet) {
  check<products::Pronet>({{stop, After::moves_on},
                           {pre_operational, After::moves_on},
                           {reset_communication, After::moves_on},
                           {reset_node, After::lets_go}},
                          500000);
}

}  // namespace
}  // namespace nmt_in_motion_test
}  // namespace servodrome
