#pragma once

#include <optional>
#include <random>

#include "drive/homing_axis.hpp"

// The home positions of the homing methods, calculated only from the figures of CiA 402-2 and the geometry; and random
// geometries to test them.
namespace servodrome::drive::test {

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  Counts between(Counts low, Counts high) {  // both limits are included
    return low + static_cast<Counts>(engine_() % static_cast<std::uint32_t>(high - low + 1));
  }

 private:
  std::mt19937 engine_;
};

// --- The home position by the figures of CiA 402-2: the boundary, and the direction from there to the index, if any.

enum class Place { negative_limit, positive_limit, home_negative_edge, home_positive_edge, start, hard_stop };

struct Figure {
  int number;
  Place place;
  int approach;  // direction of travel when home is found; 0: no motion
  bool index;
};

inline constexpr Figure figures[] = {
    {-4, Place::hard_stop, -1, true},
    {-3, Place::hard_stop, 1, true},
    {-2, Place::hard_stop, -1, false},
    {-1, Place::hard_stop, 1, false},
    {1, Place::negative_limit, 1, true},
    {2, Place::positive_limit, -1, true},
    {3, Place::home_negative_edge, -1, true},
    {4, Place::home_negative_edge, 1, true},
    {5, Place::home_positive_edge, 1, true},
    {6, Place::home_positive_edge, -1, true},
    {7, Place::home_negative_edge, -1, true},
    {8, Place::home_negative_edge, 1, true},
    {9, Place::home_positive_edge, -1, true},
    {10, Place::home_positive_edge, 1, true},
    {11, Place::home_positive_edge, 1, true},
    {12, Place::home_positive_edge, -1, true},
    {13, Place::home_negative_edge, 1, true},
    {14, Place::home_negative_edge, -1, true},
    {17, Place::negative_limit, 1, false},
    {18, Place::positive_limit, -1, false},
    {19, Place::home_negative_edge, -1, false},
    {20, Place::home_negative_edge, 1, false},
    {21, Place::home_positive_edge, 1, false},
    {22, Place::home_positive_edge, -1, false},
    {23, Place::home_negative_edge, -1, false},
    {24, Place::home_negative_edge, 1, false},
    {25, Place::home_positive_edge, -1, false},
    {26, Place::home_positive_edge, 1, false},
    {27, Place::home_positive_edge, 1, false},
    {28, Place::home_positive_edge, -1, false},
    {29, Place::home_negative_edge, 1, false},
    {30, Place::home_negative_edge, -1, false},
    {33, Place::start, -1, true},
    {34, Place::start, 1, true},
    {35, Place::start, 0, false},
    {37, Place::start, 0, false},
};

// The lower boundary of the first index that lies completely beyond `boundary`.
inline Counts index_beyond(Counts boundary, int direction, const World& world) {
  Counts index = world.index;
  if (direction > 0) {
    while (index >= boundary) index -= world.revolution;
    while (index < boundary) index += world.revolution;
  } else {
    while (index + world.index_width <= boundary) index += world.revolution;
    while (index + world.index_width > boundary) index -= world.revolution;
  }
  return index;
}

inline Counts expected_home(const Figure& figure, const World& world, Counts start, Counts retraction) {
  switch (figure.place) {
    case Place::negative_limit:
      return figure.index ? index_beyond(world.negative_limit, figure.approach, world) : world.negative_limit;
    case Place::positive_limit:
      return figure.index ? index_beyond(world.positive_limit, figure.approach, world) : world.positive_limit;
    case Place::home_negative_edge:
      return figure.index ? index_beyond(world.home_from, figure.approach, world) : world.home_from;
    case Place::home_positive_edge:
      return figure.index ? index_beyond(world.home_to, figure.approach, world) : world.home_to;
    case Place::start:
      // From inside of count `start`: its upper boundary in positive direction, its lower one in negative direction.
      if (figure.approach == 0) return start;
      return index_beyond(figure.approach > 0 ? start + 1 : start, figure.approach, world);
    case Place::hard_stop:
      if (figure.approach > 0) {
        return figure.index ? index_beyond(world.low_stop + 1, 1, world) : world.low_stop + retraction;
      }
      return figure.index ? index_beyond(world.high_stop, -1, world) : world.high_stop - retraction;
  }
  return 0;
}

// --- Geometry

inline bool uses_home(int number) { return (number >= 3 && number <= 14) || (number >= 19 && number <= 30); }
inline bool is_hard_stop(int number) { return number < 0; }

struct Setting {
  World world;
  HomingConfig config;
};

inline Setting random_setting(const Figure& figure, Random& random) {
  Setting setting;
  HomingConfig& config = setting.config;
  config.slow = static_cast<double>(random.between(500, 6000));
  config.fast = static_cast<double>(random.between(6000, 30000));
  config.acceleration = static_cast<double>(random.between(200000, 2000000));
  config.stall_torque = 1.5F;
  config.stall_cycles = static_cast<std::uint32_t>(random.between(1, 40));
  config.retraction = random.between(0, 3) == 0 ? 0 : random.between(1, 2500);
  config.timeout_cycles = 200000;

  World& world = setting.world;
  world.revolution = random.between(300, 2000);
  world.index_width = random.between(1, 20);
  config.index_width = world.index_width;
  world.index = random.between(-3000, 3000);
  // Leaves room for an index and for the longest stopping distance (2250 counts) on both sides of each switch.
  const Counts room = world.revolution + 2500;
  const Counts width = random.between(1, 3000);
  world.home_from = random.between(-2000, 2000);
  world.home_to = world.home_from + width;
  world.negative_limit = world.home_from - room - random.between(0, 2000);
  world.positive_limit = world.home_to + room + random.between(0, 2000);
  world.low_stop = world.negative_limit - 6000;
  world.high_stop = world.positive_limit + 6000;
  const int number = pattern(figure.number);
  if (number == 3 || number == 4) world.home_to = world.high_stop + 1;  // stays active up to the end of the travel
  if (number == 5 || number == 6) world.home_from = world.low_stop;
  if (is_hard_stop(figure.number)) {  // no switches within the travel
    world.low_stop = world.negative_limit + random.between(1, 1000);
    world.high_stop = world.positive_limit - random.between(2, 1000);
  }
  return setting;
}

enum class Start { below_home, on_home, above_home, on_negative_limit, on_positive_limit };
inline constexpr Start starts[] = {Start::below_home, Start::on_home, Start::above_home, Start::on_negative_limit,
                                   Start::on_positive_limit};

// Returns nothing if the geometry has no such position, or if the method begins by moving further onto the limit switch
// that is active.
inline std::optional<Counts> start_position(const Figure& figure, const World& world, Start start, Random& random) {
  Counts low = std::max(world.low_stop, world.negative_limit);
  Counts high = std::min(world.high_stop, world.positive_limit - 1);
  if (figure.number == 33) low += world.revolution + world.index_width;  // there is an index in front of the limit
  if (figure.number == 34) high -= world.revolution + world.index_width;
  switch (start) {
    case Start::below_home:
      if (world.home_from <= low) return std::nullopt;
      return random.between(low, world.home_from - 1);
    case Start::on_home: return random.between(std::max(low, world.home_from), std::min(high, world.home_to - 1));
    case Start::above_home:
      if (world.home_to > high) return std::nullopt;
      return random.between(world.home_to, high);
    case Start::on_negative_limit:
      if (is_hard_stop(figure.number) || figure.number == 33) return std::nullopt;
      return random.between(world.negative_limit - 3000, world.negative_limit - 1);
    case Start::on_positive_limit:
      if (is_hard_stop(figure.number) || figure.number == 34) return std::nullopt;
      return random.between(world.positive_limit, world.positive_limit + 3000);
  }
  return std::nullopt;
}

inline const Figure* figure_of(int number) {
  for (const Figure& figure : figures) {
    if (figure.number == number) return &figure;
  }
  return nullptr;
}

}  // namespace servodrome::drive::test
