#pragma once

#include <array>

#include "catalogue/gains.hpp"

namespace servodrome::catalogue::jmc_ec {

inline constexpr ObjectAddress panel(std::uint8_t group, std::uint8_t number) {
  return {static_cast<std::uint16_t>(0x2000 + group), static_cast<std::uint8_t>(number + 1)};
}
inline constexpr std::string_view pseudo_derivative_does =
    "1000: plain PI controller; a lower value increases the integral part";
// P01, P02 and P08 of the JMC manual (Table 65, ch. 8.2.2 and 8.2.3), at the service port.
inline constexpr auto gain_guide = std::to_array<GainLine>({
    {panel(1, 2), "Rigidity", "0: gains are set by hand; 1, 2: they follow the rigidity level and must not be written"},
    {panel(1, 3), "Rigidity", "all gains and filters together become stiffer"},
    {panel(1, 4), "Rigidity", "ratio of load inertia to rotor inertia, used for speed gains and feed-forward"},
    {panel(2, 10), "Gain set 1", gain_effects::velocity_kp},
    {panel(2, 11), "Gain set 1", "a steady-state error is removed more slowly, a step overshoots less"},
    {panel(2, 12), "Gain set 1", pseudo_derivative_does},
    {panel(2, 0), "Gain set 1", gain_effects::position_kp},
    {panel(2, 13), "Gain set 2", gain_effects::velocity_kp},
    {panel(2, 14), "Gain set 2", "a steady-state error is removed more slowly, a step overshoots less"},
    {panel(2, 15), "Gain set 2", pseudo_derivative_does},
    {panel(2, 1), "Gain set 2", gain_effects::position_kp},
    {panel(2, 30), "Choice of the set",
     "when gain set 2 acts: 0 never; 1 to 10 by input, torque, speed, deviation and so on"},
    {panel(2, 31), "Choice of the set", "level above which set 2 is active, in the unit of the mode"},
    {panel(2, 32), "Choice of the set", "hysteresis below the level for the return to set 1"},
    {panel(2, 33), "Choice of the set", "delay of the return to set 1"},
    {panel(2, 34), "Choice of the set", "transition time of the position gain"},
    {panel(2, 3), "Feed-forward", gain_effects::velocity_forward},
    {panel(2, 4), "Feed-forward", "smoother, more delay"},
    {panel(2, 19), "Feed-forward", gain_effects::acceleration_forward},
    {panel(2, 20), "Feed-forward", "smoother, more delay"},
    {panel(8, 19), "Filters", "less encoder noise in the speed, more delay"},
    {panel(8, 20), "Filters", "less noise in the torque, more delay"},
    {panel(8, 25), "Disturbance", "more of the observed load torque is compensated immediately"},
    {panel(8, 26), "Disturbance", "smoother, more delay"},
});

}  // namespace servodrome::catalogue::jmc_ec
