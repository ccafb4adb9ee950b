// Channels by their names, and the numbers in their bytes.
#include "tools/sampling/channel.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "master/problem_of.hpp"

namespace servodrome::master::sampling {
namespace channel_test {
namespace {

using master::test::problem_of;
using testing::HasSubstr;

TEST(SamplingChannel, IsFoundByItsNames) {
  const ObjectCatalogue& catalogue = ObjectCatalogue::standard();
  for (const char* text : {"position", "position_actual", "Position actual value", "6064", "6064:00", "0x6064"}) {
    const Channel channel = named_channel(text, catalogue);
    EXPECT_EQ(channel.object, (ObjectAddress{0x6064, 0})) << text;
    EXPECT_EQ(channel.name, "position_actual_value") << text;
    EXPECT_EQ(channel.type, dictionary::Type::integer32) << text;
    EXPECT_EQ(channel.unit, "pos") << text;
  }
  EXPECT_EQ(named_channel("following_error", catalogue).object.index, 0x60F4);
  EXPECT_EQ(named_channel("6099:01", catalogue).name, "homing_speeds_speed_during_search_for_switch");
  const Channel vendor = named_channel("2105:01@i16", catalogue);
  EXPECT_EQ(vendor.name, "2105_01");
  EXPECT_EQ(vendor.type, dictionary::Type::integer16);
  EXPECT_THAT(problem_of([&] { named_channel("2105:01@string", catalogue); }), HasSubstr("not a numeric type"));
  EXPECT_THAT(problem_of([&] { named_channel("pozition", catalogue); }), HasSubstr("\"pozition\""));
}

TEST(SamplingChannel, NumbersHaveTheirSignAndLength) {
  using dictionary::Type;
  EXPECT_EQ(number_of(Type::integer32, 0xFFFFFFFF, 32), -1);
  EXPECT_EQ(number_of(Type::integer32, 0xFFFF8000, 16), -32768) << "a mapped length shorter than the object";
  EXPECT_EQ(number_of(Type::unsigned16, 0xFFFFFFFF, 16), 65535);
  EXPECT_EQ(number_of(Type::integer64, ~std::uint64_t{0}, 64), -1);
  EXPECT_EQ(number_of(Type::real32, 0x3FC00000, 32), 1.5);
  EXPECT_EQ(number_of(Type::boolean, 1, 8), 1);
}

TEST(SamplingChannel, SixteenAndEachOnce) {
  std::vector<Channel> channels;
  for (std::uint8_t i = 0; i < most_channels; ++i) {
    EXPECT_EQ(add_channel(channels, {.object = {0x2000, i}, .name = "same"}), i);
  }
  EXPECT_EQ(add_channel(channels, {.object = {0x2000, 3}, .name = "same"}), 3U);
  EXPECT_NE(channels[0].name, channels[1].name);
  EXPECT_THAT(problem_of([&] { add_channel(channels, {.object = {0x2001, 0}}); }), HasSubstr("more than 16"));
}

}  // namespace
}  // namespace channel_test
}  // namespace servodrome::master::sampling
