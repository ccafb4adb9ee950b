#pragma once

#include "catalogue.hpp"
#include "random.hpp"
#include "sequence.hpp"

namespace servodrome::motion {

// Sequences with a common beginning form a tree. At each of the last `levels` steps the tree branches into `ways`
// continuations. The sequences n * leaves() to n * leaves() + leaves() - 1 are the leaves of one tree. 0 levels:
// sequences have no common beginning.
struct Tree {
  static constexpr std::uint64_t ways = 4;
  unsigned levels = 0;

  std::uint64_t leaves(unsigned level = 0) const {  // of the whole tree, or of a part from this level on
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
      forks;  // a tick for each level, up to which all sequences of that part of the tree are equal
};

// Draws the sequence with this number: a pure function of the seed, the number, the variants and the tree.
Drawn draw(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree = {});

}  // namespace servodrome::motion
