#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "line/line.hpp"
#include "sequence.hpp"

// Invariants that must hold after every tick of an axis, whatever was done to it. They are judged by the true shaft
// (that of the plant), by the commands to the power stage, and by the frames on the bus. The limits come from the
// objects, as CiA 402 defines them.
namespace servodrome::motion {

struct Finding {
  std::string invariant;
  std::size_t axis = 0;
  std::int64_t tick = 0;
  std::string text;
};

struct InvariantRow {
  const char* name;
  const char* meaning;
};
std::span<const InvariantRow> invariants();

// The present actions of the bench on an axis, and the times of the last actions of master and bench.
struct Surroundings {
  std::int64_t commanded = 0;           // tick of the last write that could ask for motion
  std::int64_t disturbed = -1'000'000;  // ... of the last change of load, supply, rotor, faults or power
  double load_share = 0.0;              // external torque, fraction of the rated torque
  double supply_share = 1.0;
  double inertia_factor = 1.0;
  std::uint32_t injected = 0;              // bit n: plant::Injection n is active
  std::uint32_t gentlest_homing_ramp = 0;  // lowest value other than 0 that was ever written to 609Ah
  std::int64_t last_heartbeat = -1;        // tick of the master's last one; -1: none
  std::int64_t joined = -1000;             // tick at which its bus was last reconnected
  bool locked = false;
  bool powered = true;
  bool cut = false;
  bool quiet_bus = true;  // the bus has room for all frames
};

class Watch {
 public:
  Watch(line::Axis& axis, std::size_t number);

  // To be called after each tick. Returns false if an invariant is broken.
  bool tick(std::int64_t tick, const Surroundings& around) {
    tick_ = tick;
    around_ = &around;
    look();
    return !finding_;
  }
  void heard(const canopen::Frame& frame, line::Time at);
  // To be called after the last tick. Returns false if an invariant is broken.
  bool end();
  // To be called when the mapping of PDOs may have changed.
  void pdos_mapped();
  const std::optional<Finding>& finding() const { return finding_; }
  void fail(const char* invariant, std::string text);

 private:
  // Greatest distance and duration of a stop from `velocity` (counts/s), with the present objects.
  struct Stopping {
    double counts;
    double seconds;
  };
  struct Demand {
    drive::Loop loop = drive::Loop::off;
    double position = 0.0;
    double velocity = 0.0;
  };
  struct Ramp {          // that slows a demand down
    double slope = 0.0;  // counts/s^2; 0: none is set
    double jerk = 0.0;   // counts/s^3; 0: none
    bool shaped = false;

    static double lower(double a, double b) { return a > 0.0 && b > 0.0 ? std::min(a, b) : std::max(a, b); }
    Ramp gentler(const Ramp& other) const {
      return {lower(slope, other.slope), lower(jerk, other.jerk), shaped || other.shaped};
    }
  };
  Ramp gentlest() const;  // of the ramps that are set
  void ramps();
  Stopping stopping(double velocity) const { return stopping(velocity, slope()); }
  Stopping stopping(double velocity, double slope) const;
  double jerk_delay(double speed, double ramp, double acceleration) const;
  double jerk_delay(double speed, double ramp) const {
    return jerk_delay(speed, ramp, drive_.axis().generator.acceleration());
  }
  // counts/s that the shaft may gain in a stop until the loops have reduced their torque
  double overshoot(double slope) const;
  double lag(double velocity) const;   // counts, of the shaft behind a demand of the position loop
  std::int64_t demand_cycle() const;   // ticks
  double torque_acceleration() const;  // counts/s^2 that the motor certainly reaches; 0: none
  // The lowest ramp that a stop may use, counts/s^2; 0: none is set.
  double slope() const { return ramp_set_.slope; }
  double unsure_speed() const;    // greatest error of the speed that the drive measures, counts/s
  double steepest() const;        // the steepest ramp that is set, counts/s^2
  double limit_slope() const;     // ... before a limit
  double greatest_speed() const;  // counts/s
  double rpm(double counts_per_s) const { return counts_per_s / counts_per_revolution_ * 60.0; }

  void look();
  void look_at_frame();
  double nearest_place_of(std::int64_t user) const;
  void resolve(bool relative, bool bounded);
  std::array<std::int64_t, 3> set_point_limits() const {
    return {objects_.min_position_limit, objects_.max_position_limit, objects_.max_profile_velocity};
  }
  void shown_position();
  void touch_probes();
  void lost_master();
  void power();
  void coasting();
  void states();
  void demand();
  void count_targets();
  void first_torque(double torque);                           // fraction of rated torque
  void first_target(double from, double to, double seconds);  // counts/s
  void after_halt(const Demand& demand, double seconds);
  void speed_limits();
  void stops();
  void limit_switches();
  bool swings_about_rest() const;
  bool commands_no_velocity() const;
  // Returns true if the drive may have received two controlwords since the last tick, of which only the second is
  // still visible.
  bool two_words() const { return asked_ == tick_ && around_->commanded >= tick_ - 1; }
  void software_limits();
  void set_points();
  void off_limit();
  void beyond_targets();
  void unasked();
  double ramp_way(double speed, double ramp) const;
  std::uint8_t communication_register();
  void torque();
  void bits();
  void look_up_bits();
  void limit_bit();
  void following_error_bit();
  void errors();
  void error_registers();
  bool motion_can_be_judged() const;

  line::Axis& axis_;
  drive::Drive& drive_;
  const drive::Objects& objects_;
  std::size_t number_;
  const Surroundings* around_ = nullptr;
  std::optional<Finding> finding_;
  double counts_per_revolution_;
  double counts_per_s_per_rpm_;
  double rated_torque_nm_;
  double emf_per_speed_ = 0.0;  // of a phase, V s/count
  double voltage_share_ = 0.0;  // of the DC link, amplitude of a phase
  double peak_torque_share_;    // fraction of the rated torque
  double inertia_factor_ = 0.0;
  double rated_acceleration_ = 0.0;  // counts/s^2 by the rated torque, with inertia_factor_
  double inertia_kgm2_;
  double load_inertia_kgm2_;
  std::uint32_t negative_wire_;
  std::uint32_t positive_wire_;

  // Values of this tick.
  std::int64_t tick_ = 0;
  bool judgeable_ = false;     // motion_can_be_judged()
  double acceleration_ = 0.0;  // torque_acceleration()
  double position_ = 0.0;      // counts
  double velocity_ = 0.0;      // counts/s
  bool pwm_ = false;
  bool shorted_ = false;
  drive::PowerState state_{};
  drive::Mode mode_{};
  struct Bits {  // of the statusword, in this mode
    bool reached = false;
    bool limit = false;
    bool zero_speed = false;
    bool following_error = false;
  } shown_bits_;

  // Values of the previous tick.
  bool first_ = true;
  // an injection of spoils_motion was active at some time: the energy balance is then not checked
  bool spoilt_ = false;
  bool had_pwm_ = false;
  bool was_powered_ = true;
  drive::PowerState before_{};
  drive::Mode mode_before_{};
  std::int64_t disturbed_ = 0;
  std::int64_t state_since_ = 0;
  std::int64_t mode_since_ = 0;
  std::int64_t pwm_since_ = 0;   // tick of the last change of pwm_
  std::int64_t pwm_before_ = 0;  // ... and of the one before

  // greatest speed of the shaft in this interval of torque_in_flight_s and in the previous one
  std::array<double, 2> fastest_{};
  std::int64_t stood_ = -1'000'000;  // tick at which the shaft and the demand last stood
  double slowest_ = 0.0;             // lowest speed since the stage is off
  std::int64_t unpowered_ticks_ = 0;

  Demand demand_before_;
  bool halted_ = false;                // at the previous change of the demand
  std::int64_t spoiled_ = -1'000'000;  // last tick with an active injection of spoils_motion
  Ramp ramp_set_{};                    // lowest ramp that was set since the demand stood
  Ramp gentlest_before_{};
  double ramp_ = 0.0;                // steepest ramp that was set since the demand stood
  double steepest_given_ = 0.0;      // counts/s^2, since the mode was entered: a set-point keeps its ramps
  double end_velocity_given_ = 0.0;  // counts/s, the greatest 6082h since the demand stood: a set-point keeps its own
  std::int64_t done_ticks_ = 0;      // ticks for which the last set-point has been done
  std::int64_t demand_tick_ = -1;

  enum class StopKind : std::uint8_t { none, halt, leave, quick, fault, velocity, homing, no_target, no_mode };
  struct Stop {
    StopKind kind = StopKind::none;
    std::int64_t began = 0;  // tick of its beginning
    std::int64_t since = 0;  // tick from which it is judged: a disturbance or a change of its ramp restarts that
    double from = 0.0;
    double counts = 0.0;
    double seconds = 0.0;
    double slope = 0.0;
    double speed = 0.0;      // speed of the shaft when it began, counts/s
    double direction = 0.0;  // direction of the shaft then; 0: it hardly turned
    double furthest = 0.0;   // greatest position times the direction, counts
    bool shaped = false;     // its ramp was not linear at some time since it began
  } stop_;

  struct Limit {
    bool active = false;
    double furthest = 0.0;  // bound of the position, times the direction
    double slope = 0.0;     // lowest ramp since the switch is active
    double from = 0.0;      // position of the shaft when the switch became active, times the direction
    double speed = 0.0;     // speed of the shaft then, times the direction, counts/s
    bool leads = false;     // the demand leads towards the switch
    bool swings = false;    // the shaft swings about a demand that stands
    double swung = 0.0;     // the furthest that the shaft was on the other side of that demand, in counts
  };
  std::array<Limit, 2> limits_{};
  struct Border {
    bool active = false;
    bool demanded = false;
    std::int64_t at = 0;
    std::int64_t turn = 0;  // in which 6064h is shown; in another turn the limits lie elsewhere
    double slope = 0.0;
    double bound = 0.0;
    double own = 0.0;    // velocity of the demand towards the limit in its previous cycle, counts/s
    bool moves = false;  // the demand moved in the previous tick
  };
  std::array<Border, 2> borders_{};
  // of cyclic position, counts: the range from `low` to `high` contains them and the place where the demand began
  struct Targets {
    bool active = false;
    double low = 0.0;
    double high = 0.0;
    double newest = 0.0;
    double slope = 0.0;
    bool round = false;  // one of them is so far away that the product chooses its direction
  } given_;
  double clipped_target_ = 0.0;  // place of the last cyclic target, within the software limits at its time
  bool told_to_stop() const { return stop_.kind != StopKind::none && stop_.kind < StopKind::no_target; }
  std::int64_t two_words_at_ = -1'000'000;
  unsigned stops_before_ = 0;  // bits of what stops the axis: a command, a switch
  std::int64_t stopped_since_ = 0;
  bool has_target_ = false;  // a set-point was given in profile position since the mode or the operation began

  std::int64_t voltage_spent_ = -1'000'000;  // tick at which the back-EMF last used up the voltage of the DC link
  double demand_speed_ = 0.0;                // counts/s, calculated from the positions of the demand
  struct Excess {                            // speed of the demand above its limit
    std::int64_t since = 0;
    double most = 0.0;
    double over = 0.0;     // counts/s above the limit at the beginning
    double gaining = 0.0;  // acceleration of the demand at the beginning, counts/s^2
    double done = 0.0;     // fraction of the permitted time that has passed
    bool begun = false;
  } excess_;
  std::int64_t targets_ = 0;  // number of targets of a cyclic mode since its demand last began
  std::uint64_t cyclic_target_ = 0;
  struct SetPoint {
    bool active = false;
    bool taken = false;
    bool leaves = false;  // the set-point leads away from a limit switch
    double from = 0.0;
    double direction = 0.0;
    std::int64_t since = 0;
    std::int64_t alone = 0;  // tick since which there is no other set-point
    std::int64_t reached = 0;
    double target = 0.0;
    std::array<std::int64_t, 3> limits{};  // 607Dh and 607Fh, by which target and speed are limited
    double range = 0.0;   // length of the range 607Bh in counts, if the target may lie in any of its turns; otherwise 0
    int side = 0;         // bits 6 and 7 of 60F2h: the direction within the range
    bool passes = false;  // it passes its target with the end velocity 6082h
    double speed = 0.0;   // that 6081h and the limits allow, counts/s
    double seconds = 0.0;
  } set_point_;
  struct Away {  // a cyclic target that leads away from a limit switch
    int targets = 0;
    std::int64_t since = 0;
    double from = 0.0;
    double target = 0.0;
  } away_;
  unsigned held_by_ = 0;  // switches that hold the axis: bit 0 negative, bit 1 positive
  struct AtOnce {         // a set-point with bit 5 of the controlword
    bool active = false;
    bool taken = false;
    std::int64_t since = 0;
    double speed = 0.0;  // 6081h, counts/s
  } at_once_;
  std::uint32_t profile_velocity_before_ = 0;
  std::uint16_t word_before_ = 0;
  bool reached_ = false;  // bit 10 of the statusword, in modes where it means target reached
  bool ready_ = false;    // for a set-point: bit 12 of the statusword is 0
  std::int32_t target_before_ = 0;
  std::int64_t asked_ = 0;  // tick at which a command or a target last changed in the objects
  std::uint64_t asked_before_ = 0;

  struct Frame {
    drive::Counts offset = 0;
    std::int64_t numerator = 0;
    std::int64_t denominator = 0;
    std::int32_t range_low = 0;
    std::int32_t range_high = 0;
    bool inverted = false;
    bool velocity_inverted = false;
    friend bool operator==(const Frame&, const Frame&) = default;
  } frame_;
  std::int64_t frame_since_ = 0;  // tick
  struct Way {
    double low = 0.0;
    double high = 0.0;
  };
  std::array<Way, 2> way_{};  // range of the shaft in the present 2 ms and in the 2 ms before
  std::array<drive::Counts, drive::TouchProbe::slots> latched_{};
  std::uint32_t consumer_ = 0;  // 1016h:01
  std::int64_t consumer_since_ = 0;
  bool lost_by_fault_only_;  // 6007h has the values 0 and 1 only

  double rest_ = 0.0;
  std::int64_t rest_since_ = 0;
  std::int64_t torque_over_ = 0;
  std::int64_t torque_limits_since_ = 0;
  std::int64_t torque_limits_ = 0;
  std::int64_t lie_since_ = 0;
  std::int64_t unsaid_since_ = 0;
  std::int64_t stop_lie_since_ = 0;
  std::int64_t zero_lie_since_ = 0;
  std::int64_t limit_lie_since_ = 0;
  std::int64_t following_lie_since_ = 0;
  bool following_shown_ = false;
  std::int64_t register_since_ = 0;
  std::int64_t failed_since_ = 0;
  std::int64_t obey_since_ = 0;

  // Frames on the bus.
  struct Shown {
    std::int64_t tick;
    std::uint16_t statusword;
  };
  std::array<Shown, 64> shown_{};
  std::size_t shown_count_ = 0;
  std::array<int, 4> statusword_at_{};  // byte of the TPDO; -1: not in it
  std::int64_t mapped_since_ = 0;
  std::uint16_t told_code_ = 0;  // code of the last EMCY
  std::int64_t told_at_ = -1;
  std::int64_t fault_since_ = -1;  // tick of a fault whose EMCY is due; -1: none
  canopen::NmtState nmt_{};
  std::int64_t nmt_since_ = 0;
};

}  // namespace servodrome::motion
