#include <gtest/gtest.h>

#include "generate.hpp"
#include "machine.hpp"

namespace servodrome::motion {
namespace motion_tree_test {
namespace {

constexpr std::uint64_t seed = 7;
constexpr Tree tree{2};

std::vector<Event> until(const Sequence& sequence, std::int64_t tick) {
  std::vector<Event> events;
  for (const Event& event : sequence.events) {
    if (event.tick < tick) events.push_back(event);
  }
  return events;
}

TEST(MotionTree, LeavesShareTheirBeginningsAndNothingElse) {
  const std::vector<Variant> list = variants();
  for (std::uint64_t first = 0; first < 40 * tree.leaves(); first += tree.leaves()) {
    const Drawn stem = draw(seed, first, list, tree);
    ASSERT_EQ(stem.forks.size(), 2U);
    EXPECT_LE(stem.forks[0], stem.forks[1]);
    EXPECT_LE(stem.forks[1], stem.sequence.end_tick);
    int different = 0;
    for (std::uint64_t leaf = 1; leaf < tree.leaves(); ++leaf) {
      const Drawn drawn = draw(seed, first + leaf, list, tree);
      EXPECT_EQ(drawn.sequence.axes, stem.sequence.axes);
      EXPECT_EQ(drawn.forks[0], stem.forks[0]);
      EXPECT_EQ(until(drawn.sequence, stem.forks[0]), until(stem.sequence, stem.forks[0]));
      if (leaf < Tree::ways) {  // another leaf with the same second part
        EXPECT_EQ(drawn.forks[1], stem.forks[1]);
        EXPECT_EQ(until(drawn.sequence, stem.forks[1]), until(stem.sequence, stem.forks[1]));
      }
      different += drawn.sequence.events != stem.sequence.events || drawn.sequence.end_tick != stem.sequence.end_tick;
    }
    EXPECT_EQ(different, 15) << first;
  }
}

// A run that begins inside a tree would execute a different sequence than its number means.
TEST(MotionTree, BeginsWithItsFirstLeaf) {
  const std::vector<Variant> list = variants();
  const std::uint64_t inside = 3 * tree.leaves() + 5;
  EXPECT_EQ(tree.first_leaf(inside), 3 * tree.leaves());
  EXPECT_EQ(tree.first_leaf(3 * tree.leaves()), 3 * tree.leaves());
  EXPECT_EQ(Tree{}.first_leaf(inside), inside);
  EXPECT_EQ(draw(seed, inside, list, tree).sequence.axes,
            draw(seed, tree.first_leaf(inside), list, tree).sequence.axes);
}

TEST(MotionTree, WithoutLevelsEachSequenceStandsAlone) {
  const std::vector<Variant> list = variants();
  EXPECT_TRUE(draw(seed, 3, list).forks.empty());
  EXPECT_NE(draw(seed, 3, list).sequence, draw(seed, 4, list).sequence);
}

// Up to a fork, a shared run equals the run of each leaf to the last bit.
TEST(MotionTree, ALifeThatGoesOnIsTheWholeLeaf) {
  const std::vector<Variant> list = variants();
  for (std::uint64_t first = 0; first < 12 * tree.leaves(); first += tree.leaves()) {
    const Drawn stem = draw(seed, first, list, tree);
    const Drawn leaf = draw(seed, first + 6, list, tree);
    Life life(stem.sequence, {});
    ASSERT_TRUE(life.run_to(stem.forks[0])) << first;
    EXPECT_EQ(life.ticks(), stem.forks[0]);
    life.go_on_with(leaf.sequence);
    ASSERT_TRUE(life.run_to(leaf.forks[1])) << first;
    const Outcome outcome = life.end(false);
    const Outcome whole = run(leaf.sequence);
    EXPECT_EQ(outcome.ticks, whole.ticks) << first;
    EXPECT_EQ(outcome.fingerprint, whole.fingerprint) << first;
    EXPECT_FALSE(outcome.finding.has_value()) << first;
  }
}

}  // namespace
}  // namespace motion_tree_test
}  // namespace servodrome::motion
