#pragma once

#include <cstddef>
#include <cstdint>

namespace servodrome::motion {

// A generator of pseudo-random numbers (splitmix64): the same on every machine, and cheap to seed anew for each
// sequence.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  // The numbers for sequence `number` of a run with this seed.
  Random(std::uint64_t seed, std::uint64_t number) : state_(seed * 0xD1342543DE82EF95ULL + number) {
    next();
    next();
  }

  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  std::int64_t below(std::int64_t n) { return static_cast<std::int64_t>(next() % static_cast<std::uint64_t>(n)); }
  std::int64_t within(std::int64_t least, std::int64_t most) { return least + below(most - least + 1); }
  bool chance(int percent) { return below(100) < percent; }
  double unit() { return static_cast<double>(next() >> 11) * 0x1p-53; }

  template <typename List>
  const auto& of(const List& list) {
    return *(list.begin() + below(static_cast<std::int64_t>(list.size())));
  }

 private:
  std::uint64_t state_;
};

}  // namespace servodrome::motion
