#pragma once

#include <functional>
#include <initializer_list>
#include <span>
#include <utility>

#include "catalogue/product.hpp"
#include "drive/power/power_state.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

using catalogue::AxisUnits;

using drive::PowerState;

// The power state that a statusword encodes (CiA 402-2 table 27).
PowerState state_of(std::uint16_t statusword);
// For example "0237h (ready to switch on, switched on, ...)": the names of the bits that are set, as the product uses
// them in this mode (6061h). A bit without a meaning there appears as "bit 12".
std::string text_of_statusword(std::uint16_t statusword, std::string_view product = {}, std::int8_t mode = 0);

// Modes of operation (6060h).
enum class OperationMode : std::int8_t {
  none = 0,
  profile_position = 1,
  velocity = 2,
  profile_velocity = 3,
  profile_torque = 4,
  homing = 6,
  interpolated_position = 7,
  cyclic_synchronous_position = 8,
  cyclic_synchronous_velocity = 9,
  cyclic_synchronous_torque = 10,
};
// For example "profile position"; a product may have modes with negative numbers.
std::string_view name(OperationMode mode, std::string_view product = {});

// A call ended early because AxisOptions::cancelled returned true; the axis has been brought to rest.
class Cancelled : public MasterError {
 public:
  using MasterError::MasterError;
};

struct AxisOptions {
  Time state_timeout = std::chrono::seconds(2);       // per transition (plus brake_delay()), mode change, handshake
  Time enable_timeout = std::chrono::seconds(5);      // per step of enabling (plus brake_delay()): precharge, brake
  Time reset_timeout = std::chrono::seconds(2);       // for a fault reset, from the edge of the controlword's bit
  Time poll_interval = std::chrono::milliseconds(5);  // between two reads of the statusword
  // A motion fails after this time without progress: the shaft stands and homing does not end; or the drive shows the
  // target of a move as reached, but the axis is away from the target and does not come nearer.
  Time progress_timeout = std::chrono::seconds(5);
  const catalogue::Product* product = &catalogue::cia402::product;  // what is known about the drive
  // If the halt by stop() lasts longer than this, stop() changes to a quick stop. nullopt: no such limit; the halt may
  // last as long as the axis keeps slowing down.
  std::optional<Time> longest_halt{};
  // Cancellation callback, called at each poll of every wait; true ends the wait: the axis is halted first, then the
  // call throws Cancelled. It does not end stop(), disable() and quick_stop(), because they bring the axis to rest.
  std::function<bool()> cancelled{};
};

// In the drive's own units (increments, unless the drive's factors define others). A value that is nullopt is not
// written.
struct MotionProfile {
  std::optional<std::uint32_t> velocity{};      // 6081h
  std::optional<std::uint32_t> acceleration{};  // 6083h
  std::optional<std::uint32_t> deceleration{};  // 6084h
};

// The slope is in 0.1 % of the rated torque per second.
struct TorqueProfile {
  std::optional<std::uint32_t> slope{};  // 6087h
};

struct HomingRequest {
  std::optional<std::int8_t> method{};          // 6098h
  std::optional<std::uint32_t> switch_speed{};  // 6099h sub 1
  std::optional<std::uint32_t> zero_speed{};    // 6099h sub 2
  std::optional<std::uint32_t> acceleration{};  // 609Ah
  std::optional<std::int32_t> offset{};         // 607Ch
};

// Limits of the axis, in the drive's units. nullopt in the result of limits(): the drive does not have the object;
// nullopt in the argument of set_limits(): the object stays unchanged.
struct AxisLimits {
  std::optional<std::int32_t> lowest_position{};            // 607Dh
  std::optional<std::int32_t> highest_position{};           // 607Dh; with most drives both limits 0 mean: no limits
  std::optional<std::uint32_t> profile_velocity{};          // 607Fh
  std::optional<std::uint32_t> motor_speed_rpm{};           // 6080h
  std::optional<std::uint32_t> acceleration{};              // 60C5h
  std::optional<std::uint32_t> deceleration{};              // 60C6h
  std::optional<std::uint16_t> torque_permille{};           // 6072h
  std::optional<std::uint16_t> positive_torque_permille{};  // 60E0h
  std::optional<std::uint16_t> negative_torque_permille{};  // 60E1h
};

// Set-up of a touch probe (60B8h). The probe latches the position at an edge of its input or of the encoder's index.
struct ProbeRequest {
  enum class Source : std::uint8_t { input, index };
  std::uint8_t probe = 1;  // 1 or 2
  Source source = Source::input;
  bool positive_edge = true;
  bool negative_edge = false;
  bool continuous = false;  // true: each edge overwrites the latched position; false: that of the first edge stays
};
// nullopt: no such edge since the probe was armed.
struct ProbePositions {
  std::optional<std::int32_t> positive{};  // 60BAh, 60BCh
  std::optional<std::int32_t> negative{};  // 60BBh, 60BDh
};

struct AxisStatus {
  std::uint16_t statusword = 0;
  std::int8_t mode = 0;       // 6061h
  std::int32_t position = 0;  // 6064h
  std::int32_t velocity = 0;  // 606Ch, 0 if the drive does not have it
  std::int16_t torque = 0;    // 6077h, 0.1 % of rated torque; 0 if the drive does not have it
  bool has_velocity = true;
  bool has_torque = true;

  PowerState state() const { return state_of(statusword); }
};

// Commands one CiA 402 axis through its objects over any bus, as a commissioning tool does. Unless its comment says
// otherwise, a call blocks, and runs the bus meanwhile, until the drive has executed the command. If the drive does not
// execute it, the call throws MasterError with the state, the statusword, 603Fh with its cause and remedy, and the
// latest EMCY. If an access fails, the call throws ObjectError.
class Axis402 {
 public:
  // Callback at each poll of a motion. It may call halt() and resume(), change the velocity, or throw to leave the
  // motion; it may call stop() before it throws.
  using Progress = std::function<void(const AxisStatus&)>;
  // Returns the velocity wanted now; nullopt ends the jog, and the axis stops.
  using JogDemand = std::function<std::optional<std::int32_t>(const AxisStatus&)>;

  // `objects` must outlive this.
  explicit Axis402(ObjectClient& objects, const AxisOptions& options = {}) : options_(options), objects_(objects) {}

  std::uint16_t statusword() { return objects_.read<std::uint16_t>(0x6041); }
  PowerState state() { return state_of(statusword()); }
  std::int32_t position();  // 6064h, or 6063h if the drive does not have 6064h
  std::int32_t velocity() { return objects_.read<std::int32_t>(0x606C); }
  AxisStatus status();

  // Power state. Each call returns at once if the drive is in the wanted state already.
  void reset_fault();
  // Enables without a motion: targets that would act at once (60FFh, 6042h, 6071h, 607Ah, and the offsets 60B1h and
  // 60B2h, depending on the mode) are first set to 0 or to the present position. A quick stop in progress ends first.
  // Throws if the drive does not keep one of these values. A fault is an error: call reset_fault() first. After an
  // error or a cancellation the axis is told to switch off, so that it does not become enabled later.
  void enable();
  // The part of enable() that writes the targets, for a caller that sends the controlwords itself.
  void take_back_targets_before_enabling();
  // disable() and quick_stop() also clear the targets of an axis that is off already, for example after a fault.
  void disable();
  void quick_stop();  // returns when the quick stop is active or over and the axis is at standstill; clears the targets
  // The time in which the drive closes its brake before it switches off (Dialect::brake_delay).
  Time brake_delay();
  // Writes 0 into every velocity and torque target that the drive has; a write that the drive refuses is ignored.
  void take_back_targets();
  // The same for an axis that is off already: writes only targets that are not 0, and ignores every error that the
  // drive answers. Throws ObjectError if the drive does not answer.
  void take_back_targets_of_idle_axis();

  // Writes 6060h and waits until 6061h shows the mode. Also throws if 6502h shows that the drive does not support it.
  void set_mode(OperationMode mode);

  // Runs the homing method; the drive must be enabled. Returns when homing is attained and the axis is at rest.
  void home(const HomingRequest& request, Time timeout, const Progress& progress = {});

  // Profile position; the drive must be enabled. Returns when the target is reached. move_by() counts from the last
  // target, or, after stop(), from the present position, because stop() drops the move. Without a velocity the drive
  // uses its own 6081h; the call throws if that is 0.
  void move_to(std::int32_t position, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  void move_by(std::int32_t distance, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  // The same in two steps: start_move...() returns when the drive has accepted the set-point, wait_for_target() when
  // the move is complete.
  void start_move_to(std::int32_t position, const MotionProfile& profile);
  void start_move_by(std::int32_t distance, const MotionProfile& profile);
  void wait_for_target(Time timeout, const Progress& progress = {});

  // Profile velocity; returns when the velocity is reached. The axis keeps on running.
  void run_at(std::int32_t velocity, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  // Lets the present motion run for `span`; throws if the drive leaves operation enabled during that time, or the axis
  // rests at an active limit switch in the direction of its motion.
  void hold_for(Time span, const Progress& progress = {});
  // Changes the velocity of the present motion: 60FFh in profile velocity, 6081h of a move.
  void change_velocity(std::int32_t velocity);
  // Profile velocity: each poll sets the velocity that `demand` returns, until it returns nullopt or throws; then
  // stop(). The function stops the axis also if it ends with an exception. If the axis rests at an active limit switch
  // in the direction of the velocity, the call throws, or with `waits_at_limit` continues, so that `demand` can
  // reverse.
  void jog(const MotionProfile& profile, const JogDemand& demand, bool waits_at_limit = false);
  // The same with one velocity, which is wanted for `duration`, its ramp included.
  void jog_for(Time duration, std::int32_t velocity, const MotionProfile& profile, const Progress& progress = {});
  // Profile torque, in 0.1 % of the rated torque; returns when it is reached. The torque stays on and the speed is not
  // limited: set limits first. Throws if the axis rests at an active limit switch in the direction of the torque.
  void run_torque(std::int16_t torque_permille, const TorqueProfile& profile, Time timeout,
                  const Progress& progress = {});
  // The same, but returns when the drive has accepted the target torque. hold_for() lets it act for a time.
  void start_torque(std::int16_t torque_permille, const TorqueProfile& profile);

  // Halts (option code 605Dh) and waits for standstill; aborts homing and drops a move. In profile torque the axis is
  // braked by a velocity of 0 and the mode changes to profile velocity, because a halt would let the axis coast. A halt
  // longer than AxisOptions::longest_halt becomes a quick stop. The call does not interrupt a quick stop or a halt that
  // another client has commanded: it waits for the end, and commands a quick stop only if the axis does not come to
  // rest.
  void stop();
  // Commands the halt of stop() and does not wait for standstill.
  void begin_stop();
  // Calls begin_stop() of several axes; the caller then calls stop() of each. If an access to a drive fails, or gets no
  // answer within `short_wait`, this axis comes last, so that its timeouts do not delay the others. Ignores errors:
  // stop() reports them.
  static void begin_stop_of(std::span<Axis402* const> axes);
  // True if at least one stop() changed to a quick stop.
  bool became_quick_stop() const { return became_quick_stop_; }
  // stop() for error handling, where the first error is reported anyway: returns "" or the reason why the axis could
  // not be stopped.
  std::string try_to_stop();
  // For error handling, where the first error is reported anyway: stops the axis, by a quick stop if stop() fails, and
  // switches the motor off. Returns "" or the reason why the motor could not be switched off.
  std::string try_to_switch_off();
  // Halts the axis as stop() does, but resume() continues the motion. Between the two only change_velocity(), stop(),
  // quick_stop() and disable() are allowed. Throws in profile torque.
  void halt();
  void resume();
  bool halted() const { return halted_; }

  AxisLimits limits();
  // Writes the limits that have a value. If the drive refuses one, those written before it are restored.
  void set_limits(const AxisLimits& limits);

  // Clears the latched positions and arms the probe for the next edges.
  void arm_probe(const ProbeRequest& request);
  void disarm_probe(std::uint8_t probe);
  ProbePositions probe_positions(std::uint8_t probe);
  // Returns when every edge of the request has occurred.
  ProbePositions wait_for_probe(const ProbeRequest& request, Time timeout, const Progress& progress = {});

  // The drive's units in a motor revolution, from the dialect and the drive's factors. `position`, if given, replaces
  // the position units of a revolution. nullopt if neither source defines the position unit.
  std::optional<AxisUnits> units(std::optional<double> position = {});
  // The drive's units in one encoder count, one count/s and one count/s2. nullopt: the drive has factors, but no 608Fh.
  std::optional<AxisUnits> units_per_count();

  // Call it after the drive's factors have changed: the axis reads them again when it needs them.
  void forget_units() {
    rest_distance_.reset();
    rest_increments_.reset();
  }

  ObjectClient& objects() { return objects_; }
  const catalogue::Product& product() const { return *options_.product; }
  std::uint16_t address() const { return objects_.address(); }  // node-ID, station, unit or position on the bus
  std::optional<Emergency> latest_emergency() { return objects_.latest_emergency(); }

 private:
  void write_controlword(std::uint16_t word);
  std::optional<std::uint16_t> kept_controlword();
  bool is_sent_again(std::uint16_t word, std::uint16_t kept) const;
  bool is_stop(std::uint16_t word) const;
  // Writes 0 or the present position into a target and reads it back. Returns nullopt if the drive keeps the value or
  // does not have the object, otherwise the reason why not.
  std::optional<std::string> take_back(std::uint16_t index, bool to_present_position);
  // True if the shaft comes to rest, judged by its position, within `span`.
  bool rests_within(Time span);
  // Counts of the encoder in a motor revolution. nullopt: the drive does not report them.
  std::optional<double> counts_per_revolution();
  // Sub-index 1 divided by sub-index 2; nullopt if the object is absent or one of the two is 0.
  std::optional<double> ratio(std::uint16_t index);
  std::int8_t mode();  // 6061h, or 6060h if the drive does not have 6061h
  template <typename T>
  void write_if_given(std::uint16_t index, std::uint8_t sub, const std::optional<T>& value) {
    if (value) objects_.write<T>(index, sub, *value);
  }
  void write_profile(const MotionProfile& profile);
  // Writes the number in the size that the drive's object has, because products differ in it.
  void write_number(ObjectAddress object, std::int64_t value);
  // Polls until the drive is in one of the states `wanted`; a fault meanwhile is an error.
  void wait_for_state(std::initializer_list<PowerState> wanted, const char* doing, Time timeout);
  // enable(); sets `is_commanded` before the first controlword.
  void step_to_operation(bool& is_commanded);
  void require_enabled(const char* doing);
  void require_no_stop(const char* doing);
  void require_mode(const std::string& doing);
  bool wait_for_bits(std::uint16_t mask, std::uint16_t value, Time timeout);
  // Waits for one poll interval. Throws Cancelled.
  void pause();
  void leave_if_cancelled(const std::string& doing);
  void start_move(std::int32_t target, bool relative, const MotionProfile& profile);
  // Returns what `call` returns. If it throws, for example because the drive does not answer, the axis may still move:
  // the controlword `word` is sent before the exception goes on. The word must not enable a drive in any state.
  template <typename Call>
  auto or_send(std::uint16_t word, const Call& call) {
    try {
      return call();
    } catch (const MasterError&) {
      halted_ = false;
      write_controlword(word);
      throw;
    }
  }
  // Timeout of an access while the stop of other axes waits.
  static constexpr Time short_wait = std::chrono::milliseconds(100);
  static bool is_doubtful(PowerState state);
  // Returns the power state before a stop. Returns not ready to switch on if the statusword shows switched on although
  // the shaft moves.
  PowerState state_to_stop();
  void stop_in_doubt();
  // The time in which a quick stop or the disabling must show in the statusword.
  Time time_to_obey() const;
  bool is_to_operate();
  static bool is_ordered_to_operate(std::uint16_t controlword);
  std::uint16_t present_controlword();
  OperationMode command_halt();
  void complete_stop_of_another();
  // The handshake for a set-point (CiA 402-2 figure 15).
  bool drop_set_points(std::uint16_t halted);
  void hand_over(std::int32_t target, std::uint16_t order);
  std::int32_t position_demand();  // 6062h, or the actual position if the drive does not have 6062h
  void begin_velocity(const MotionProfile& profile);
  // Waits until a halt or a quick stop has ended. Returns false if a halt took longer than `longest`.
  bool wait_for_standstill(std::optional<Time> longest = {});
  std::int64_t rest_distance();    // position units
  std::int64_t rest_increments();  // the same distance in increments of the encoder
  // Must be called at each poll of a motion. Returns true if neither the position nor the encoder increments (6063h)
  // have changed for 0.5 s.
  bool stands();
  bool has_crept();  // true if 6063h has changed since the last call that returned true
  // True if the drive reports target reached, and the axis rests near the goal. Throws if it stands elsewhere, or comes
  // no nearer.
  bool has_arrived(std::uint16_t statusword, const std::string& doing);
  // Within the tolerance: true if the position has hardly changed for 10 ms, or stays within the tolerance for 0.5 s.
  bool has_settled(std::int32_t at);
  std::int64_t tolerance();  // around the goal; within it the axis has arrived
  // True if the goal is outside the position range 607Bh of an axis that wraps around.
  bool is_outside_range(std::int64_t goal);
  // True if the limit switch in the direction of motion is active (60FDh); false if the axis has no direction.
  bool at_limit();
  // Throws if at_limit().
  void leave_if_at_limit(const std::string& doing);
  // For the end of a motion of a given duration: calls leave_if_at_limit() if the position has not changed since the
  // last call of stands().
  void leave_if_rests_at_limit(const std::string& doing);
  // Polls a motion until `done` returns true; throws if the drive leaves operation enabled or `timeout` elapses.
  void follow(Time timeout, const Progress& progress, const std::string& doing,
              const std::function<bool(std::uint16_t statusword)>& done);
  [[noreturn]] void fail(const std::string& happened, const std::string& remedy);

  AxisOptions options_;
  ObjectClient& objects_;
  std::uint16_t controlword_ = 0;
  std::optional<std::int8_t> mode_{};   // of the last motion
  std::optional<std::int32_t> goal_{};  // target of the last move
  std::string order_{};                 // the last move, as text for messages
  int direction_ = 0;                   // -1, 0, +1: of the last motion command; 0: none
  std::optional<std::int64_t> rest_distance_{};
  std::optional<std::int64_t> rest_increments_{};
  bool halted_ = false;           // halted by halt()
  bool must_send_again_ = false;  // resume() sends the target of the move again
  bool became_quick_stop_ = false;
  bool comes_to_rest_ = false;                // true: AxisOptions::cancelled is ignored
  Time ordered_{};                            // time of the last motion command
  std::optional<std::int32_t> place_{};       // position since `stands_since_`, for stands()
  std::optional<std::int32_t> increments_{};  // 6063h while the position does not change
  Time stands_since_{};
  Time next_look_{};
  std::optional<std::int64_t> closest_{};  // least distance to the goal while the drive shows it as reached
  Time closest_at_{};
  std::optional<std::int32_t> arrived_{};  // position since `arrived_at_`, near the goal
  Time arrived_at_{};
  Time near_since_{};
  Time crept_at_{};                     // has_crept() was true
  std::optional<std::int64_t> near_{};  // for tolerance()
  bool has_position_ = true;
  bool has_increments_ = true;  // 6063h
  bool has_mode_display_ = true;
  bool has_velocity_ = true;
  bool has_torque_ = true;
};

}  // namespace servodrome::master
