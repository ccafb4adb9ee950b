#pragma once

#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "rig.hpp"

namespace servodrome::test {

// A set-point at a distance of `stroke` from the present position.
template <typename RigType>
void one_move(RigType& rig, std::int64_t stroke) {
  rig.set(0x607A, 0, stroke);
  rig.control(0x0F);
  rig.run_ms(2);
  rig.control(0x5F);
  rig.run_ms(2);
  rig.control(0x0F);
}

// Gives a set-point by the edge of bit 4 in `word`, and resets the bit.
template <typename RigType>
void absolute_move(RigType& rig, std::int64_t target, std::uint16_t word) {
  const auto without = static_cast<std::uint16_t>(word ^ 0x10);
  rig.set(0x607A, 0, target);
  rig.control(without);
  rig.run_ms(2);
  rig.control(word);
  rig.run_ms(2);
  rig.control(without);
}

// The reference drive with an axis of 131072 counts per turn, enabled in a mode, with a switch for the positive limit.
struct Reference : Rig<products::Generic402> {
  explicit Reference(std::int64_t mode, const plant::Parameters& parameters = default_plant()) : Rig(parameters) {
    set(0x6060, 0, mode);
    set(0x6081, 0, 131072 * 2);
    set(0x6083, 0, 131072 * 10);
    set(0x6084, 0, 131072 * 10);
    set(0x2030, 1, static_cast<std::int64_t>(drive::Signal::positive_limit));
    EXPECT_TRUE(enable());
  }
  void limit_turns(double least, double greatest) {
    set(0x607D, 1, std::lround(131072.0 * least));
    set(0x607D, 2, std::lround(131072.0 * greatest));
  }
  double turns() { return static_cast<double>(plant.position_counts()) / 131072.0; }
  double turns_per_s() { return plant.velocity_rpm() / 60.0; }
  bool bit(unsigned number) { return (status() >> number & 1U) != 0; }
};

}  // namespace servodrome::test
