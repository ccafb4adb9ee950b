// The names of the statusword's bits belong to bits that the drive shows, and every such bit has a name.
#include "catalogue/status_words.hpp"

#include <algorithm>
#include <gtest/gtest.h>

#include "drive/drive.hpp"
#include "line/registry.hpp"

namespace servodrome::line {
namespace status_words_test {
namespace {

using drive::StatusSource;

const drive::Mode all_modes[] = {drive::Mode::pulse,
                                 drive::Mode::immediate_velocity,
                                 drive::Mode::profile_position,
                                 drive::Mode::velocity,
                                 drive::Mode::profile_velocity,
                                 drive::Mode::profile_torque,
                                 drive::Mode::homing,
                                 drive::Mode::interpolated_position,
                                 drive::Mode::cyclic_sync_position,
                                 drive::Mode::cyclic_sync_velocity,
                                 drive::Mode::cyclic_sync_torque};

TEST(StatusWords, AreThoseThatTheDriveShows) {
  for (const Product& product : all_products()) {
    const auto device = product.make({});
    const drive::Policy& policy = device->drive().policy();
    for (const drive::Mode mode : all_modes) {
      if ((policy.modes.supported & drive::mode_bit(mode)) == 0) continue;
      for (unsigned bit = 8; bit < 16; ++bit) {
        const auto row = std::find_if(policy.status.bits.begin(), policy.status.bits.end(), [&](const auto& one) {
          return one.bit == bit && (one.modes & drive::mode_bit(mode)) != 0;
        });
        const std::string name(catalogue::status_bit_name(product.name, bit, static_cast<std::int8_t>(mode)));
        const auto where = testing::Message() << product.name << ", mode " << static_cast<int>(mode) << ", bit " << bit;
        const bool is_shown =
            row != policy.status.bits.end() && (row->source != StatusSource::remote || policy.status.remote);
        if (!is_shown) {
          EXPECT_EQ(name, "") << where;
        } else if (row->source != StatusSource::mode_bit_12 && row->source != StatusSource::mode_bit_13) {
          EXPECT_NE(name, "") << where;
        }
      }
    }
  }
}

TEST(StatusWords, TellAFailedHomingOfAnIsmk) {
  EXPECT_EQ(catalogue::status_bit_name("ismk", 12, 6), "homing error");
  EXPECT_EQ(catalogue::status_bit_name("ismk", 15, 6), "home found");
  EXPECT_EQ(catalogue::status_bit_name("generic402", 12, 6), "homing attained");
  EXPECT_EQ(catalogue::status_bit_name("unknown", 12, 4), "");
}

TEST(ModeNames, AreTheProducts) {
  EXPECT_EQ(catalogue::mode_name("ismk", -4), "pulse");
  EXPECT_EQ(catalogue::mode_name("ismk", 1), "profile position");
  EXPECT_EQ(catalogue::mode_name("generic402", -4), "manufacturer-specific mode");
  EXPECT_EQ(catalogue::mode_name("generic402", 5), "reserved mode");
  for (const Product& product : all_products()) {
    const auto device = product.make({});
    for (const drive::Mode mode : all_modes) {
      if ((device->drive().policy().modes.supported & drive::mode_bit(mode)) == 0) continue;
      EXPECT_FALSE(catalogue::mode_name(product.name, static_cast<std::int8_t>(mode)).ends_with("mode"))
          << product.name << " " << static_cast<int>(mode);
    }
  }
}

}  // namespace
}  // namespace status_words_test
}  // namespace servodrome::line
