#include "drive/touch_probe.hpp"

namespace servodrome::drive {

namespace {

// Bits of one probe's byte of 60B8h ...
constexpr unsigned enable = 1u << 0;
constexpr unsigned continuous = 1u << 1;
constexpr unsigned trigger_source = 3u << 2;
constexpr unsigned source_input = 0u << 2;
constexpr unsigned source_index = 1u << 2;
constexpr unsigned source_by_object = 2u << 2;
constexpr std::array<unsigned, 2> edge_enable{1u << 4, 1u << 5};  // rising, falling

// ... and of 60B9h.
constexpr unsigned enabled = 1u << 0;
constexpr std::array<unsigned, 2> edge_stored{1u << 1, 1u << 2};
constexpr std::array<unsigned, 2> edge_toggle{1u << 6, 1u << 7};  // where TouchProbeCapability::toggle_status
constexpr unsigned source_is_index = 1u << 6;                     // where TouchProbeCapability::source_status

constexpr std::uint8_t byte(unsigned value) { return static_cast<std::uint8_t>(value); }

}  // namespace

Signal TouchProbe::source_of(std::size_t probe) const {
  switch (probes_[probe].function & trigger_source) {
    case source_input: return probe == 0 ? Signal::probe_1 : Signal::probe_2;
    case source_index: return Signal::index;
    case source_by_object: break;
    default: return Signal::none;  // 11b is reserved
  }
  if (!capability_.source_object) return Signal::none;
  switch (probes_[probe].source) {
    case 1: return Signal::probe_1;
    case 2: return Signal::probe_2;
    case 5:  // zero impulse of the encoder, by hardware
    case 6:  // ... by software; here both are exact
      return Signal::index;
    default: return Signal::none;
  }
}

void TouchProbe::arm(Probe& probe) {
  probe.status = byte(enabled);
  probe.counters = {};
  probe.index_known = false;
}

void TouchProbe::write_function(std::uint16_t function) {
  function_ = function;
  for (std::size_t i = 0; i < capability_.probes; ++i) {
    Probe& probe = probes_[i];
    const unsigned before = probe.function;
    const unsigned now = (unsigned{function} >> (8 * i)) & 0xFFu;
    probe.function = byte(now);
    if ((now & enable) == 0) {
      probe.status = 0;
    } else if (((before ^ now) & (enable | continuous | trigger_source)) != 0) {
      arm(probe);
    } else {
      for (std::size_t edge = 0; edge < 2; ++edge) {
        // Switching an edge off clears its stored flag; switching it on arms it for the next event.
        if (((before ^ now) & edge_enable[edge]) != 0) probe.status = byte(probe.status & ~edge_stored[edge]);
      }
    }
  }
}

void TouchProbe::write_source(std::size_t probe, std::int16_t source) {
  const bool other = probes_[probe].source != source;
  probes_[probe].source = source;
  const unsigned function = probes_[probe].function;
  if (other && (function & enable) != 0 && (function & trigger_source) == source_by_object) arm(probes_[probe]);
}

void TouchProbe::set_deviation_supervision(Counts counts_per_revolution, Counts threshold) {
  counts_per_revolution_ = counts_per_revolution;
  threshold_ = threshold;
}

bool TouchProbe::on_edge(const SignalEdge& edge) {
  const bool index = edge.signal == Signal::index;
  const bool supported = edge.rising ? (index ? capability_.index_rising : capability_.input_rising)
                                     : (index ? capability_.index_falling : capability_.input_falling);
  if (!supported || edge.signal == Signal::none) return false;
  bool exceeded = false;
  for (std::size_t i = 0; i < capability_.probes; ++i) {
    if ((probes_[i].function & enable) == 0 || source_of(i) != edge.signal) continue;
    if (capture(probes_[i], edge)) exceeded = true;
  }
  return exceeded;
}

bool TouchProbe::capture(Probe& probe, const SignalEdge& edge) {
  const std::size_t slot = edge.rising ? 0 : 1;
  if ((probe.function & edge_enable[slot]) == 0) return false;
  const bool every_event = (probe.function & continuous) != 0;
  if (!every_event && (probe.status & edge_stored[slot]) != 0) return false;

  Counts value = edge.position;
  bool exceeded = false;
  if (edge.signal == Signal::index && capability_.index_value == TouchProbeCapability::IndexValue::deviation) {
    if (counts_per_revolution_ <= 0) return false;
    const bool first = !probe.index_known;
    const Counts travelled = edge.position - probe.last_index;
    probe.index_known = true;
    probe.last_index = edge.position;
    if (first) return false;
    // This is also right if the axis reversed and met the same index again: revolutions and deviation are then 0.
    const Counts distance = travelled < 0 ? -travelled : travelled;
    const Counts revolutions = (distance + counts_per_revolution_ / 2) / counts_per_revolution_;
    value = distance - revolutions * counts_per_revolution_;
    exceeded = threshold_ > 0 && (value > threshold_ || -value > threshold_);
  }
  probe.positions[slot] = value;
  ++probe.counters[slot];
  unsigned status = probe.status | edge_stored[slot];
  if (every_event && capability_.toggle_status) status ^= edge_toggle[slot];
  probe.status = byte(status);
  return exceeded;
}

std::uint16_t TouchProbe::status() const {
  unsigned status = 0;
  for (std::size_t i = 0; i < capability_.probes; ++i) {
    unsigned own = probes_[i].status;
    if (capability_.source_status && source_of(i) == Signal::index) own |= source_is_index;
    status |= own << (8 * i);
  }
  return static_cast<std::uint16_t>(status);
}

}  // namespace servodrome::drive
