#include "drive/touch_probe.hpp"

#include <gtest/gtest.h>
#include <random>
#include <utility>
#include <vector>

namespace servodrome::drive {
namespace touch_probe_test {
namespace {

// As in the ISMC manual (ch. 4.8.1): one probe, only rising edges of the index, status bit 6 mirrors the source.
constexpr TouchProbeCapability index_only{.probes = 1, .index_rising = true, .source_status = true};

constexpr SignalEdge rise(Signal signal, Counts position) { return {signal, true, position}; }
constexpr SignalEdge fall(Signal signal, Counts position) { return {signal, false, position}; }

// Bits of 60B8h for probe 1; those of probe 2 are eight bits higher.
constexpr unsigned on = 0x01;
constexpr unsigned continuous = 0x02;
constexpr unsigned by_index = 0x04;
constexpr unsigned by_object = 0x08;
constexpr unsigned rising = 0x10;
constexpr unsigned falling = 0x20;
constexpr std::uint16_t probe_1(unsigned bits) { return static_cast<std::uint16_t>(bits); }
constexpr std::uint16_t probe_2(unsigned bits) { return static_cast<std::uint16_t>(bits << 8); }

TEST(TouchProbe, FirstEventOfEachEdgeOnly) {
  TouchProbe probe{full_touch_probe};
  probe.write_function(probe_1(on | rising | falling));
  EXPECT_EQ(probe.status(), 0x0001);
  probe.on_edge(rise(Signal::probe_1, 1000));
  EXPECT_EQ(probe.status(), 0x0003);
  probe.on_edge(fall(Signal::probe_1, 1010));
  EXPECT_EQ(probe.status(), 0x0007);
  probe.on_edge(rise(Signal::probe_1, 2000));
  probe.on_edge(fall(Signal::probe_1, 2010));
  EXPECT_EQ(probe.status(), 0x0007);
  EXPECT_EQ(probe.position(0), 1000);
  EXPECT_EQ(probe.position(1), 1010);
  EXPECT_EQ(probe.edge_counter(0), 1);
  EXPECT_EQ(probe.edge_counter(1), 1);
  EXPECT_EQ(probe.edge_counter(2) + probe.edge_counter(3), 0);
}

TEST(TouchProbe, EveryEventInContinuousModeWithToggles) {
  TouchProbe probe{full_touch_probe};
  probe.write_function(probe_1(on | continuous | rising | falling));
  const std::uint16_t expected[] = {0x0043, 0x00C7, 0x0087, 0x0007, 0x0047};
  Counts position = -50;
  for (int i = 0; i < 5; ++i, position += 10) {
    probe.on_edge(i % 2 == 0 ? rise(Signal::probe_1, position) : fall(Signal::probe_1, position));
    EXPECT_EQ(probe.status(), expected[i]) << i;
    EXPECT_EQ(probe.position(i % 2 == 0 ? 0 : 1), position);
  }
  EXPECT_EQ(probe.edge_counter(0), 3);
  EXPECT_EQ(probe.edge_counter(1), 2);
}

TEST(TouchProbe, CounterWrapsAt16Bits) {
  TouchProbe probe{full_touch_probe};
  probe.write_function(probe_1(on | continuous | rising));
  for (int i = 0; i < 65537; ++i) probe.on_edge(rise(Signal::probe_1, i));
  EXPECT_EQ(probe.edge_counter(0), 1);
  EXPECT_EQ(probe.position(0), 65536);
}

TEST(TouchProbe, ProbesAreIndependent) {
  TouchProbe probe{full_touch_probe};
  probe.write_function(static_cast<std::uint16_t>(probe_1(on | rising) | probe_2(on | falling)));
  EXPECT_EQ(probe.status(), 0x0101);
  probe.on_edge(rise(Signal::probe_2, 1));  // not enabled
  probe.on_edge(fall(Signal::probe_1, 2));  // not enabled
  EXPECT_EQ(probe.status(), 0x0101);
  probe.on_edge(fall(Signal::probe_2, 3));
  EXPECT_EQ(probe.status(), 0x0501);
  EXPECT_EQ(probe.position(3), 3);
  probe.on_edge(rise(Signal::probe_1, 4));
  EXPECT_EQ(probe.status(), 0x0503);
  // Switching one probe off does not change the other.
  probe.write_function(probe_2(on | falling));
  EXPECT_EQ(probe.status(), 0x0500);
  EXPECT_EQ(probe.position(0), 4) << "the value stays to be read";
}

TEST(TouchProbe, OtherSignalsAndProbesThatAreOffLatchNothing) {
  TouchProbe probe{full_touch_probe};
  probe.on_edge(rise(Signal::probe_1, 5));
  EXPECT_EQ(probe.status(), 0);
  probe.write_function(probe_1(on | rising | falling));
  for (unsigned i = 0; i < static_cast<unsigned>(Signal::count_of_signals); ++i) {
    const auto signal = static_cast<Signal>(i);
    if (signal == Signal::probe_1) continue;
    probe.on_edge(rise(signal, 6));
    probe.on_edge(fall(signal, 6));
  }
  EXPECT_EQ(probe.status(), 0x0001);
}

// A probe is armed again by bit 0 from 0 to 1, by an edge bit from 0 to 1, or by a new mode or source; writing the same
// value again does not arm it.
TEST(TouchProbe, Rearming) {
  TouchProbe probe{full_touch_probe};
  const auto latch = [&](Counts position) {
    probe.on_edge(rise(Signal::probe_1, position));
    return probe.position(0);
  };
  probe.write_function(probe_1(on | rising));
  EXPECT_EQ(latch(1), 1);
  probe.write_function(probe_1(on | rising));
  EXPECT_EQ(probe.status(), 0x0003);
  EXPECT_EQ(latch(2), 1);

  probe.write_function(probe_1(rising));
  EXPECT_EQ(probe.status(), 0x0000);
  EXPECT_EQ(latch(3), 1);
  probe.write_function(probe_1(on | rising));
  EXPECT_EQ(probe.status(), 0x0001);
  EXPECT_EQ(probe.edge_counter(0), 0);
  EXPECT_EQ(latch(4), 4);

  probe.write_function(probe_1(on));  // the edge is switched off: it no longer has a stored position
  EXPECT_EQ(probe.status(), 0x0001);
  EXPECT_EQ(latch(5), 4);
  probe.write_function(probe_1(on | rising));
  EXPECT_EQ(latch(6), 6);
  EXPECT_EQ(probe.edge_counter(0), 2) << "counted since the probe was switched on";

  // A change of this edge does not affect the other edge.
  probe.write_function(probe_1(on | rising | falling));
  EXPECT_EQ(probe.status(), 0x0003);
  probe.on_edge(fall(Signal::probe_1, 7));
  probe.write_function(probe_1(on | falling));
  EXPECT_EQ(probe.status(), 0x0005);

  probe.write_function(probe_1(on | continuous | falling));  // another mode
  EXPECT_EQ(probe.status(), 0x0001);
  probe.on_edge(fall(Signal::probe_1, 8));
  probe.write_function(probe_1(on | continuous | by_index | falling));  // another source
  EXPECT_EQ(probe.status() & 0x000F, 0x0001);
}

TEST(TouchProbe, Sources) {
  TouchProbe probe{full_touch_probe};
  const auto latches = [&](Signal signal) {
    probe.write_function(static_cast<std::uint16_t>(probe.function() & 0xFEFE));
    probe.write_function(static_cast<std::uint16_t>(probe.function() | 0x0101));
    probe.on_edge(rise(signal, 1));
    const std::uint16_t status = probe.status();
    return std::pair{(status & 0x0002) != 0, (status & 0x0200) != 0};
  };
  using Both = std::pair<bool, bool>;
  const auto both = [](unsigned bits) { return static_cast<std::uint16_t>(probe_1(bits) | probe_2(bits)); };

  probe.write_function(both(rising));
  EXPECT_EQ(latches(Signal::probe_1), (Both{true, false}));
  EXPECT_EQ(latches(Signal::probe_2), (Both{false, true}));
  EXPECT_EQ(latches(Signal::index), (Both{false, false}));
  probe.write_function(both(rising | by_index));
  EXPECT_EQ(latches(Signal::index), (Both{true, true}));
  EXPECT_EQ(latches(Signal::probe_1), (Both{false, false}));
  probe.write_function(both(rising | by_object));  // 60D0h is 1 and 2 by default
  EXPECT_EQ(latches(Signal::probe_1), (Both{true, false}));
  probe.write_source(0, 2);
  probe.write_source(1, 1);
  EXPECT_EQ(latches(Signal::probe_1), (Both{false, true}));
  EXPECT_EQ(latches(Signal::probe_2), (Both{true, false}));
  probe.write_source(0, 5);
  probe.write_source(1, 6);
  EXPECT_EQ(latches(Signal::index), (Both{true, true}));
  probe.write_source(0, 3);  // this probe input does not exist
  EXPECT_EQ(latches(Signal::index), (Both{false, true}));
  probe.write_function(both(rising | by_index | by_object));  // 11b is reserved
  for (const Signal signal : {Signal::probe_1, Signal::probe_2, Signal::index}) {
    EXPECT_EQ(latches(signal), (Both{false, false}));
  }
}

TEST(TouchProbe, ANewSourceArmsAProbeThatUsesIt) {
  TouchProbe probe{full_touch_probe};
  probe.write_function(probe_1(on | by_object | rising));
  probe.on_edge(rise(Signal::probe_1, 1));
  EXPECT_EQ(probe.status(), 0x0003);
  probe.write_source(0, 1);  // the same value
  EXPECT_EQ(probe.status(), 0x0003);
  probe.write_source(0, 5);
  EXPECT_EQ(probe.status(), 0x0001);
  probe.write_function(probe_1(on | rising));
  probe.on_edge(rise(Signal::probe_1, 2));
  probe.write_source(0, 2);  // not in use
  EXPECT_EQ(probe.status(), 0x0003);
}

TEST(TouchProbe, WhatAProductLacksIsAcceptedAndNeverLatches) {
  TouchProbe probe{index_only};
  probe.write_function(0xFFFF);  // source 11b
  EXPECT_EQ(probe.function(), 0xFFFF);
  EXPECT_EQ(probe.status(), 0x0001);
  for (const unsigned source : {0u, by_object, by_index}) {
    probe.write_function(static_cast<std::uint16_t>(probe_1(on | rising | falling | source) | probe_2(on | rising)));
    probe.on_edge(rise(Signal::probe_1, 1));
    probe.on_edge(fall(Signal::probe_1, 2));
    probe.on_edge(rise(Signal::probe_2, 3));
    probe.on_edge(fall(Signal::index, 4));
    EXPECT_EQ(probe.status(), source == by_index ? 0x0041 : 0x0001);
  }
  probe.on_edge(rise(Signal::index, 131072));
  EXPECT_EQ(probe.status(), 0x0043);
  EXPECT_EQ(probe.position(0), 131072);
  // Ch. 4.8.1.2, 60B9h: bit 6 shows the source, also of a probe that is off.
  probe.write_function(probe_1(by_index));
  EXPECT_EQ(probe.status(), 0x0040);
  TouchProbe none{TouchProbeCapability{}};
  none.write_function(0xFFFF);
  none.on_edge(rise(Signal::probe_1, 1));
  EXPECT_EQ(none.status(), 0);
}

// ISMC, ch. 4.8.1.2, firmware V1.04: 60BAh is the deviation between adjacent Z pulses.
class IndexDeviation : public testing::Test {
 protected:
  static constexpr Counts revolution = 131072;
  static TouchProbe make(Counts threshold) {
    TouchProbeCapability capability = index_only;
    capability.index_value = TouchProbeCapability::IndexValue::deviation;
    TouchProbe probe{capability};
    probe.set_deviation_supervision(revolution, threshold);
    probe.write_function(probe_1(on | continuous | by_index | rising));
    return probe;
  }
};

TEST_F(IndexDeviation, OfAdjacentPulses) {
  TouchProbe probe = make(0);
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 1000)));
  EXPECT_EQ(probe.status(), 0x0041) << "one pulse has no neighbour yet";
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 1000 + revolution + 3)));
  EXPECT_EQ(probe.status(), 0x0043);
  EXPECT_EQ(probe.position(0), 3);
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 1000 + 2 * revolution - 4)));
  EXPECT_EQ(probe.position(0), -7);
}

TEST_F(IndexDeviation, NeitherDirectionNorTurningRoundMatters) {
  TouchProbe probe = make(2);
  for (const Counts turns : {0, -1, -2, -2, -1, 0, 0, 1, 5, -7}) {
    EXPECT_FALSE(probe.on_edge(rise(Signal::index, 77 + turns * revolution)));
    EXPECT_EQ(probe.position(0), 0);
  }
  EXPECT_EQ(probe.edge_counter(0), 9);
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 77 - 8 * revolution - 2)));
  EXPECT_EQ(probe.position(0), 2);
}

TEST_F(IndexDeviation, BeyondTheThresholdIsReported) {
  for (const Counts deviation : {11, -11}) {
    TouchProbe probe = make(10);
    EXPECT_FALSE(probe.on_edge(rise(Signal::index, 0)));
    EXPECT_TRUE(probe.on_edge(rise(Signal::index, revolution + deviation)));
    EXPECT_FALSE(probe.on_edge(rise(Signal::index, 2 * revolution + deviation)));
    EXPECT_EQ(probe.position(0), 0);
    probe.write_function(0);
    EXPECT_FALSE(probe.on_edge(rise(Signal::index, 3 * revolution + 5000)));
    probe.write_function(probe_1(on | continuous | by_index | rising));
    EXPECT_FALSE(probe.on_edge(rise(Signal::index, 4 * revolution)));  // counts as the first pulse
  }
}

TEST_F(IndexDeviation, NothingWithoutARevolution) {
  TouchProbe probe = make(10);
  probe.set_deviation_supervision(0, 10);
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 0)));
  EXPECT_FALSE(probe.on_edge(rise(Signal::index, 500)));
  EXPECT_EQ(probe.status(), 0x0041);
}

// Random writes and edges, compared with the rules of the object, which are written here as a function of the history
// only.
TEST(TouchProbe, AgreesWithTheRulesOverRandomHistories) {
  std::mt19937 random{1};
  const auto below = [&](unsigned bound) { return static_cast<unsigned>(random()) % bound; };
  for (int history = 0; history < 200; ++history) {
    TouchProbe probe{full_touch_probe};
    unsigned function = 0;
    // Per edge of probe 1: the positions since it was armed.
    std::vector<Counts> taken[2];
    for (int step = 0; step < 200; ++step) {
      if (below(4) == 0) {
        const unsigned next = below(64) & ~(by_index | by_object);
        const bool armed_anew = (next & on) != 0 && ((next ^ function) & (on | continuous)) != 0;
        for (unsigned edge = 0; edge < 2; ++edge) {
          if ((next & on) == 0 || armed_anew || ((next ^ function) & (rising << edge)) != 0) taken[edge].clear();
        }
        function = next;
        probe.write_function(probe_1(next));
      } else {
        const unsigned edge = below(2);
        const auto position = static_cast<Counts>(below(100000));
        probe.on_edge({Signal::probe_1, edge == 0, position});
        if ((function & on) != 0 && (function & (rising << edge)) != 0) taken[edge].push_back(position);
      }
      unsigned expected = function & on;
      for (unsigned edge = 0; edge < 2; ++edge) {
        if (taken[edge].empty()) continue;
        expected |= 2u << edge;
        ASSERT_EQ(probe.position(edge), (function & continuous) != 0 ? taken[edge].back() : taken[edge].front());
      }
      ASSERT_EQ(probe.status() & 0x0007u, expected);
    }
  }
}

}  // namespace
}  // namespace touch_probe_test
}  // namespace servodrome::drive
