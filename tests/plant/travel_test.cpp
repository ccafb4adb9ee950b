#include <gtest/gtest.h>
#include <random>
#include <vector>

#include "plant/rig.hpp"

// Encoder, switches, index, and the capture of their edges.
namespace servodrome::plant::test {
namespace travel_test {
namespace {

constexpr std::uint8_t index_source = drive::Edge::index_source;

bool operator==(const drive::Edge& a, const drive::Edge& b) {
  return a.source == b.source && a.rising == b.rising && a.position_counts == b.position_counts;
}

// Moves a bare motor at a given speed, which an external torque impulse sets in each tick.
struct Mover : Rig {
  using Rig::Rig;
  void set_speed(double speed_rpm) {
    const double inertia = plant.parameters().motor.rotor_inertia_kgm2;
    plant.set_external_torque_nm(-(speed_rpm - plant.velocity_rpm()) * rad_s_per_rpm * inertia / h);
    step();
    plant.set_external_torque_nm(0.0);
  }
};

std::int64_t floor_modulo(std::int64_t value, std::int64_t modulus) { return (value % modulus + modulus) % modulus; }

TEST(Encoder, OddResolutionDoesNotDriftOverABillionCounts) {
  Parameters p = bare_motor();
  p.encoder.counts_per_revolution = 99991;
  p.encoder.start_position_counts = -500'000'000;
  p.encoder.index_position_counts = 77;
  p.encoder.index_width_counts = 3;
  p.motor.torque_constant_nm_per_a = 1.0e-4;
  Rig rig(p);
  rig.spin_up(9000.0);
  const double counts_per_tick = rig.speed_rad_s() * h * 99991 / (2.0 * std::numbers::pi);
  const std::int64_t start = rig.plant.position_counts();
  const double start_fraction = rig.plant.position_fraction();
  long rising = 0;
  long falling = 0;
  std::int64_t ticks = 0;
  while (rig.plant.position_counts() < 500'000'000) {
    rig.step();
    ++ticks;
    ASSERT_EQ(rig.feedback.single_turn_counts,
              static_cast<std::uint32_t>(floor_modulo(rig.feedback.position_counts, 99991)));
    for (int i = 0; i < rig.feedback.edge_count; ++i) {
      const drive::Edge& edge = rig.feedback.edges[static_cast<std::size_t>(i)];
      ASSERT_EQ(edge.source, index_source);
      ASSERT_EQ(floor_modulo(edge.position_counts, 99991), edge.rising ? 77 : 80);
      (edge.rising ? rising : falling) += 1;
    }
  }
  const double exact = static_cast<double>(ticks) * counts_per_tick + start_fraction;
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - start) + rig.plant.position_fraction(), exact, 1e-3);
  EXPECT_EQ(rising, falling);
  EXPECT_NEAR(static_cast<double>(rising), 1.0e9 / 99991, 1.0);
}

TEST(Encoder, StartingOnTheIndexItsEndComesFirst) {
  for (const int direction : {1, -1}) {
    Parameters p = bare_motor();
    p.encoder.counts_per_revolution = 1000;
    p.encoder.index_position_counts = 77;
    p.encoder.index_width_counts = 3;
    p.encoder.start_position_counts = 78;
    Mover rig(p);
    std::vector<drive::Edge> edges;
    while (edges.size() < 2) {
      rig.set_speed(direction * 300.0);
      for (int i = 0; i < rig.feedback.edge_count; ++i)
        edges.push_back(rig.feedback.edges[static_cast<std::size_t>(i)]);
    }
    EXPECT_TRUE(edges[0] == (drive::Edge{index_source, false, direction > 0 ? 80 : 76}));
    EXPECT_TRUE(edges[1] == (drive::Edge{index_source, true, direction > 0 ? 1077 : -921}));
  }
}

TEST(Encoder, QuantisesDownwards) {
  Parameters p = bare_motor();
  p.encoder.counts_per_revolution = 10;
  p.encoder.start_position_counts = 3;
  Mover rig(p);
  rig.set_speed(-1.0);
  rig.run(16);
  EXPECT_EQ(rig.feedback.position_counts, 2);
  EXPECT_EQ(rig.feedback.single_turn_counts, 2u);
}

TEST(Encoder, DirectionTurnsTheCountNotTheMotor) {
  for (const int direction : {1, -1}) {
    Parameters p = bare_motor();
    p.encoder.direction = direction;
    p.encoder.commutation_offset_turns = 0.3;
    Rig rig(p);
    EXPECT_NEAR(rig.plant.electrical_angle_turns(), 0.3, 1e-12);
    for (int i = 0; i < 20; ++i) rig.step_voltage(0.0, 5.0);
    EXPECT_GT(direction * rig.plant.velocity_rpm(), 0.0);
    EXPECT_GT(direction * rig.plant.position_counts(), 10);
    EXPECT_GT(direction * rig.plant.torque_nm(), 0.0);
    EXPECT_GT(direction * rig.plant.current_a(), 0.0);
  }
}

TEST(Encoder, CommutationAngleFollowsTheCount) {
  Parameters p = bare_motor();
  p.encoder.counts_per_revolution = 10000;
  p.encoder.commutation_offset_turns = 0.25;
  p.motor.pole_pairs = 4;
  Rig rig(p);
  for (const std::int64_t position : {0, 625, 2500, -1, 9999, 123456789}) {
    rig.plant.set_position_counts(position);
    const double turns = static_cast<double>(floor_modulo(position, 10000)) * 4.0 / 10000 + 0.25;
    EXPECT_NEAR(rig.plant.electrical_angle_turns(), turns - std::floor(turns), 1e-9);
    rig.plant.sample(rig.feedback);
    EXPECT_EQ(rig.feedback.position_counts, position);
  }
}

// The expected levels, count by count.
struct ReferenceSwitches {
  explicit ReferenceSwitches(const Parameters& parameters) : p(parameters) {
    for (std::size_t i = 0; i < p.switch_count; ++i) {
      const Switch& s = p.switches[i];
      on.push_back(p.encoder.start_position_counts >= s.from_counts && p.encoder.start_position_counts <= s.to_counts);
    }
    index = at_index(p.encoder.start_position_counts);
  }
  bool at_index(std::int64_t position) const {
    return floor_modulo(position - p.encoder.index_position_counts, p.encoder.counts_per_revolution) <
           p.encoder.index_width_counts;
  }
  void arrive(std::int64_t position, std::vector<drive::Edge>& edges) {
    for (std::size_t i = 0; i < p.switch_count; ++i) {
      const Switch& s = p.switches[i];
      const std::int64_t slack = on[i] ? s.hysteresis_counts : 0;
      const bool now = (s.from_counts == no_low_limit || position >= s.from_counts - slack) &&
                       (s.to_counts == no_high_limit || position <= s.to_counts + slack);
      if (now == on[i]) continue;
      on[i] = now;
      edges.push_back({s.wire, now != s.normally_closed, position});
    }
    if (at_index(position) == index) return;
    index = !index;
    edges.push_back({index_source, index, position});
  }
  std::uint32_t inputs() const {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < p.switch_count; ++i) {
      if (on[i] != p.switches[i].normally_closed) bits |= 1u << p.switches[i].wire;
    }
    return bits;
  }
  Parameters p;
  std::vector<bool> on;
  bool index;
};

TEST(Switches, EdgesAreExactAtRandomSpeedsInBothDirections) {
  std::mt19937_64 random(20240607);
  int edges_seen = 0;
  int crowded = 0;
  for (int machine = 0; machine < 60; ++machine) {
    Parameters p = bare_motor();
    p.motor.torque_constant_nm_per_a = 1.0e-4;
    p.encoder.counts_per_revolution = 500 + static_cast<std::int32_t>(random() % 3000);
    p.encoder.index_position_counts = static_cast<std::int32_t>(random() % 400);
    p.encoder.index_width_counts = static_cast<std::int32_t>(random() % 5);
    p.encoder.start_position_counts = static_cast<std::int64_t>(random() % 4000) - 2000;
    p.switch_count = random() % 9;
    for (std::size_t i = 0; i < p.switch_count; ++i) {
      Switch& s = p.switches[i];
      s.wire = static_cast<std::uint8_t>((i * 5 + 3) % 32);
      s.from_counts = static_cast<std::int64_t>(random() % 6000) - 3000;
      s.to_counts = s.from_counts + static_cast<std::int64_t>(random() % 300);
      if (random() % 4 == 0) s.from_counts = no_low_limit;
      if (random() % 4 == 0) s.to_counts = no_high_limit;
      s.hysteresis_counts = static_cast<std::int64_t>(random() % 20);
      s.normally_closed = random() % 2 == 0;
    }
    Mover rig(p);
    ReferenceSwitches reference(p);
    rig.plant.sample(rig.feedback);
    ASSERT_EQ(rig.feedback.inputs, reference.inputs());
    std::int64_t position = rig.feedback.position_counts;
    for (int tick = 0; tick < 3000; ++tick) {
      if (tick % 40 == 0) {
        // From creep speed to several thousand counts per tick; towards home if it is far away.
        double speed = std::pow(10.0, static_cast<double>(random() % 1000) / 170.0);
        if (random() % 2 == 0) speed = -speed;
        if (std::abs(position) > 4000) speed = position > 0 ? -std::abs(speed) : std::abs(speed);
        rig.set_speed(speed);
      } else {
        rig.step();
      }
      std::vector<drive::Edge> edges;
      const std::int64_t target = rig.feedback.position_counts;
      ASSERT_LT(std::abs(target - position), 100000);
      while (position != target) reference.arrive(position += position < target ? 1 : -1, edges);
      ASSERT_EQ(rig.feedback.inputs, reference.inputs());
      ASSERT_EQ(rig.feedback.index_level, reference.index);
      ASSERT_EQ(rig.feedback.edge_count, std::min<std::size_t>(edges.size(), 4));
      for (std::size_t i = 0; i < rig.feedback.edge_count; ++i) {
        ASSERT_TRUE(rig.feedback.edges[i] == edges[i]) << machine << " " << tick << " " << i;
      }
      edges_seen += rig.feedback.edge_count;
      crowded += edges.size() > 4;
    }
  }
  EXPECT_GT(edges_seen, 5000);
  EXPECT_GT(crowded, 50);
}

TEST(Switches, ForcedInputs) {
  Parameters p = bare_motor();
  p.switch_count = 1;
  p.switches[0] = {.wire = 2, .from_counts = 100, .to_counts = 200};
  p.encoder.index_width_counts = 0;
  Mover rig(p);
  rig.run(1);
  EXPECT_EQ(rig.feedback.inputs, 0u);
  rig.plant.force_input(7, true);
  rig.plant.force_input(2, false);  // no change: no edge
  rig.run(1);
  EXPECT_EQ(rig.feedback.inputs, 1u << 7);
  ASSERT_EQ(rig.feedback.edge_count, 1);
  EXPECT_TRUE(rig.feedback.edges[0] == (drive::Edge{7, true, 0}));
  rig.set_speed(100.0);
  while (rig.feedback.position_counts < 150) {
    rig.step();
    EXPECT_EQ(rig.feedback.edge_count, 0);
  }
  EXPECT_EQ(rig.feedback.inputs, 1u << 7);
  const std::int64_t here = rig.feedback.position_counts;
  rig.plant.release_input(2);
  rig.plant.release_input(7);
  rig.step();
  EXPECT_EQ(rig.feedback.inputs, 1u << 2);
  ASSERT_EQ(rig.feedback.edge_count, 2);
  EXPECT_TRUE(rig.feedback.edges[0] == (drive::Edge{2, true, here}));
  EXPECT_TRUE(rig.feedback.edges[1] == (drive::Edge{7, false, here}));
  EXPECT_THROW(rig.plant.force_input(32, true), std::invalid_argument);
  EXPECT_THROW(rig.plant.release_input(-1), std::invalid_argument);
}

TEST(Switches, PlacingTheAxisSetsLevelsWithoutEdges) {
  Parameters p = bare_motor();
  p.switch_count = 1;
  p.switches[0] = {.wire = 0, .from_counts = 5000, .normally_closed = true};
  p.load.high_stop_counts = 9000;
  Rig rig(p);
  rig.run(1);
  EXPECT_EQ(rig.feedback.inputs, 1u);
  rig.plant.set_position_counts(5000);
  rig.run(1);
  EXPECT_EQ(rig.feedback.inputs, 0u);
  EXPECT_EQ(rig.feedback.edge_count, 0);
  EXPECT_EQ(rig.feedback.position_counts, 5000);
  EXPECT_THROW(rig.plant.set_position_counts(9001), std::invalid_argument);
  EXPECT_EQ(rig.plant.position_counts(), 5000);
}

}  // namespace
}  // namespace travel_test
}  // namespace servodrome::plant::test
