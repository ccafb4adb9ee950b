#pragma once

#include "axis/cyclic/cyclic_axis.hpp"
#include "axis/cyclic/set_point_generator.hpp"
#include "catalogue/product.hpp"

namespace servodrome::master {

// Reason why an axis has stopped by itself.
enum class AxisFault : std::uint8_t {
  none,
  drive_fault,         // the drive reports a fault: 603Fh
  left_operation,      // no longer enabled, without a command: supply, safety input, quick stop, another master
  communication_lost,  // too many cycles without data of the drive
  following_error,     // position too far from the set-point
  mode_refused,        // the drive does not enter the mode of operation
  homing_failed,       // the statusword reports a homing error, or a halt does not end the homing
  not_following,       // the drive has ignored its target position for following_timeout
  quick_stop,          // MotionAxis::quick_stop(), because a stop took too long
};
const char* name(AxisFault fault);
// The remedy for the user.
const char* remedy_of(AxisFault fault);

struct MotionAxisOptions {
  // Mode for set-points: cyclic synchronous position or interpolated position.
  OperationMode position_mode = OperationMode::cyclic_synchronous_position;
  double velocity_scale = 1.0;         // units of 60FFh and 606Ch per count/s
  double following_error_limit = 0.0;  // counts; 0: no limit
  unsigned tolerated_losses = 10;      // cycles in a row without data
  Time mode_timeout = std::chrono::seconds(1);
  // If a drive that has followed its target position ignores it for this time (bit 12 of the statusword is 0), for
  // example at a limit switch, the axis has a fault. 0: no such fault, for a program that homes by its own set-points.
  Time following_timeout{0};
  // A shaft that moves by at most this distance in 20 ms counts as at rest after a quick stop. Counts.
  std::int64_t standstill_counts = 8;
  catalogue::HomingSignals homing_signals{};
};

// An axis moved by the master's own trajectory, cycle by cycle. In each cycle: read(), then commands, then advance()
// and write(). Commands to several axes in the same cycle start in the same cycle. Positions are in the drive's units
// ("counts") and 64 bits wide; the drive's own 32-bit positions may wrap around. No call blocks, and only the
// constructor throws.
class MotionAxis {
 public:
  // Throws MasterError if the process data lack an object that the position mode needs.
  MotionAxis(const CyclicAxis& axis, Time period, const MotionAxisOptions& options = {});

  // ---- The cycle ----
  // Evaluates the inputs of the cycle; `fresh`: all of them have arrived.
  void read(bool fresh);
  // Computes the set-point of the next cycle.
  void advance();
  // Writes the outputs into the process data.
  void write();

  // ---- Power ----
  // Brings the drive to operation enabled or to switch on disabled, one transition in each cycle. Switching off does
  // not brake: stop the axis first. Once switched off, the axis is enabled again only after the drive was off.
  void switch_on(bool on) {
    must_go_off_ = must_go_off_ || !on;
    switched_on_ = on;
  }
  bool is_switched_on() const { return switched_on_; }
  // True if the axis follows its set-points.
  bool is_enabled() const { return enabled_; }
  AxisFault fault() const { return fault_; }
  // 603Fh at the time of the fault, or 0.
  std::uint16_t error_code() const { return error_code_; }
  // Also resets the drive's fault; fault() is none once it is done. The reset waits until the inputs arrive and a stop
  // of the drive has ended.
  void reset_fault() { resetting_ = true; }
  // Ends a reset that is not done.
  void cancel_reset();
  bool is_resetting() const { return resetting_; }
  // True after the first cycle whose inputs were received: state, fault and position are those of the drive.
  bool has_read_inputs() const { return has_position_; }

  // ---- Commands; ignored unless the axis is enabled. False if not accepted: see SetPointGenerator ----
  bool move_to(double target, double end_velocity, const MotionLimits& limits,
               SetPointGenerator::From from = SetPointGenerator::From::present);
  bool run_at(double velocity, const MotionLimits& limits,
              SetPointGenerator::From from = SetPointGenerator::From::present);
  void follow(const MotionState& next);
  // Uses the drive's velocity loop (cyclic synchronous velocity); the profile comes from the master.
  bool run_in_velocity_mode(double velocity, const MotionLimits& limits);
  // Cyclic synchronous torque: ramps to `torque` (0.1 % of rated torque) at `slope` per second. Near `velocity_limit`
  // (counts/s, 0: none) the torque is reduced: linearly to 0 over the last tenth of the limit.
  bool apply_torque(double torque, double slope, double velocity_limit);
  // Starts the drive's homing with its present settings (6098h and others). The axis must stand still.
  bool home();
  // Aborts homing by a halt. If the drive does not come to rest within twice the mode timeout, it gets a quick stop.
  void abort_homing();
  // Commands a quick stop, with the ramp of the drive (605Ah, 6085h). The axis has the fault quick_stop afterwards.
  void quick_stop() { fail(AxisFault::quick_stop); }
  void shift_set_point(double distance) { generator_.shift(distance); }

  // In counts; 0: no limit.
  void set_following_error_limit(double counts) { options_.following_error_limit = counts; }

  // ---- State ----
  const SetPointGenerator& generator() const { return generator_; }
  const MotionState& set_point() const { return generator_.state(); }
  std::int64_t position() const { return position_; }
  // Set-point and position for axes that follow this one, in counts. They leave out steps without a motion of the
  // shaft: the change of the position after homing, and the step of the set-point when it becomes the actual position.
  double continuous_set_point() const { return set_point().position - set_point_steps_; }
  double continuous_position() const { return static_cast<double>(position_) - position_steps_; }
  double velocity() const { return velocity_; }        // counts/s
  double torque() const { return axis_.torque(); }     // 0.1 % of rated torque
  double torque_set_point() const { return torque_; }  // 0.1 % of rated torque
  double following_error() const { return following_error_; }
  bool is_homing() const { return task_ == Task::homing; }
  // True if homing has been completed since the last home().
  bool is_homed() const { return homed_; }
  bool is_in_torque_mode() const { return task_ == Task::torque; }
  // True until the drive shows the mode of the present motion. Meanwhile its profile does not advance.
  bool is_changing_mode() const { return mode_changes_; }
  // True once the profile has ended.
  bool is_done() const { return generator_.done() && !mode_changes_; }
  // False while the drive ignores its target position, as at a limit switch.
  bool follows_target() const { return cycles_not_following_ == 0; }
  CyclicAxis& axis() { return axis_; }
  const CyclicAxis& axis() const { return axis_; }
  const MotionAxisOptions& options() const { return options_; }

 private:
  enum class Task : std::uint8_t { position, velocity, torque, homing };
  enum class Homing : std::uint8_t { starting, running, breaking_off };

  OperationMode mode_of(Task task) const;
  bool mode_is(OperationMode mode) const;
  bool waits_for_mode() const;
  bool shows_following() const;
  bool follows();
  bool stands() const;
  bool is_stopping() const;
  bool start(Task task);
  void follow_actual(double velocity);
  void note_step();
  void fail(AxisFault fault);
  void take_position();
  void track_power();
  void supervise(bool fresh);
  void run_homing();
  void end_homing(bool attained);
  void write_targets();
  void write_while_off();
  std::uint16_t enabled_controlword() const;
  double limited_torque() const;

  CyclicAxis axis_;
  MotionAxisOptions options_;
  SetPointGenerator generator_;
  Task task_ = Task::position;
  bool switched_on_ = false;
  bool must_go_off_ = false;  // switched off since the drive was last seen off
  bool enabled_ = false;
  bool fresh_ = false;                         // the inputs of this cycle have arrived
  bool mode_changes_ = false;                  // the drive has not yet shown the mode of the present task
  std::optional<double> resting_set_point_{};  // set-point of an axis at rest during a mode change
  bool resetting_ = false;
  AxisFault fault_ = AxisFault::none;
  std::uint16_t error_code_ = 0;
  unsigned losses_ = 0;
  std::uint64_t cycles_without_mode_ = 0;
  std::uint64_t cycles_not_following_ = 0;
  bool has_followed_ = false;  // bit 12 was 1 since the axis was enabled
  std::uint64_t mode_timeout_cycles_;

  bool has_position_ = false;
  std::int64_t position_ = 0;
  double velocity_ = 0.0;
  double following_error_ = 0.0;
  std::int64_t resting_place_ = 0;  // position of the shaft for the last resting_cycles_ cycles
  std::uint64_t resting_cycles_ = 0;
  bool follows_actual_ = false;  // the set-point is the actual position
  double set_point_steps_ = 0.0;
  double position_steps_ = 0.0;
  // Set-points of the last two cycles; acted_on_ is the one that the drive follows when it samples the inputs of
  // read().
  double acted_on_ = 0.0;
  double sent_ = 0.0;

  double torque_ = 0.0;
  double torque_target_ = 0.0;
  double torque_slope_ = 0.0;
  double torque_velocity_limit_ = 0.0;

  Homing homing_ = Homing::starting;
  std::uint64_t homing_cycles_ = 0;
  std::uint64_t settling_cycles_;
  bool homed_ = false;
};

}  // namespace servodrome::master
