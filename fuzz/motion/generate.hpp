#pragma once

#include "catalogue.hpp"
#include "random.hpp"
#include "sequence.hpp"

namespace servodrome::motion {

// How sequences share their beginnings. Each of the last `levels` steps of a sequence is drawn `ways` times for the
// same beginning: the sequences numbered n * leaves() ... n * leaves() + leaves() - 1 are the leaves of one tree. 0
// levels: each sequence stands alone.
struct Tree {
  static constexpr std::uint64_t ways = 4;
  unsigned levels = 0;

  std::uint64_t leaves(unsigned level = 0) const {  // of the tree, or of a part that begins at this level
    std::uint64_t count = 1;
    for (unsigned i = level; i < levels; ++i) count *= ways;
    return count;
  }
  // The first leaf of the tree that this sequence belongs to.
  std::uint64_t first_leaf(std::uint64_t number) const { return number / leaves() * leaves(); }
};

struct Drawn {
  Sequence sequence;
  std::vector<std::int64_t>
      forks;  // ticks, one for each level: up to there all sequences of that part of the tree are equal
};

// The sequence with this number of a run: a pure function of the seed, the number, the variants and the tree.
Drawn draw(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree = {});

}  // namespace servodrome::motion
