#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

// Faults that the bench can inject into a plant.
namespace servodrome::plant {

enum class Injection : std::uint8_t {
  encoder_loss,        // no answer: the position freezes, EncoderFault::connection_lost
  encoder_crc,         // corrupted telegrams: the position freezes, EncoderFault::crc
  encoder_delimiter,   // likewise, EncoderFault::delimiter
  encoder_multi_turn,  // sets only the fault bit, as the four that follow
  encoder_count,
  encoder_overflow,
  hall_wiring,
  hall_state,
  open_phase_u,  // wire cut: no current in that phase; a motor with two windings has U and V
  open_phase_v,
  open_phase_w,
  short_phase_u,  // output shorted to the negative rail of the DC link
  short_phase_v,
  short_phase_w,
  bus_overcurrent,  // sets only the comparator's bit, as the three that follow
  short_circuit,
  gate_supply_low,
  internal,
  brake_stuck,       // the holding brake does not release
  winding_overheat,  // the sensor reads 180 degC
  stage_overheat,    // 120 degC
  encoder_overheat,  // 120 degC
  ambient_hot,       // 90 degC
  ambient_cold,      // -40 degC
  chopper_broken,    // the brake resistor does not conduct
  supply_loss,       // mains failure: the DC link is not fed any more
};

struct InjectionName {
  Injection injection;
  std::string_view name;
};

inline constexpr std::array injection_names{
    InjectionName{Injection::encoder_loss, "encoder_loss"},
    InjectionName{Injection::encoder_crc, "encoder_crc"},
    InjectionName{Injection::encoder_delimiter, "encoder_delimiter"},
    InjectionName{Injection::encoder_multi_turn, "encoder_multi_turn"},
    InjectionName{Injection::encoder_count, "encoder_count"},
    InjectionName{Injection::encoder_overflow, "encoder_overflow"},
    InjectionName{Injection::hall_wiring, "hall_wiring"},
    InjectionName{Injection::hall_state, "hall_state"},
    InjectionName{Injection::open_phase_u, "open_phase_u"},
    InjectionName{Injection::open_phase_v, "open_phase_v"},
    InjectionName{Injection::open_phase_w, "open_phase_w"},
    InjectionName{Injection::short_phase_u, "short_phase_u"},
    InjectionName{Injection::short_phase_v, "short_phase_v"},
    InjectionName{Injection::short_phase_w, "short_phase_w"},
    InjectionName{Injection::bus_overcurrent, "bus_overcurrent"},
    InjectionName{Injection::short_circuit, "short_circuit"},
    InjectionName{Injection::gate_supply_low, "gate_supply_low"},
    InjectionName{Injection::internal, "internal"},
    InjectionName{Injection::brake_stuck, "brake_stuck"},
    InjectionName{Injection::winding_overheat, "winding_overheat"},
    InjectionName{Injection::stage_overheat, "stage_overheat"},
    InjectionName{Injection::encoder_overheat, "encoder_overheat"},
    InjectionName{Injection::ambient_hot, "ambient_hot"},
    InjectionName{Injection::ambient_cold, "ambient_cold"},
    InjectionName{Injection::chopper_broken, "chopper_broken"},
    InjectionName{Injection::supply_loss, "supply_loss"},
};

// Finds an injection by the name in the bench API; empty if the name is unknown.
constexpr std::optional<Injection> injection_from_name(std::string_view name) {
  for (const InjectionName& entry : injection_names) {
    if (entry.name == name) return entry.injection;
  }
  return std::nullopt;
}

constexpr std::string_view name_of(Injection injection) {
  return injection_names[static_cast<std::size_t>(injection)].name;
}

}  // namespace servodrome::plant
