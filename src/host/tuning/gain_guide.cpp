#include "host/tuning/gain_guide.hpp"

#include <algorithm>
#include <array>

namespace servodrome::host::tuning {
namespace {

constexpr std::string_view kp_does = "stiffer: a higher bandwidth, and less phase margin; too much, and the axis rings";
constexpr std::string_view ki_does = "takes a lasting error away sooner; too much, and a step overshoots";
constexpr std::string_view position_does =
    "the axis comes to its target sooner; a third of the velocity loop's bandwidth is about the most";
constexpr std::string_view velocity_forward_does =
    "less following error at constant speed; at all of it none is left for the position loop";
constexpr std::string_view acceleration_forward_does =
    "less following error while the speed changes; right when it is that of the inertia";
constexpr std::string_view notch_does = "what the loop leaves alone: set it to a resonance of the machine; 0: off";

// Objects 2010h to 2012h (src/products/generic402/README.md).
constexpr auto reference = std::to_array<GainLine>({
    {{0x2010, 2}, "Gains", kp_does},
    {{0x2010, 3}, "Gains", ki_does},
    {{0x2010, 1}, "Gains", position_does},
    {{0x2010, 4}, "Feed-forward", velocity_forward_does},
    {{0x2010, 5}, "Feed-forward", acceleration_forward_does},
    {{0x2010, 6}, "Filters", "the higher, the less delay and the more noise of the encoder; 0: off"},
    {{0x2010, 7}, "Filters", "the higher, the less delay and the more noise in the torque; 0: off"},
    {{0x2010, 8}, "Filters", notch_does},
    {{0x2010, 9}, "Filters", "how much about this frequency the notch takes out, and how much phase it costs"},
    {{0x2010, 10}, "Filters", "what is left of the torque at this frequency"},
    {{0x2010, 11}, "Filters", notch_does},
    {{0x2010, 12}, "Filters", "how much about this frequency the notch takes out, and how much phase it costs"},
    {{0x2010, 13}, "Filters", "what is left of the torque at this frequency"},
    {{0x2011, 2}, "Where a gain is 0", "the bandwidth that the drive makes its gains for"},
    {{0x2011, 1},
     "Where a gain is 0",
     "of the current loop, which is under the others: they are at most a fifth of it"},
    {{0x2012, 0}, "Where a gain is 0", "the inertia that the drive makes its gains for, by the rotor's"},
});

// iSMK manual L1564-1888.
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
    {{0x60F9, 9}, "Choice of the set", "1: set 1 at target reached or zero speed, else set 0; inputs rule over it"},
    {{0x60F9, 40}, "Choice of the set", "the set that acts"},
    {{0x60FB, 2}, "Feed-forward", velocity_forward_does},
    {{0x60FB, 3}, "Feed-forward", "32767: off; the smaller, the more torque goes with the acceleration"},
    {{0x60F9, 5}, "Filters", "the higher, the less delay and the more noise of the speed"},
    {{0x60F9, 6}, "Filters", "how the speed is made of the encoder's positions"},
    {{0x60F9, 21}, "Filters", "the output filter: less noise in the current, and more delay"},
    {{0x60FB, 5}, "Filters", "smoothes the position command over so long"},
    {{0x60F9, 3}, "Filters", notch_does},
    {{0x60F9, 4}, "Filters", "bits 0 and 1: which notch filters act"},
    {{0x250B, 1}, "Filters", notch_does},
    {{0x250B, 2}, "Filters", notch_does},
    {{0x250B, 3}, "Filters", notch_does},
    {{0x2FF0, 10},
     "Tuning by the drive",
     "the bandwidth that Kvp[0] makes with the inertia that the drive has learned"},
    {{0x2340, 16}, "Tuning by the drive", "what the drive adjusts by itself"},
});

constexpr ObjectAddress panel(std::uint8_t group, std::uint8_t number) {
  return {static_cast<std::uint16_t>(0x2000 + group), static_cast<std::uint8_t>(number + 1)};
}
constexpr std::string_view pseudo_derivative_does = "1000: a plain PI controller; the less, the more of it is integral";
// P01, P02 and P08 of the JMC manual (L559-588, L674-745), at the service port.
constexpr auto jmc = std::to_array<GainLine>({
    {panel(1, 2), "Rigidity",
     "0: gains are set by hand; 1, 2: they follow the rigidity level, and are not to be written"},
    {panel(1, 3), "Rigidity", "all gains and filters together: stiffer"},
    {panel(1, 4), "Rigidity", "the load's inertia by the rotor's, which speed gains and feed-forward are for"},
    {panel(2, 10), "Gain set 1", kp_does},
    {panel(2, 11), "Gain set 1", "the longer, the later a lasting error is gone, and the less a step overshoots"},
    {panel(2, 12), "Gain set 1", pseudo_derivative_does},
    {panel(2, 0), "Gain set 1", position_does},
    {panel(2, 13), "Gain set 2", kp_does},
    {panel(2, 14), "Gain set 2", "the longer, the later a lasting error is gone, and the less a step overshoots"},
    {panel(2, 15), "Gain set 2", pseudo_derivative_does},
    {panel(2, 1), "Gain set 2", position_does},
    {panel(2, 30), "Choice of the set",
     "when gain set 2 acts: 0 never; 1 to 10 by input, torque, speed, deviation and so on"},
    {panel(2, 31), "Choice of the set", "from which on set 2 acts, in the unit of the mode"},
    {panel(2, 32), "Choice of the set", "how far below the level set 1 comes back"},
    {panel(2, 33), "Choice of the set", "how long it takes until set 1 comes back"},
    {panel(2, 34), "Choice of the set", "how gently the position gain goes over to the other one"},
    {panel(2, 3), "Feed-forward", velocity_forward_does},
    {panel(2, 4), "Feed-forward", "smoother, and later"},
    {panel(2, 19), "Feed-forward", acceleration_forward_does},
    {panel(2, 20), "Feed-forward", "smoother, and later"},
    {panel(8, 19), "Filters", "less noise of the encoder in the speed, and more delay"},
    {panel(8, 20), "Filters", "less noise in the torque, and more delay"},
    {panel(8, 25), "Disturbance", "how much of a load that the drive feels is made good at once"},
    {panel(8, 26), "Disturbance", "smoother, and later"},
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

}  // namespace servodrome::host::tuning
