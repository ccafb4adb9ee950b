#pragma once

#include <array>

#include "drive/axis.hpp"
#include "drive/io/input_commands.hpp"
#include "drive/io/output_functions.hpp"
#include "products/ismk/objects.hpp"

namespace servodrome::products::ismk {

// Function words of the inputs (ch. 7.9); catalogue/ismk/terminals.hpp has their names. Clear pulse, pause and the two
// trims are described without a code, so no input can have them. Gear selection and current switch may be assigned and
// are read, but have no effect: there is one gear ratio and one current limit.
inline constexpr auto input_functions = [] {
  using drive::InputAction;
  using drive::Signal;
  return std::to_array<drive::InputFunctionRow>({
      {0x0001, Signal::none, false, InputAction::enable},        // ch. 7.9
      {0x0002, Signal::none, false, InputAction::reset_errors},  // ch. 7.9
      {0x0004, Signal::none, false, InputAction::mode_control},  // ch. 7.9
      {0x0008, Signal::integral_off},                            // ch. 7.9
      {0x0010, Signal::positive_limit, true},                    // normally closed (ch. 5.6.1)
      {0x0020, Signal::negative_limit, true},                    // ch. 7.9
      {0x0040, Signal::home},                                    // ch. 7.9
      {0x0080, Signal::invert_direction},                        // ch. 7.9
      {0x0100, Signal::none, false, InputAction::speed_index_0},
      {0x0200, Signal::none, false, InputAction::speed_index_1},
      {0x0400, Signal::none, false, InputAction::position_index_0},
      {0x0800, Signal::none, false, InputAction::position_index_1},
      {0x1000, Signal::quick_stop, false, InputAction::quick_stop},  // ch. 7.9
      {0x2000, Signal::none, false, InputAction::start_homing},      // ch. 7.9
      {0x4000, Signal::none, false, InputAction::activate},          // ch. 7.9
      {0x8001, Signal::none, false, InputAction::speed_index_2},
      {0x8002, Signal::none, false, InputAction::position_index_2},
      {0x8004, Signal::none, false, InputAction::gear_index_0},  // ch. 7.9
      {0x8008, Signal::none, false, InputAction::gear_index_1},
      {0x8010, Signal::none, false, InputAction::gear_index_2},
      {0x8020, Signal::none, false, InputAction::gain_index_0},  // ch. 7.9
      {0x8040, Signal::none, false, InputAction::gain_index_1},
      {0x8080, Signal::none, false, InputAction::current_switch},
      {0x8100, Signal::motor_temperature},     // "for example, the motor itself is too hot"
      {0x8200, Signal::enable_refused, true},  // 1 is ready, 0 is not
      {0x8400, Signal::probe_1},               // ch. 7.9
      {0x8800, Signal::probe_2},
  });
}();

// Function words of the outputs (ch. 7.9). No iSMK has terminals for safe torque off: 8001h may be assigned but is
// never active.
inline constexpr auto output_functions = [] {
  using drive::OutputCondition;
  return std::to_array<drive::OutputFunctionRow>({
      {0x0001, OutputCondition::ready},
      {0x0002, OutputCondition::error},
      {0x0004, OutputCondition::position_reached},
      {0x0008, OutputCondition::zero_speed},
      {0x0010, OutputCondition::brake_released},
      {0x0020, OutputCondition::speed_reached},
      {0x0040, OutputCondition::index},
      {0x0080, OutputCondition::speed_limit},
      {0x0100, OutputCondition::enabled},
      {0x0200, OutputCondition::position_limit},
      {0x0400, OutputCondition::home_found},
      {0x0800, OutputCondition::torque_reached},
      {0x1000, OutputCondition::reached_index_0},
      {0x2000, OutputCondition::reached_index_1},
      {0x4000, OutputCondition::reached_index_2},
      {0x8001, OutputCondition::safe_torque_off},
  });
}();

// OUT3 (RUN lamp), OUT4 (ERR lamp) and OUT5 (brake) have no function objects (Table 3-1, ch. 5.6.2 and 5.6.2.1).
inline constexpr std::array fixed_outputs{drive::OutputCondition::ready, drive::OutputCondition::error,
                                          drive::OutputCondition::brake_released};
inline constexpr std::size_t output_count = 2 + fixed_outputs.size();
inline constexpr unsigned run_output = 2;  // lamps
inline constexpr unsigned error_output = 3;
inline constexpr std::size_t brake_output = 4;
// Polarity and simulation list eight inputs (ch. 7.9), five have functions, DI1 and DI2 have terminals.
inline constexpr std::size_t input_count = 8;

// Modes in which the table of speeds sets the target (ch. 5.2.1.1).
inline constexpr std::array<std::int8_t, 2> speed_table_modes{3, -3};

// Positions that the fast capture inputs caught (ch. 7.9). The manual prints no objects for them, so this struct is the
// only access to them.
struct Capture {
  bool rising = false;  // caught since it was cleared
  bool falling = false;
  std::int64_t rising_position = 0;  // inc
  std::int64_t falling_position = 0;
};

// The functions of objects 2010h, 2020h and 2FF1h.
class Terminals {
 public:
  void reset() { *this = {}; }

  // Adopts function words, polarity and simulation, and sets the members of `configuration` that depend on them.
  void configure(const ServoObjects& objects, drive::Configuration& configuration);

  // Call this once per position-loop cycle, after the drive's tick().
  void cycle(drive::Drive& drive, ServoObjects& objects);

  const drive::InputFunctions& inputs() const { return inputs_; }
  std::uint32_t conditions() const { return conditions_; }  // bit(drive::OutputCondition)

  // `unit` 0 or 1: fast capture 1 or 2.
  static Capture capture(const drive::Drive& drive, std::size_t unit);
  // Resets a captured edge, so that the next one is caught.
  static void rearm(drive::Drive& drive, std::size_t unit, bool rising_edge);

 private:
  void write_outputs(drive::Drive& drive, ServoObjects& objects);

  drive::InputFunctions inputs_{};
  drive::InputCommands commands_{};
  drive::OutputConditions outputs_{};
  std::uint32_t conditions_ = 0;
};

// 2FF1h sub 2 or 3 was written: position L becomes M x 10000 + N (Table 5-11).
void enter_position(Tables& tables);

// Both edges of both units are caught once each, and again after re-arming.
inline constexpr drive::TouchProbeCapability fast_capture{.probes = 2, .input_rising = true, .input_falling = true};

}  // namespace servodrome::products::ismk
