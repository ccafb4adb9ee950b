#pragma once

#include <functional>
#include <initializer_list>
#include <utility>

#include "drive/power/power_state.hpp"
#include "host/dialect.hpp"
#include "host/object_client.hpp"

namespace servodrome::host {

using drive::PowerState;

// The state a statusword shows (CiA 402-2 table 27).
PowerState state_of(std::uint16_t statusword);
// "0237h (ready to switch on, switched on, ...)": the bits that are set, by name; bits 12 and 13 as numbers, since
// their meaning is the mode's.
std::string text_of_statusword(std::uint16_t statusword);

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
// "profile position" and so on; "manufacturer's mode" for negative numbers.
const char* name(OperationMode mode);

// A call was given up because AxisOptions::cancelled said so; the axis stands.
class Cancelled : public HostError {
 public:
  using HostError::HostError;
};

struct AxisOptions {
  Time state_timeout = std::chrono::seconds(2);       // for each transition, mode change and handshake
  Time poll_interval = std::chrono::milliseconds(5);  // of the statusword
  Dialect dialect{};
  // A halt by stop() that has not brought the axis to rest after so long becomes a quick stop; nothing: it may last as
  // long as the axis gets slower.
  std::optional<Time> longest_halt{};
  // Asked at each poll of every wait, except those of stop(), disable() and quick_stop(), which bring the axis to rest:
  // true ends the wait. What moves is halted first, and the call throws Cancelled.
  std::function<bool()> cancelled{};
};

// In the drive's own units (increments unless its factors say otherwise). What is not given stays as the drive has it.
struct MotionProfile {
  std::optional<std::uint32_t> velocity{};      // 6081h
  std::optional<std::uint32_t> acceleration{};  // 6083h
  std::optional<std::uint32_t> deceleration{};  // 6084h
};

// In 0.1 % of the rated torque.
struct TorqueProfile {
  std::optional<std::uint32_t> slope{};  // 6087h, per second
};

struct HomingRequest {
  std::optional<std::int8_t> method{};          // 6098h
  std::optional<std::uint32_t> switch_speed{};  // 6099h sub 1
  std::optional<std::uint32_t> zero_speed{};    // 6099h sub 2
  std::optional<std::uint32_t> acceleration{};  // 609Ah
  std::optional<std::int32_t> offset{};         // 607Ch
};

// What holds the axis back, in the drive's units. Nothing: the drive does not have it; to set_limits(): as it is.
struct AxisLimits {
  std::optional<std::int32_t> lowest_position{};            // 607Dh
  std::optional<std::int32_t> highest_position{};           // 607Dh; both 0 with most drives: no limits
  std::optional<std::uint32_t> profile_velocity{};          // 607Fh
  std::optional<std::uint32_t> motor_speed_rpm{};           // 6080h
  std::optional<std::uint32_t> acceleration{};              // 60C5h
  std::optional<std::uint32_t> deceleration{};              // 60C6h
  std::optional<std::uint16_t> torque_permille{};           // 6072h
  std::optional<std::uint16_t> positive_torque_permille{};  // 60E0h
  std::optional<std::uint16_t> negative_torque_permille{};  // 60E1h
};

// A touch probe (60B8h): keeps the position at an edge of its input or of the encoder's index.
struct ProbeRequest {
  enum class Source : std::uint8_t { input, index };
  std::uint8_t probe = 1;  // 1 or 2
  Source source = Source::input;
  bool positive_edge = true;
  bool negative_edge = false;
  bool continuous = false;  // each edge replaces the last one's position; else the first one's stays
};
// Nothing: no such edge yet.
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

// Drives one CiA 402 axis by its objects, as a commissioning tool does, over any bus. Every call waits until the drive
// has done it, letting the bus run; it throws HostError, which names state, statusword, 603Fh with its cause and remedy
// and the latest EMCY, when the drive does not. An access that fails throws ObjectError.
class Axis402 {
 public:
  // Called at each poll of a motion; may halt() and resume() it, change its velocity, or throw to leave it, and may
  // call stop() before.
  using Progress = std::function<void(const AxisStatus&)>;
  // The velocity wanted now; nothing: stop, that is all.
  using JogDemand = std::function<std::optional<std::int32_t>(const AxisStatus&)>;

  // `objects` outlives this.
  explicit Axis402(ObjectClient& objects, const AxisOptions& options = {}) : options_(options), objects_(objects) {}

  std::uint16_t statusword() { return objects_.read<std::uint16_t>(0x6041); }
  PowerState state() { return state_of(statusword()); }
  std::int32_t position();  // 6064h, or 6063h of a drive that does not have it
  std::int32_t velocity() { return objects_.read<std::int32_t>(0x606C); }
  AxisStatus status();

  // Power state. All do nothing when the drive is there already.
  void reset_fault();
  // Moves nothing: targets that would act at once (60FFh, 6042h, 6071h, 607Ah, by mode) are made 0 or the present
  // position first. Throws if one cannot be, with the axis not enabled. A fault is an error: reset_fault() first.
  void enable();
  void disable();
  void quick_stop();  // returns when the state is left or reached and the axis stands; leaves no target behind
  // Velocity and torque 0 in every object that has one, as far as the drive takes it.
  void take_back_targets();

  // Sets 6060h and waits for 6061h. Throws as well if 6502h says that the drive does not have the mode.
  void set_mode(OperationMode mode);

  // Runs the homing method; the drive is to be enabled. Returns when attained and at rest.
  void home(const HomingRequest& request, Time timeout, const Progress& progress = {});

  // Profile position; the drive is to be enabled. Returns when the target is reached. A distance counts from the last
  // target, or from where the axis stands after stop(); the stopped move is dropped. Without a velocity the drive's own
  // counts; it is an error if that is 0.
  void move_to(std::int32_t position, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  void move_by(std::int32_t distance, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  // The same in two halves: the first returns when the drive has taken the order, the second when it is carried out.
  void start_move_to(std::int32_t position, const MotionProfile& profile);
  void start_move_by(std::int32_t distance, const MotionProfile& profile);
  void wait_for_target(Time timeout, const Progress& progress = {});

  // Profile velocity; returns when the velocity is reached. Goes on running.
  void run_at(std::int32_t velocity, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  // Lets what goes on go on for so long; throws if the drive leaves operation enabled meanwhile.
  void hold_for(Time span, const Progress& progress = {});
  // Of the motion under way: the velocity it runs at, or 6081h of a move.
  void change_velocity(std::int32_t velocity);
  // Profile velocity, at what `demand` answers at each poll, until it answers nothing or throws; then stop(). Whatever
  // leaves this function, the axis was told to stop.
  void jog(const MotionProfile& profile, const JogDemand& demand);
  // Profile torque, in 0.1 % of the rated one; returns when it is reached. Goes on, however fast the axis gets: set
  // limits first.
  void run_torque(std::int16_t torque_permille, const TorqueProfile& profile, Time timeout,
                  const Progress& progress = {});

  // Halt (605Dh) until at rest; homing is broken off, a move dropped. In profile torque by a velocity of 0, which is
  // then the mode: a halt would let the axis coast. What lasts longer than AxisOptions::longest_halt ends in a quick
  // stop.
  void stop();
  // One of the stops so far has.
  bool became_quick_stop() const { return became_quick_stop_; }
  // The same after an error, which is told in any case: "", or why the axis could not be stopped.
  std::string try_to_stop();
  // After an error, which is told in any case: at rest, by a quick stop if need be, and the motor off, as far as the
  // drive can be reached.
  void try_to_switch_off();
  // As stop(), but resume() lets the motion go on; nothing else but disable() and stop() is to come between. Not in
  // profile torque.
  void halt();
  void resume();
  bool halted() const { return halted_; }

  AxisLimits limits();
  // Those that are given. If the drive refuses one, those before it are put back.
  void set_limits(const AxisLimits& limits);

  // Forgets what the probe has seen, and lets it wait for the next edges.
  void arm_probe(const ProbeRequest& request);
  void disarm_probe(std::uint8_t probe);
  ProbePositions probe_positions(std::uint8_t probe);
  // Returns when every edge of the request has come.
  ProbePositions wait_for_probe(const ProbeRequest& request, Time timeout, const Progress& progress = {});

  // By the dialect and the drive's factors. Nothing if neither says what a position unit is; `position`, where given,
  // does instead.
  std::optional<AxisUnits> units(std::optional<double> position = {});
  // An increment of the encoder, one per second, and one per second squared. Nothing: there are factors, but no 608Fh.
  std::optional<AxisUnits> units_per_count();

  ObjectClient& objects() { return objects_; }
  const Dialect& dialect() const { return options_.dialect; }
  std::uint16_t address() const { return objects_.address(); }  // node-ID, station, position
  std::optional<Emergency> latest_emergency() { return objects_.latest_emergency(); }

 private:
  // As long as one lives, nothing is cancelled.
  class ComingToRest {
   public:
    explicit ComingToRest(bool& flag) : flag_(flag), before_(std::exchange(flag, true)) {}
    ~ComingToRest() { flag_ = before_; }
    ComingToRest(const ComingToRest&) = delete;
    ComingToRest& operator=(const ComingToRest&) = delete;

   private:
    bool& flag_;
    bool before_;
  };

  void write_controlword(std::uint16_t word);
  // 0 or the present position into a target; why not, if it does not stay.
  std::optional<std::string> take_back(std::uint16_t index, bool to_present_position);
  void take_back_targets_before_enabling();
  // The shaft stands still, by its position, before so much time has passed.
  bool rests_within(Time span);
  // Of the encoder. Nothing: the drive does not tell.
  std::optional<double> counts_per_revolution();
  // The quotient of subs 1 and 2.
  std::optional<double> ratio(std::uint16_t index);
  std::int8_t mode();  // 6061h, or 6060h of a drive that does not have it
  template <typename T>
  void write_if_given(std::uint16_t index, std::uint8_t sub, const std::optional<T>& value) {
    if (value) objects_.write<T>(index, sub, *value);
  }
  void write_profile(const MotionProfile& profile);
  // As wide as the object is: products differ.
  void write_number(ObjectAddress object, std::int64_t value);
  // Polls until the drive is in one of `wanted`; a fault on the way is an error.
  void wait_for_state(std::initializer_list<PowerState> wanted, const char* doing);
  void step(std::uint16_t controlword, PowerState to, const char* doing);
  void require_enabled(const char* doing);
  bool wait_for_bits(std::uint16_t mask, std::uint16_t value, Time timeout);
  // Between two polls. Throws Cancelled.
  void pause();
  void leave_if_cancelled(const std::string& doing);
  void start_move(std::int32_t target, bool relative, const MotionProfile& profile);
  // The handshake of a set-point (CiA 402-2 figure 15).
  void hand_over(std::int32_t target, std::uint16_t order);
  std::int32_t position_demand();  // 6062h, or the position of a drive that does not have it
  void begin_velocity(const MotionProfile& profile);
  // False: it took longer.
  bool wait_for_standstill(std::optional<Time> longest = {});
  // Polls a motion until `done` says so; throws if the drive leaves operation enabled or the time is up.
  // Polls of a motion: has the axis stood for a while?
  bool stands();
  // The drive says so, and the axis is there. Throws if it stands elsewhere.
  bool has_arrived(std::uint16_t statusword, const std::string& doing);
  bool is_near(std::int32_t goal);
  // Throws if the switch in the way is active (60FDh).
  void leave_if_at_limit(bool forward, const std::string& doing);
  void follow(Time timeout, const Progress& progress, const std::string& doing,
              const std::function<bool(std::uint16_t statusword)>& done);
  [[noreturn]] void fail(const std::string& happened, const std::string& remedy);

  AxisOptions options_;
  ObjectClient& objects_;
  std::uint16_t controlword_ = 0;
  std::optional<std::int32_t> goal_{};  // of the last move
  std::string order_{};                 // the last move in words
  bool halted_ = false;                 // by halt()
  bool became_quick_stop_ = false;
  bool comes_to_rest_ = false;           // nothing is cancelled
  Time ordered_{};                       // when the drive was last told to move
  std::optional<std::int32_t> place_{};  // where the axis has been since `stands_since_`, for stands()
  Time stands_since_{};
  Time next_look_{};
  std::optional<std::int64_t> near_{};  // within which the axis is at its goal
  bool has_position_ = true;
  bool has_mode_display_ = true;
  bool has_velocity_ = true;
  bool has_torque_ = true;
};

}  // namespace servodrome::host
