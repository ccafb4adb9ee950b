#include "drive/with_mode.hpp"

// The inputs of the drive: levels and edges become signals.
namespace servodrome::drive {

void Drive::capture_edges(const Feedback& feedback) {
  for (std::uint8_t i = 0; i < feedback.edge_count; ++i) {
    const Edge& edge = feedback.edges[i];
    SignalEdge signal{Signal::index, edge.rising, edge.position_counts};
    if (edge.source != Edge::index_source) {
      if (edge.source >= max_inputs) continue;
      if ((axis_.configuration.inputs_without_capture() >> edge.source & 1u) != 0) continue;
      const InputFunction& function = axis_.configuration.inputs[edge.source];
      if (function.forced) continue;
      signal.signal = function.signal;
      signal.rising = function.active(edge.rising);
    }
    if (signal.signal != Signal::none) note_edge(signal);
  }
}

// Inputs that the bus commands or a filter delays have no capture unit. Their edges get the present position.
void Drive::note_level_edges(std::uint32_t changed) {
  for (std::size_t i = 0; i < max_inputs; ++i) {
    const InputFunction& function = axis_.configuration.inputs[i];
    if ((changed >> i & 1u) == 0 || function.signal == Signal::none || function.forced) continue;
    note_edge({function.signal, function.active((inputs_.wires >> i & 1u) != 0), axis_.encoder_position});
  }
}

void Drive::note_edge(const SignalEdge& edge) {
  if (touch_probe_.on_edge(edge)) axis_.raise(Cause::index_deviation);
  if (edge_count_ < edge_capacity) edges_[edge_count_++] = edge;
  if (!edge.rising) return;
  if (edge.signal == Signal::negative_limit) inputs_.limit_positions[0] = edge.position + axis_.offset;
  if (edge.signal == Signal::positive_limit) inputs_.limit_positions[1] = edge.position + axis_.offset;
}

void Drive::update_inputs(const Feedback& feedback) {
  const Configuration& configuration = axis_.configuration;
  const std::uint32_t from_bus = configuration.bus_inputs;
  inputs_.wires = feedback.inputs;
  if (from_bus != 0) {
    inputs_.wires = (inputs_.wires & ~from_bus) |
                    (axis_.objects.physical_outputs >> policy_.terminals.first_bus_input_bit & from_bus);
  }
  if (configuration.input_filter_cycles != 0) {
    inputs_.wires = inputs_.filter.update(inputs_.wires, configuration.input_filter_cycles);
  }
  if (inputs_.wires != inputs_.evaluated) {
    const std::uint32_t changed = (inputs_.wires ^ inputs_.changed) & configuration.inputs_without_capture();
    if (changed != 0) note_level_edges(changed);
    inputs_.changed = inputs_.evaluated = inputs_.wires;
    std::uint32_t signals = 0;
    for (std::size_t i = 0; i < max_inputs; ++i) {
      const InputFunction& function = axis_.configuration.inputs[i];
      const bool high = (inputs_.wires >> i & 1u) != 0;
      if (function.signal != Signal::none && function.active(high)) signals |= bit(function.signal);
    }
    axis_.signals = signals;
  }
  axis_.signals = feedback.index_level ? axis_.signals | bit(Signal::index) : axis_.signals & ~bit(Signal::index);
}

}  // namespace servodrome::drive
