#pragma once

#include <array>
#include <deque>
#include <memory>
#include <optional>

#include "axis/cyclic/motion_axis.hpp"
#include "axis/plcopen/command.hpp"

namespace servodrome::master::plcopen {

// Configuration in the axis's units and seconds. The values are the parameters of MC_ReadParameter (part 1, clause 3.15
// table).
struct AxisConfiguration {
  double counts_per_unit = 1.0;  // counts of the drive in one unit of position; negative to invert the direction
  double max_velocity = 1e9;
  double max_acceleration = 1e12;
  double max_deceleration = 1e12;
  double max_jerk = 1e15;
  double positive_limit = 0.0;
  double negative_limit = 0.0;
  bool enable_positive_limit = false;
  bool enable_negative_limit = false;
  double max_position_lag = 0.0;
  bool enable_lag_monitoring = false;
};

// AXIS_REF: state diagram, command queue with buffer modes, and the resulting motion of a MotionAxis. Used by the
// function blocks; no call blocks. Order in each cycle, as in Controller: begin_cycle(), function blocks, update()
// after all axes have advanced, then MotionAxis::write().
class Axis {
 public:
  static constexpr std::size_t most_buffered = 8;

  // `motion` must outlive this. Throws MasterError if counts_per_unit is 0 or not finite, or a greatest value is not
  // finite and above 0.
  Axis(MotionAxis& motion, const AxisConfiguration& configuration);
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  void begin_cycle();
  void update(std::uint64_t cycle);

  // ---- For function blocks ----
  AxisState state() const { return state_; }
  ErrorId error() const { return error_; }
  std::uint16_t drive_error_code() const { return motion_.error_code(); }

  void power(bool on);
  bool is_powered() const { return motion_.is_enabled(); }
  // Accepts or refuses the command. Its status reports the result, at once or in a later cycle.
  void give(const std::shared_ptr<Command>& command);
  // Reports that Execute of an MC_Stop is FALSE.
  void release_stop(Command& stop);
  // Uncouples the slave, which continues at its present velocity.
  ErrorId leave_master(CommandKind kind);
  // Starts the reset; when it is complete, the axis has left ErrorStop.
  ErrorId reset();
  // Ends a reset that is not complete.
  void cancel_reset();
  ErrorId set_position(double position, bool relative);

  double actual_position() const { return units_of(static_cast<double>(motion_.position())); }
  double actual_velocity() const { return motion_.velocity() / scale_; }
  double actual_torque() const { return motion_.torque(); }
  double commanded_position() const { return units_of(motion_.set_point().position); }
  double commanded_velocity() const { return motion_.set_point().velocity / scale_; }
  bool is_homed() const { return is_homed_; }
  std::uint32_t digital_inputs() const { return motion_.axis().digital_inputs(); }

  AxisConfiguration& configuration() { return configuration_; }

  // Each probe accepts one request at a time.
  ErrorId arm(const std::shared_ptr<ProbeRequest>& request);
  void disarm(unsigned probe);

  MotionAxis& motion() { return motion_; }

 private:
  using CommandPointer = std::shared_ptr<Command>;
  using From = SetPointGenerator::From;

  double units_of(double counts) const { return counts / scale_ + offset_; }
  // In the drive's direction.
  double torque_of(const Command& command) const { return scale_ < 0.0 ? -command.torque : command.torque; }
  double counts_of(double units) const { return (units - offset_) * scale_; }
  MotionLimits limits_of(const Command& command) const;

  ErrorId check(const Command& command) const;
  ErrorId check_dynamics(const Command& command) const;
  ErrorId check_master(const Command& command) const;
  ErrorId check_torque(const Command& command) const;
  bool follows(const Axis& other) const;
  void start(const CommandPointer& command, From from);
  // Starts the next command of the queue; without one the state becomes Standstill.
  void go_on(From from);
  void finish(Command::Status status);
  void abort_all();
  // Brakes with the limits of the active command, or with `brake`.
  void enter_error_stop(ErrorId error, std::optional<MotionLimits> brake = std::nullopt);

  // ---- Targets and blending (axis_blending.cpp) ----
  void place(Command& command, double previous_target) const;
  void place_queue();
  double end_velocity_of_active(double from);
  double blending_velocity(const Command& before, double direction, const Command& next, double end_of_next) const;

  // ---- Each cycle ----
  void watch_power();
  void watch_homing();
  void watch_probes();
  void watch_software_limits();
  void update_active();
  void end_by_next(const Command& command);
  void follow_gear(Command& command);
  void follow_cam(Command& command);
  bool is_too_fast(double velocity);
  double led_by(const Command& command, bool velocity) const;
  double cam_origin(const Command& command) const;
  double on_cam(const Command& command, double master_origin) const;
  CamTable::Value cam_value(const Command& command, double master_origin) const;

  MotionAxis& motion_;
  AxisConfiguration configuration_;
  double scale_;
  double offset_ = 0.0;  // units: origin set by MC_SetPosition and MC_Home
  AxisState state_ = AxisState::Disabled;
  ErrorId error_ = ErrorId::none;
  bool is_homed_ = false;
  bool resetting_ = false;

  CommandPointer active_;
  std::deque<CommandPointer> queue_;
  double last_target_ = 0.0;  // counts: target of the last position command

  std::uint64_t updated_in_ = 0;  // number of the last cycle
  // Gear and cam, from the moment of the coupling on, in the units of master and slave: the origins from which their
  // positions count. They do not contain later offsets of MC_SetPosition and MC_Home, so these move no slave.
  double master_origin_ = 0.0;
  double slave_origin_ = 0.0;
  double cam_turn_ = 0.0;  // turn of a periodic cam

  struct Probe {
    std::shared_ptr<ProbeRequest> request;
    bool armed = false;
  };
  std::array<Probe, 2> probes_;
};

}  // namespace servodrome::master::plcopen
