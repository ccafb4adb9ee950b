#pragma once

#include "host/cyclic/cyclic_axis.hpp"
#include "host/cyclic/set_point_generator.hpp"

namespace servodrome::host {

// Why an axis stopped by itself.
enum class AxisFault : std::uint8_t {
  none,
  drive_fault,         // the drive says so: 603Fh
  left_operation,      // it is no longer enabled, without request: supply, safety input, quick stop, another master
  communication_lost,  // too many cycles without its data
  following_error,     // further from its set-point than allowed
  mode_refused,        // it does not take the mode of operation
  homing_failed,       // its statusword says so
};
const char* name(AxisFault fault);
// What to do about it.
const char* remedy_of(AxisFault fault);

struct MotionAxisOptions {
  // Where set-points go: cyclic synchronous position or interpolated position.
  OperationMode position_mode = OperationMode::cyclic_synchronous_position;
  double velocity_scale = 1.0;         // 60FFh and 606Ch per count/s
  double following_error_limit = 0.0;  // counts; 0: none
  unsigned tolerated_losses = 10;      // cycles in a row without data
  Time mode_timeout = std::chrono::seconds(1);
  HomingSignals homing_signals{};
};

// An axis that a master's own trajectory moves, cycle by cycle. In each cycle: read(), then commands, advance(),
// write(). Commands that several axes get in the same cycle start in the same cycle. Positions are in the drive's units
// ("counts"), 64 bits wide: those of the drive may wrap around. Nothing here waits or throws once it is made.
class MotionAxis {
 public:
  // Throws HostError if the process data do not have what the position mode needs.
  MotionAxis(const CyclicAxis& axis, Time period, const MotionAxisOptions& options = {});

  // ---- The cycle ----
  // Takes what the cycle brought; `fresh`: it brought all.
  void read(bool fresh);
  // The set-point of the next cycle.
  void advance();
  // Into the process data.
  void write();

  // ---- Power ----
  // Walks the drive to operation enabled, or to switch on disabled, one transition each cycle. Switching off does not
  // brake: stop first.
  void switch_on(bool on) { switched_on_ = on; }
  bool is_switched_on() const { return switched_on_; }
  // Set-points are obeyed.
  bool is_enabled() const { return enabled_; }
  AxisFault fault() const { return fault_; }
  // 603Fh when the fault came, or 0.
  std::uint16_t error_code() const { return error_code_; }
  // Resets the drive's fault, too; fault() is none when it is done.
  void reset_fault() { resetting_ = true; }
  bool is_resetting() const { return resetting_; }

  // ---- Commands; the axis is enabled, or they do nothing. False: see SetPointGenerator ----
  bool move_to(double target, double end_velocity, const MotionLimits& limits,
               SetPointGenerator::From from = SetPointGenerator::From::present);
  bool run_at(double velocity, const MotionLimits& limits,
              SetPointGenerator::From from = SetPointGenerator::From::present);
  void follow(const MotionState& next);
  // Velocity by the drive's own velocity loop (cyclic synchronous velocity), the profile by the master.
  bool run_in_velocity_mode(double velocity, const MotionLimits& limits);
  // Cyclic synchronous torque: to `torque` (0.1 % of rated torque) at `slope` per second. Towards `velocity_limit`
  // (counts/s, 0: none) the torque falls to nothing, over the last tenth of it.
  bool apply_torque(double torque, double slope, double velocity_limit);
  // The drive's homing, as its objects are set (6098h and others). The axis stands.
  bool home();
  // Breaks homing off with a halt.
  void abort_homing();
  void shift_set_point(double distance) { generator_.shift(distance); }

  // Counts; 0: none.
  void set_following_error_limit(double counts) { options_.following_error_limit = counts; }

  // ---- What is ----
  const SetPointGenerator& generator() const { return generator_; }
  const MotionState& set_point() const { return generator_.state(); }
  std::int64_t position() const { return position_; }
  double velocity() const { return velocity_; }        // counts/s
  double torque() const { return axis_.torque(); }     // 0.1 % of rated torque
  double torque_set_point() const { return torque_; }  // 0.1 % of rated torque
  double following_error() const { return following_error_; }
  bool is_homing() const { return task_ == Task::homing; }
  // Homing has been carried out since it was last asked for.
  bool is_homed() const { return homed_; }
  bool is_in_torque_mode() const { return task_ == Task::torque; }
  CyclicAxis& axis() { return axis_; }
  const CyclicAxis& axis() const { return axis_; }
  const MotionAxisOptions& options() const { return options_; }

 private:
  enum class Task : std::uint8_t { position, velocity, torque, homing };
  enum class Homing : std::uint8_t { starting, running, breaking_off };

  OperationMode mode_of(Task task) const;
  bool mode_is(OperationMode mode) const;
  bool waits_for_mode() const;
  bool follows();
  bool start(Task task);
  void fail(AxisFault fault);
  void take_position();
  void track_power();
  void supervise(bool fresh);
  void run_homing();
  void end_homing();
  void write_targets();
  std::uint16_t enabled_controlword() const;
  double limited_torque() const;

  CyclicAxis axis_;
  MotionAxisOptions options_;
  SetPointGenerator generator_;
  Task task_ = Task::position;
  bool switched_on_ = false;
  bool enabled_ = false;
  bool resetting_ = false;
  AxisFault fault_ = AxisFault::none;
  std::uint16_t error_code_ = 0;
  unsigned losses_ = 0;
  std::uint64_t cycles_without_mode_ = 0;
  std::uint64_t cycles_not_following_ = 0;
  std::uint64_t mode_timeout_cycles_;

  bool has_position_ = false;
  std::int64_t position_ = 0;
  double velocity_ = 0.0;
  double following_error_ = 0.0;
  // What the drive acts on when it samples what read() sees: the set-points of the last two cycles.
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

}  // namespace servodrome::host
