#pragma once

#include <algorithm>
#include <fmt/format.h>
#include <initializer_list>

#include "tools/conform/subject.hpp"

namespace servodrome::master::conform {

// Thrown by a check that cannot be carried out.
struct Skipped {
  std::string why;
};
// Thrown by Trial::require to end the check.
struct Ended {};

// How a drive refused an access.
struct Refusal {
  std::optional<dictionary::AbortCode> code;  // nullopt on a bus without abort codes
  std::string text;
};

// Node-ID of the heartbeats that checks send and stop. It is none of the node-IDs of MasterWatch, because other
// programs may use these.
inline constexpr std::uint32_t heartbeat_producer = MasterWatch::lowest_node_id - 1;

// A running check: gives access to the subject, and records what was sent, expected and seen.
class Trial {
 public:
  Trial(Subject& subject, Outcome& outcome) : subject_(subject), outcome_(outcome) {}

  Subject& subject() { return subject_; }
  KeptObjects& objects() { return subject_.objects(); }
  const SubjectSettings& settings() const { return subject_.settings(); }
  Time now() { return objects().now(); }
  // Ends the check if the axis leaves the permitted way.
  void wait(Time span);

  // Records an observation. Returns `met`.
  bool expect(bool met, std::string sent, std::string expected, std::string seen);
  // Records an observation, and ends the check if it is not met.
  void require(bool met, std::string sent, std::string expected, std::string seen);
  [[noreturn]] static void skip(std::string why) { throw Skipped{std::move(why)}; }

  // ---- Objects ----

  // Returns the refusal; nullopt if the drive accepted the access. A missing answer throws.
  template <typename Access>
  static std::optional<Refusal> refusal_of(const Access& access) {
    try {
      access();
    } catch (const ObjectError& error) {
      return refusal_in(error);
    }
    return std::nullopt;
  }
  // Expects that `access` is refused: on a bus with abort codes with one of `codes`, on other buses in any way.
  void expect_refused(const std::string& sent, std::initializer_list<dictionary::AbortCode> codes,
                      const std::function<void()>& access);
  // Expects that the drive accepts `access`.
  bool expect_taken(const std::string& sent, const std::function<void()>& access);

  // ---- Power ----

  std::uint16_t statusword() { return objects().read<std::uint16_t>(0x6041); }
  PowerState state() { return state_of(statusword()); }
  // Before a word that enables the axis, leaves a torque mode that the check has not chosen, and takes back the targets
  // that would move the axis at once. Throws MasterError if the drive keeps one of them.
  void control(std::uint16_t word);
  // Polls until the statusword's `mask` bits equal `value`; false after `patience` (default: settings().patience). For
  // a state the default is Subject::patience_of_power().
  bool wait_for(std::uint16_t mask, std::uint16_t value, std::optional<Time> patience = {});
  bool wait_for(PowerState state, std::optional<Time> patience = {});
  // True if the drive is in `state` at every poll for the whole `span`.
  bool stays(PowerState state, Time span = std::chrono::milliseconds(60));
  // Brings the drive to `state` by valid transitions. Ends the check if a transition fails.
  void bring_to(PowerState state);
  // Like bring_to(operation_enabled), in this mode.
  void enable(OperationMode mode);

  // ---- Motion ----

  // Skips the check if the drive does not have the mode: by 6502h or, without 6502h, if it refuses 6060h.
  void set_mode(OperationMode mode);
  bool has_mode(OperationMode mode);
  // One revolution, one revolution/s and one revolution/s2 in the drive's units; skips the check if a revolution is
  // unknown.
  AxisUnits units();
  // Distance of the motion that the user permits, in position units.
  std::int32_t distance() { return whole(units().position * settings().revolutions); }
  // Timeout of a motion: the patience, and twice the time for twice that distance at half a revolution per second.
  Time patience_of_way() const;
  // The permitted way begins at this position, and goes as far as distance() and a small tolerance in both directions.
  // control() calls it when it enables the axis, except in homing mode, which changes the position value.
  void begin_way(std::int32_t position);
  // Call it often, so that it sees each turn of a position that wraps around. Ends the check if the axis is beyond the
  // permitted way; settle() then stops the axis.
  void require_on_way(std::int32_t position);
  // `revolutions_per_second`, or less if --revolutions is small: the permitted way then takes a second.
  double slow_enough(double revolutions_per_second) const {
    return std::min(revolutions_per_second, settings().revolutions);
  }
  // The shorter way from one position to another. The first call reads 607Bh.
  double way(std::int64_t from, std::int64_t to) { return range().way(from, to); }
  // Skips a check that compares positions or gives absolute targets if the position wraps around on the permitted way.
  void require_no_wrap(std::int32_t position);
  std::int32_t position();  // 6064h, or 6063h if the drive does not have 6064h on this bus
  std::int32_t velocity() { return objects().read<std::int32_t>(0x606C); }
  // Writes 6081h: `speed_factor` revolutions per second, at most 607Fh and four times the permitted way per second.
  // Writes 6083h, 6084h and 6085h: ten revolutions per second squared.
  void gentle_profile(double speed_factor = 1.0);
  // Waits until the position does not change any more; false after the patience.
  bool wait_for_rest();
  // Causes a fault from the master: a following error, or on CAN the loss of a heartbeat. False: it could not be
  // caused.
  bool cause_fault();
  // Removes the cause of cause_fault(): waits until the axis is at rest, or sends the heartbeat again.
  void end_cause_of_fault();
  template <typename T>
  void write_if_present(std::uint16_t index, std::uint8_t sub, std::type_identity_t<T> value) {
    if (objects().template read_if_present<T>(index, sub)) objects().template write<T>(index, sub, value);
  }
  static std::int32_t whole(double value) { return static_cast<std::int32_t>(value < 0 ? value - 0.5 : value + 0.5); }

 private:
  static Refusal refusal_in(const ObjectError& error);
  void step(PowerState from, std::uint16_t word, PowerState to);
  const PositionRange& range();
  bool cause_following_error();
  bool lose_heartbeat();
  void send_heartbeat();

  struct Way {
    std::int32_t begin;
    double distance;
    std::int32_t last{};
    double travelled = 0.0;
  };

  Subject& subject_;
  Outcome& outcome_;
  bool has_chosen_mode_ = false;
  bool is_homing_ = false;
  bool has_lost_heartbeat_ = false;
  std::optional<Way> way_{};
  std::optional<PositionRange> range_{};
};

// For example "6040h = 000Fh (enable operation)".
std::string text_of_controlword(std::uint16_t word);
// For example "6041h = 0237h, operation enabled".
std::string text_of_state(std::uint16_t statusword);
// For example "0602 0000h (object does not exist)".
std::string text_of(dictionary::AbortCode code);
inline std::string text_of(const std::optional<Refusal>& refusal) { return refusal ? refusal->text : "taken"; }

}  // namespace servodrome::master::conform
