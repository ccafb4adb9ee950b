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

// What must hold after every tick of an axis, whatever was done to it. Judged by the true shaft, which is the plant's,
// by what the power stage is told, and by the frames on the wire; limits come from the objects, by CiA 402.
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

// What the bench does to an axis now, and when the master and the bench last did something.
struct Surroundings {
  std::int64_t commanded = 0;           // tick of the last write that could ask for motion
  std::int64_t disturbed = -1'000'000;  // ... of the last change of load, supply, rotor, faults or power
  double load_share = 0.0;              // external torque, of the rated one
  double supply_share = 1.0;
  double inertia_factor = 1.0;
  std::uint32_t injected = 0;              // bit plant::Injection
  std::uint32_t gentlest_homing_ramp = 0;  // 609Ah that was ever written, without those of 0
  std::int64_t last_heartbeat = -1;        // tick of the master's; -1: none
  std::int64_t joined = -1000;             // when its bus was put together again
  bool locked = false;
  bool powered = true;
  bool cut = false;
  bool quiet_bus = true;  // nothing that could crowd the frames out
};

class Watch {
 public:
  Watch(line::Axis& axis, std::size_t number);

  // After each tick. Nothing: all is well.
  bool tick(std::int64_t tick, const Surroundings& around) {
    tick_ = tick;
    around_ = &around;
    look();
    return !finding_;
  }
  void heard(const canopen::Frame& frame, line::Time at);
  // After the last tick.
  bool end();
  // The mapping of PDOs may have changed.
  void pdos_mapped();
  const std::optional<Finding>& finding() const { return finding_; }
  void fail(const char* invariant, std::string text);

 private:
  // How far and how long a stop takes at most from `velocity` (counts/s), as the objects are now.
  struct Stopping {
    double counts;
    double seconds;
  };
  struct Demand {
    drive::Loop loop = drive::Loop::off;
    double position = 0.0;
    double velocity = 0.0;
  };
  struct Ramp {          // by which a demand comes down
    double slope = 0.0;  // counts/s^2; 0: none is set
    double jerk = 0.0;   // counts/s^3; 0: none
    bool shaped = false;

    static double lower(double a, double b) { return a > 0.0 && b > 0.0 ? std::min(a, b) : std::max(a, b); }
    Ramp gentler(const Ramp& other) const {
      return {lower(slope, other.slope), lower(jerk, other.jerk), shaped || other.shaped};
    }
  };
  Ramp gentlest() const;  // that is set
  void ramps();
  Stopping stopping(double velocity) const { return stopping(velocity, slope()); }
  Stopping stopping(double velocity, double slope) const;
  double jerk_delay(double speed, double ramp, double acceleration) const;
  double jerk_delay(double speed, double ramp) const {
    return jerk_delay(speed, ramp, drive_.axis().generator.acceleration());
  }
  double overshoot(double slope) const;  // counts/s that a stop gains before the loops have taken their torque back
  double lag(double velocity) const;     // counts, of the shaft behind a demand of the position loop
  std::int64_t demand_cycle() const;     // ticks
  double torque_acceleration() const;    // counts/s^2 that the motor can give for certain; 0: none
  // The gentlest ramp that a stop may take, counts/s^2; 0: none is set.
  double slope() const { return ramp_set_.slope; }
  double unsure_speed() const;    // how far the drive may be wrong about the shaft's speed, counts/s
  double steepest() const;        // the steepest ramp that is set, counts/s^2
  double limit_slope() const;     // ... before a limit
  double greatest_speed() const;  // counts/s
  double rpm(double counts_per_s) const { return counts_per_s / counts_per_revolution_ * 60.0; }

  void look();
  void look_at_frame();
  double nearest_place_of(std::int64_t user) const;
  void resolve(bool relative, bool bounded);
  void shown_position();
  void touch_probes();
  void lost_master();
  void power();
  void coasting();
  void states();
  void demand();
  void count_targets();
  void first_target(double from, double to, double seconds);  // counts/s
  void after_halt(const Demand& demand, double seconds);
  void speed_limits();
  void stops();
  void limit_switches();
  bool swings_about_rest() const;
  bool commands_no_velocity() const;
  // The drive may have had a controlword between this look and the one before that is gone.
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
  double peak_torque_share_;    // of the rated one
  double inertia_factor_ = 0.0;
  double rated_acceleration_ = 0.0;  // counts/s^2 by the rated torque, with this factor
  double inertia_kgm2_;
  double load_inertia_kgm2_;
  std::uint32_t negative_wire_;
  std::uint32_t positive_wire_;

  // As of this tick.
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

  // As of the one before.
  bool first_ = true;
  bool spoilt_ = false;  // a phase was open or shorted at some time: the energy book does not close then
  bool had_pwm_ = false;
  bool was_powered_ = true;
  drive::PowerState before_{};
  drive::Mode mode_before_{};
  std::int64_t disturbed_ = 0;
  std::int64_t state_since_ = 0;
  std::int64_t mode_since_ = 0;
  std::int64_t pwm_since_ = 0;   // tick of the last change of the stage
  std::int64_t pwm_before_ = 0;  // ... and of the one before

  std::array<double, 2> fastest_{};  // of the shaft, in this torque_in_flight_s and in the one before
  std::int64_t stood_ = -1'000'000;  // when the shaft last rested where it was demanded to
  double slowest_ = 0.0;             // since the stage is off
  std::int64_t unpowered_ticks_ = 0;

  Demand demand_before_;
  bool halted_ = false;                // with the demand of before
  std::int64_t spoiled_ = -1'000'000;  // tick of the last injection that spoils what the encoder says
  Ramp ramp_set_{};                    // the gentlest that was set since the demand stood
  Ramp gentlest_before_{};
  double ramp_ = 0.0;                // the steepest that was set since the demand stood
  double steepest_given_ = 0.0;      // counts/s^2, since the mode was entered: a set-point keeps its ramps
  double end_velocity_given_ = 0.0;  // counts/s, the greatest 6082h since the demand stood: a set-point keeps its own
  std::int64_t done_ticks_ = 0;      // so long the last set-point is done
  std::int64_t demand_tick_ = -1;

  enum class StopKind : std::uint8_t { none, halt, leave, quick, fault, velocity, homing, no_target, no_mode };
  struct Stop {
    StopKind kind = StopKind::none;
    std::int64_t began = 0;  // tick
    std::int64_t since = 0;  // ... from when on it is judged: what disturbs it, or changes its ramp, is a new beginning
    double from = 0.0;
    double counts = 0.0;
    double seconds = 0.0;
    double slope = 0.0;
    double speed = 0.0;      // of the shaft when it began, counts/s
    double direction = 0.0;  // ... in which it turned; 0: hardly
    double furthest = 0.0;   // times the direction, counts
    bool shaped = false;     // its ramp, once since it began
  } stop_;

  struct Limit {
    bool active = false;
    double furthest = 0.0;  // times the direction
    double slope = 0.0;     // the gentlest since the switch is active
    double from = 0.0;      // where the shaft was then, times the direction
    double speed = 0.0;     // of the shaft then, times the direction, counts/s
    bool leads = false;     // the demand, towards the switch
    bool swings = false;    // the shaft, about a demand that rests
  };
  std::array<Limit, 2> limits_{};
  struct Border {
    bool active = false;
    bool demanded = false;
    std::int64_t at = 0;
    double slope = 0.0;
    double bound = 0.0;
    double own = 0.0;    // the demand's velocity towards the limit in its cycle before, counts/s
    bool moves = false;  // the demand, a tick before
  };
  std::array<Border, 2> borders_{};
  struct Targets {  // of cyclic position: what lies between them, and between them and where the demand began, counts
    bool active = false;
    double low = 0.0;
    double high = 0.0;
    double newest = 0.0;
    double slope = 0.0;
    bool round = false;  // the shorter way to one of them is round the 32 bits
  } given_;
  bool told_to_stop() const { return stop_.kind != StopKind::none && stop_.kind < StopKind::no_target; }
  std::int64_t two_words_at_ = -1'000'000;
  unsigned stops_before_ = 0;  // what stopped the axis: a command, a switch
  std::int64_t stopped_since_ = 0;
  bool has_target_ = false;         // a set-point of profile position, since the mode or the operation began
  StopKind told_ = StopKind::none;  // as `stop_`, also while a torque is released first

  std::int64_t voltage_spent_ = -1'000'000;  // when the DC link last had no voltage left against the motor's
  double demand_speed_ = 0.0;                // counts/s, out of the demanded positions
  struct Excess {                            // of the demand over its greatest speed
    std::int64_t since = 0;
    double most = 0.0;
    double over = 0.0;     // counts/s to come down
    double gaining = 0.0;  // counts/s^2 when it began
    double done = 0.0;     // share of the time that is enough
    bool begun = false;
  } excess_;
  std::int64_t targets_ = 0;  // of a cyclic mode, since its demand begins anew
  std::uint64_t cyclic_target_ = 0;
  struct SetPoint {
    bool active = false;
    bool taken = false;
    bool leaves = false;  // a limit switch
    double from = 0.0;
    double direction = 0.0;
    std::int64_t since = 0;
    std::int64_t alone = 0;  // since when there is no other
    std::int64_t reached = 0;
    double target = 0.0;
    double range = 0.0;   // counts, where the target may be that of another turn of 607Bh; 0: it may not
    int side = 0;         // of the range, from which 60F2h has it come: its bits 6 and 7
    bool passes = false;  // its target, with 6082h
    double speed = 0.0;   // that 6081h and the limits leave, counts/s
    double seconds = 0.0;
  } set_point_;
  struct Away {  // the target that leads off a limit switch
    int targets = 0;
    std::int64_t since = 0;
    double from = 0.0;
    double target = 0.0;
  } away_;
  unsigned held_by_ = 0;  // bit 0, 1: the switch below, above, since the axis moved
  struct AtOnce {         // a set-point with bit 5 of the controlword
    bool active = false;
    bool taken = false;
    std::int64_t since = 0;
    double speed = 0.0;  // 6081h, counts/s
  } at_once_;
  std::uint32_t profile_velocity_before_ = 0;
  std::uint16_t word_before_ = 0;
  bool reached_ = false;  // bit 10, where it has that meaning
  bool ready_ = false;    // for a set-point: bit 12 is clear
  std::int32_t target_before_ = 0;
  std::int64_t asked_ = 0;  // when a command or a set-point changed in the drive
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
  std::array<Way, 2> way_{};  // of the shaft, in these 2 ms and in those before
  std::array<drive::Counts, drive::TouchProbe::slots> latched_{};
  std::uint32_t consumer_ = 0;  // 1016h:01
  std::int64_t consumer_since_ = 0;
  bool lost_by_fault_only_;  // 6007h has 0 and 1

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

  // The wire.
  struct Shown {
    std::int64_t tick;
    std::uint16_t statusword;
  };
  std::array<Shown, 64> shown_{};
  std::size_t shown_count_ = 0;
  std::array<int, 4> statusword_at_{};  // byte of the TPDO; -1: not in it
  std::int64_t mapped_since_ = 0;
  std::uint16_t told_code_ = 0;  // of the last EMCY
  std::int64_t told_at_ = -1;
  std::int64_t fault_since_ = -1;  // an EMCY is due
  canopen::NmtState nmt_{};
  std::int64_t nmt_since_ = 0;
};

}  // namespace servodrome::motion
