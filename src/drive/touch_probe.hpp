#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/signals.hpp"
#include "drive/units.hpp"

// The touch probe function of CiA 402-2 (objects 60B8h to 60BDh, 60D0h, 60D5h to 60D8h): positions captured at edges of
// the probe inputs or of the encoder's index. Positions are encoder counts; the drive converts them.
namespace servodrome::drive {

// The capabilities of a product's probes. Bits of 60B8h for missing capabilities are accepted but never latch.
struct TouchProbeCapability {
  enum class IndexValue : std::uint8_t {
    position,   // position of the index
    deviation,  // successive indexes: their distance less the nearest whole number of revolutions
  };
  std::uint8_t probes = 0;     // 0, 1 or 2
  bool input_rising = false;   // edges of the probe inputs that latch
  bool input_falling = false;  //
  bool index_rising = false;   // edges of the index that latch
  bool index_falling = false;  //
  bool source_object = false;  // with trigger source 10b of 60B8h, 60D0h selects the source
  bool source_status = false;  // status bit 6 (14) mirrors the source: 1 = index
  bool toggle_status = false;  // continuous mode: a rising edge toggles status bit 6 (14), a falling edge 7 (15)
  IndexValue index_value = IndexValue::position;

  friend bool operator==(const TouchProbeCapability&, const TouchProbeCapability&) = default;
};

// Both probes, all edges and sources.
inline constexpr TouchProbeCapability full_touch_probe{.probes = 2,
                                                       .input_rising = true,
                                                       .input_falling = true,
                                                       .index_rising = true,
                                                       .index_falling = true,
                                                       .source_object = true,
                                                       .toggle_status = true};

class TouchProbe {
 public:
  static constexpr std::size_t slots = 4;  // in the order of 60BAh to 60BDh: probe 1 rising, falling, probe 2 ...

  explicit TouchProbe(const TouchProbeCapability& capability) : capability_(capability) {}

  // 60B8h. Switching a probe on (bit 0, 8) arms both its edges; an edge is armed again when its enable bit changes to
  // 1. Changing mode or source of a probe that is on re-arms it, as switching it off and on does.
  void write_function(std::uint16_t function);

  // 60D0h sub `probe` + 1: 1, 2 = probe input 1, 2; 5, 6 = index. Others never latch.
  void write_source(std::size_t probe, std::int16_t source);

  // Data for IndexValue::deviation, in counts, both >= 0. `counts_per_revolution` 0: nothing latches. `threshold` 0:
  // not supervised.
  void set_deviation_supervision(Counts counts_per_revolution, Counts threshold);

  // Call this for every captured edge, in order of time. Returns true if a deviation beyond the threshold was latched.
  bool on_edge(const SignalEdge& edge);

  const TouchProbeCapability& capability() const { return capability_; }
  std::uint16_t function() const { return function_; }
  std::uint16_t status() const;                                                              // 60B9h
  Counts position(std::size_t slot) const { return probes_[slot / 2].positions[slot % 2]; }  // 60BAh + slot
  std::uint16_t edge_counter(std::size_t slot) const {
    return probes_[slot / 2].counters[slot % 2];
  }  // 60D5h + slot, since the probe was last armed

 private:
  struct Probe {
    std::uint8_t function = 0;  // its byte of 60B8h
    std::uint8_t status = 0;    // its byte of 60B9h, without the mirrored source
    std::int16_t source = 0;    // 60D0h
    std::array<Counts, 2> positions{};
    std::array<std::uint16_t, 2> counters{};
    bool index_known = false;
    Counts last_index = 0;
  };

  Signal source_of(std::size_t probe) const;
  void arm(Probe& probe);
  bool capture(Probe& probe, const SignalEdge& edge);

  TouchProbeCapability capability_;
  std::uint16_t function_ = 0;
  std::array<Probe, 2> probes_{{{.source = 1}, {.source = 2}}};
  Counts counts_per_revolution_ = 0;
  Counts threshold_ = 0;
};

}  // namespace servodrome::drive
