// Compares the ring of recorded frames with a list that has no memory limit.
#include <deque>
#include <gtest/gtest.h>
#include <random>

#include "line/support.hpp"
#include "line/traffic.hpp"

namespace servodrome::line {
namespace traffic_ring_test {
namespace {

struct Kept {
  std::uint64_t number;
  std::vector<std::uint8_t> bytes;
};

TEST(TrafficRing, FramesOfAllSizesAgainstAList) {
  std::minstd_rand random(11);
  for (const std::size_t size : {256UL, 1000UL, 4096UL}) {
    TrafficRing ring(size);
    std::deque<Kept> all;
    TrafficRing::Cursor follower = ring.begin();  // reads all frames from time to time
    TrafficRing::Cursor late = ring.begin();      // reads rarely
    std::uint64_t followed = 0;
    for (std::uint64_t number = 1; number <= 20'000; ++number) {
      Kept one{number, std::vector<std::uint8_t>(random() % 120)};
      for (auto& byte : one.bytes) byte = static_cast<std::uint8_t>(random() % 8 == 0 ? 0xFF : random() >> 8);
      TrafficFrame frame;
      frame.at = Time(static_cast<std::int64_t>(number));
      frame.sender = static_cast<std::uint32_t>(number * 7);
      frame.kind = TrafficKind::serial;
      const std::span<const std::uint8_t> bytes(one.bytes);
      const std::size_t cut = one.bytes.empty() ? 0 : random() % one.bytes.size();
      ring.add(frame, bytes.first(cut), bytes.subspan(cut));
      all.push_back(std::move(one));
      ASSERT_EQ(ring.newest(), number);
      while (all.front().number < ring.oldest()) all.pop_front();
      ASSERT_GE(all.size(), 1U);
      const auto read = [&](TrafficRing::Cursor& cursor) {
        std::uint64_t expected = std::max(cursor.number, ring.oldest());
        while (const auto got = ring.next(cursor)) {
          ASSERT_EQ(got->number, expected);
          const Kept& kept = all.at(static_cast<std::size_t>(expected - all.front().number));
          ASSERT_TRUE(std::equal(got->bytes.begin(), got->bytes.end(), kept.bytes.begin(), kept.bytes.end()))
              << expected;
          ASSERT_EQ(got->at.count(), static_cast<std::int64_t>(expected));
          ASSERT_EQ(got->sender, expected * 7);
          ++expected;
          ++followed;
        }
        ASSERT_EQ(expected, number + 1);
      };
      if (random() % 3 == 0) read(follower);
      if (random() % 97 == 0) read(late);
      if (random() % 50 == 0) {
        TrafficRing::Cursor whole = ring.begin();
        read(whole);
      }
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(followed, 10'000U);
    EXPECT_LE(all.size(), size / 16);
    EXPECT_EQ(ring.clear().number, 20'001U);
    TrafficRing::Cursor cursor = ring.begin();
    EXPECT_FALSE(ring.next(cursor));
  }
}

TEST(TrafficRing, WhatIsLongerThanTheRingIsLeftOut) {
  TrafficRing ring(128);
  ring.add({}, {}, std::vector<std::uint8_t>(200));
  EXPECT_EQ(ring.newest(), 0U);
}

TEST(TrafficTap, AnAxisOnCanIsHeardAndALineWithoutTapIsTheSame) {
  Line line(test::settings_of(test::two_axes));
  TrafficRing ring(1 << 16);
  {
    const auto tap = TrafficTap::on(*line.buses().front(), ring);
    line.run_until(std::chrono::milliseconds(500));
  }
  const std::uint64_t heard = ring.newest();
  EXPECT_GE(heard, 2U);  // at least two boot-up messages
  TrafficRing::Cursor cursor = ring.begin();
  const auto first = ring.next(cursor);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->kind, TrafficKind::can);
  line.run_until(std::chrono::seconds(3));
  EXPECT_EQ(ring.newest(), heard);  // the tap has been destroyed
}

}  // namespace
}  // namespace traffic_ring_test
}  // namespace servodrome::line
