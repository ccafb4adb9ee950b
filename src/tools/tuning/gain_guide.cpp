#include "tools/tuning/gain_guide.hpp"

#include <algorithm>
#include <array>

namespace servodrome::master::tuning {
namespace {

constexpr std::string_view kp_does = "higher bandwidth (stiffer), less phase margin; if too high, the axis oscillates";
constexpr std::string_view ki_does = "removes a steady-state error faster; if too high, a step overshoots";
constexpr std::string_view position_does =
    "the axis reaches its target sooner; about a third of the velocity loop's bandwidth at most";
constexpr std::string_view velocity_forward_does =
    "less following error at constant speed; at 100 % none remains for the position loop";
constexpr std::string_view acceleration_forward_does =
    "less following error during acceleration; correct when it matches the inertia";
constexpr std::string_view notch_does =
    "frequency that the notch filter removes: set it to a resonance of the machine; 0: off";

// Objects 2010h to 2012h (src/products/generic402/README.md).
constexpr auto reference = std::to_array<GainLine>({
    {{0x2010, 2}, "Gains", kp_does},
    {{0x2010, 3}, "Gains", ki_does},
    {{0x2010, 1}, "Gains", position_does},
    {{0x2010, 4}, "Feed-forward", velocity_forward_does},
    {{0x2010, 5}, "Feed-forward", acceleration_forward_does},
    {{0x2010, 6}, "Filters", "less delay, more encoder noise; 0: off"},
    {{0x2010, 7}, "Filters", "less delay, more torque noise; 0: off"},
    {{0x2010, 8}, "Filters", notch_does},
    {{0x2010, 9}, "Filters", "the notch becomes wider and costs more phase"},
    {{0x2010, 10}, "Filters", "more of the torque remains at this frequency"},
    {{0x2010, 11}, "Filters", notch_does},
    {{0x2010, 12}, "Filters", "the notch becomes wider and costs more phase"},
    {{0x2010, 13}, "Filters", "more of the torque remains at this frequency"},
    {{0x2011, 2}, "Where a gain is 0", "the drive calculates its gains for a higher bandwidth"},
    {{0x2011, 1}, "Where a gain is 0", "bandwidth of the current loop; the other loops reach a fifth of it at most"},
    {{0x2012, 0}, "Where a gain is 0", "the drive calculates its gains for a higher inertia (ratio to the rotor's)"},
});

// iSMK manual, ch. 6.
constexpr auto ismk = std::to_array<GainLine>({
    {{0x60F9, 1}, "Gain set 0", kp_does},
    {{0x60F9, 2}, "Gain set 0", ki_does},
    {{0x60F9, 7}, "Gain set 0", "as Kvi[0], in steps of a 32nd"},
    {{0x60FB, 1}, "Gain set 0", position_does},
    {{0x2340, 4}, "Gain set 1", kp_does},
    {{0x2340, 5}, "Gain set 1", ki_does},
    {{0x2340, 6}, "Gain set 1", position_does},
    {{0x2340, 7}, "Gain set 2", kp_does},
    {{0x2340, 8}, "Gain set 2", ki_does},
    {{0x2340, 9}, "Gain set 2", position_does},
    {{0x2340, 10}, "Gain set 3", kp_does},
    {{0x2340, 11}, "Gain set 3", ki_does},
    {{0x2340, 12}, "Gain set 3", position_does},
    {{0x60F9, 9}, "Choice of the set", "1: set 1 at target reached or zero speed, else set 0; inputs have priority"},
    {{0x60F9, 40}, "Choice of the set", "the active set"},
    {{0x60FB, 2}, "Feed-forward", velocity_forward_does},
    {{0x60FB, 3}, "Feed-forward", "32767: off; a smaller value adds more torque during acceleration"},
    {{0x60F9, 5}, "Filters", "less delay, more noise of the speed"},
    {{0x60F9, 6}, "Filters", "how the speed is calculated from the encoder's positions"},
    {{0x60F9, 21}, "Filters", "output filter: less noise in the current, more delay"},
    {{0x60FB, 5}, "Filters", "smoothes the position command over a longer time"},
    {{0x60F9, 3}, "Filters", notch_does},
    {{0x60F9, 4}, "Filters", "bits 0 and 1: active notch filters"},
    {{0x250B, 1}, "Filters", notch_does},
    {{0x250B, 2}, "Filters", notch_does},
    {{0x250B, 3}, "Filters", notch_does},
    {{0x2FF0, 10}, "Tuning by the drive", "the bandwidth that results from Kvp[0] and the identified inertia"},
    {{0x2340, 16}, "Tuning by the drive", "what the drive adjusts automatically"},
});

constexpr ObjectAddress panel(std::uint8_t group, std::uint8_t number) {
  return {static_cast<std::uint16_t>(0x2000 + group), static_cast<std::uint8_t>(number + 1)};
}
constexpr std::string_view pseudo_derivative_does =
    "1000: plain PI controller; a lower value increases the integral part";
// P01, P02 and P08 of the JMC manual (Table 65, ch. 8.2.2 and 8.2.3), at the service port.
constexpr auto jmc = std::to_array<GainLine>({
    {panel(1, 2), "Rigidity", "0: gains are set by hand; 1, 2: they follow the rigidity level and must not be written"},
    {panel(1, 3), "Rigidity", "all gains and filters together become stiffer"},
    {panel(1, 4), "Rigidity", "ratio of load inertia to rotor inertia, used for speed gains and feed-forward"},
    {panel(2, 10), "Gain set 1", kp_does},
    {panel(2, 11), "Gain set 1", "a steady-state error is removed more slowly, a step overshoots less"},
    {panel(2, 12), "Gain set 1", pseudo_derivative_does},
    {panel(2, 0), "Gain set 1", position_does},
    {panel(2, 13), "Gain set 2", kp_does},
    {panel(2, 14), "Gain set 2", "a steady-state error is removed more slowly, a step overshoots less"},
    {panel(2, 15), "Gain set 2", pseudo_derivative_does},
    {panel(2, 1), "Gain set 2", position_does},
    {panel(2, 30), "Choice of the set",
     "when gain set 2 acts: 0 never; 1 to 10 by input, torque, speed, deviation and so on"},
    {panel(2, 31), "Choice of the set", "level above which set 2 is active, in the unit of the mode"},
    {panel(2, 32), "Choice of the set", "hysteresis below the level for the return to set 1"},
    {panel(2, 33), "Choice of the set", "delay of the return to set 1"},
    {panel(2, 34), "Choice of the set", "transition time of the position gain"},
    {panel(2, 3), "Feed-forward", velocity_forward_does},
    {panel(2, 4), "Feed-forward", "smoother, more delay"},
    {panel(2, 19), "Feed-forward", acceleration_forward_does},
    {panel(2, 20), "Feed-forward", "smoother, more delay"},
    {panel(8, 19), "Filters", "less encoder noise in the speed, more delay"},
    {panel(8, 20), "Filters", "less noise in the torque, more delay"},
    {panel(8, 25), "Disturbance", "more of the observed load torque is compensated immediately"},
    {panel(8, 26), "Disturbance", "smoother, more delay"},
});

struct Guide {
  std::string_view product;
  std::span<const GainLine> lines;
};
constexpr std::array guides{Guide{"generic402", reference}, Guide{"generic402-ec", reference}, Guide{"ismk", ismk},
                            Guide{"ismk-ea", ismk}, Guide{"jmc_ec", jmc}};

}  // namespace

std::span<const GainLine> gain_guide_of(std::string_view product) {
  const auto* const found =
      std::find_if(guides.begin(), guides.end(), [product](const Guide& guide) { return guide.product == product; });
  return found != guides.end() ? found->lines : std::span<const GainLine>();
}

}  // namespace servodrome::master::tuning
