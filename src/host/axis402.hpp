#pragma once

#include <functional>
#include <initializer_list>

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

struct AxisOptions {
  Time state_timeout = std::chrono::seconds(2);       // for each transition, mode change and handshake
  Time poll_interval = std::chrono::milliseconds(5);  // of the statusword
  Dialect dialect{};
};

// In the drive's own units (increments unless its factors say otherwise). What is not given stays as the drive has it.
struct MotionProfile {
  std::optional<std::uint32_t> velocity{};      // 6081h
  std::optional<std::uint32_t> acceleration{};  // 6083h
  std::optional<std::uint32_t> deceleration{};  // 6084h
};

struct HomingRequest {
  std::optional<std::int8_t> method{};          // 6098h
  std::optional<std::uint32_t> switch_speed{};  // 6099h sub 1
  std::optional<std::uint32_t> zero_speed{};    // 6099h sub 2
  std::optional<std::uint32_t> acceleration{};  // 609Ah
  std::optional<std::int32_t> offset{};         // 607Ch
};

struct AxisStatus {
  std::uint16_t statusword = 0;
  std::int8_t mode = 0;       // 6061h
  std::int32_t position = 0;  // 6064h
  std::int32_t velocity = 0;  // 606Ch, 0 if the drive does not have it
  std::int16_t torque = 0;    // 6077h, 0.1 % of rated torque; 0 if the drive does not have it

  PowerState state() const { return state_of(statusword); }
};

// Drives one CiA 402 axis by its objects, as a commissioning tool does, over any bus. Every call waits until the drive
// has done it, letting the bus run; it throws HostError, which names state, statusword, 603Fh and the latest EMCY, when
// the drive does not. An access that fails throws ObjectError.
class Axis402 {
 public:
  // Called at each poll of a motion; may throw to leave it, and may call stop() before.
  using Progress = std::function<void(const AxisStatus&)>;

  // `objects` outlives this.
  explicit Axis402(ObjectClient& objects, const AxisOptions& options = {}) : options_(options), objects_(objects) {}

  std::uint16_t statusword() { return objects_.read<std::uint16_t>(0x6041); }
  PowerState state() { return state_of(statusword()); }
  std::int32_t position();  // 6064h, or 6063h of a drive that does not have it
  std::int32_t velocity() { return objects_.read<std::int32_t>(0x606C); }
  AxisStatus status();

  // Power state. All do nothing when the drive is there already.
  void reset_fault();
  void enable();  // a fault is an error: reset_fault() first
  void disable();
  void quick_stop();  // returns when the state is left or reached and the axis stands

  // Sets 6060h and waits for 6061h. Throws as well if 6502h says that the drive does not have the mode.
  void set_mode(OperationMode mode);

  // Runs the homing method; the drive is to be enabled. Returns when attained and at rest.
  void home(const HomingRequest& request, Time timeout, const Progress& progress = {});

  // Profile position; the drive is to be enabled. Returns when the target is reached. A distance counts from the last
  // target, or from where the axis stands after stop(); the stopped move is dropped.
  void move_to(std::int32_t position, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  void move_by(std::int32_t distance, const MotionProfile& profile, Time timeout, const Progress& progress = {});

  // Profile velocity; returns when the velocity is reached. Goes on running.
  void run_at(std::int32_t velocity, const MotionProfile& profile, Time timeout, const Progress& progress = {});
  // Halt (605Dh) in any mode, until at rest; homing is broken off.
  void stop();

  // By the dialect and the drive's factors. Nothing if neither says what a position unit is; `position`, where given,
  // does instead.
  std::optional<AxisUnits> units(std::optional<double> position = {});

  ObjectClient& objects() { return objects_; }
  std::uint16_t address() const { return objects_.address(); }  // node-ID, station, position
  std::optional<Emergency> latest_emergency() { return objects_.latest_emergency(); }

 private:
  void write_controlword(std::uint16_t word);
  // The quotient of subs 1 and 2.
  std::optional<double> ratio(std::uint16_t index);
  std::int8_t mode();  // 6061h, or 6060h of a drive that does not have it
  template <typename T>
  void write_if_given(std::uint16_t index, std::uint8_t sub, const std::optional<T>& value) {
    if (value) objects_.write<T>(index, sub, *value);
  }
  void write_profile(const MotionProfile& profile);
  // Polls until the drive is in one of `wanted`; a fault on the way is an error.
  void wait_for_state(std::initializer_list<PowerState> wanted, const char* doing);
  void step(std::uint16_t controlword, PowerState to, const char* doing);
  void require_enabled(const char* doing);
  bool wait_for_bits(std::uint16_t mask, std::uint16_t value, Time timeout);
  void move(std::int32_t target, bool relative, const MotionProfile& profile, Time timeout, const Progress& progress);
  // Polls a motion until `done` says so; throws if the drive leaves operation enabled or the time is up.
  void follow(Time timeout, const Progress& progress, const std::string& doing,
              const std::function<bool(std::uint16_t statusword)>& done);
  [[noreturn]] void fail(const std::string& happened, const std::string& remedy);

  AxisOptions options_;
  ObjectClient& objects_;
  std::uint16_t controlword_ = 0;
  bool has_position_ = true;
  bool has_mode_display_ = true;
  bool has_velocity_ = true;
  bool has_torque_ = true;
};

}  // namespace servodrome::host
