#pragma once

#include <fmt/format.h>
#include <initializer_list>

#include "host/conform/subject.hpp"

namespace servodrome::host::conform {

// Thrown by a check that cannot look at what it is for.
struct Skipped {
  std::string why;
};
// Thrown by Trial::require: nothing further can be looked at.
struct Ended {};

// The way a drive refused an access.
struct Refusal {
  std::optional<dictionary::AbortCode> code;  // nothing: a bus without abort codes
  std::string text;
};

// A check at work: it uses the subject, and notes what it sent, expected and saw.
class Trial {
 public:
  Trial(Subject& subject, Outcome& outcome) : subject_(subject), outcome_(outcome) {}

  Subject& subject() { return subject_; }
  KeptObjects& objects() { return subject_.objects(); }
  const SubjectSettings& settings() const { return subject_.settings(); }
  Time now() { return objects().now(); }
  void wait(Time span) { objects().wait(span); }

  // Returns `met`.
  bool expect(bool met, std::string sent, std::string expected, std::string seen);
  // Ends the check when it is not met.
  void require(bool met, std::string sent, std::string expected, std::string seen);
  [[noreturn]] static void skip(std::string why) { throw Skipped{std::move(why)}; }

  // ---- Objects ----

  // Nothing when the drive took it; a missing answer throws.
  template <typename Access>
  static std::optional<Refusal> refusal_of(const Access& access) {
    try {
      access();
    } catch (const ObjectError& error) {
      return refusal_in(error);
    }
    return std::nullopt;
  }
  // Expects that `access` is refused with one of `codes`, on a bus that has abort codes; refused at all on others.
  void expect_refused(const std::string& sent, std::initializer_list<dictionary::AbortCode> codes,
                      const std::function<void()>& access);
  // Expects that it is taken.
  bool expect_taken(const std::string& sent, const std::function<void()>& access);

  // ---- Power ----

  std::uint16_t statusword() { return objects().read<std::uint16_t>(0x6041); }
  PowerState state() { return state_of(statusword()); }
  void control(std::uint16_t word) { objects().write<std::uint16_t>(0x6040, 0, word); }
  // Polls until the statusword's `mask` bits are `value`, or the patience is over.
  bool wait_for(std::uint16_t mask, std::uint16_t value, std::optional<Time> patience = {});
  bool wait_for(PowerState state, std::optional<Time> patience = {});
  // Is it still in `state` after `span`, and all the time?
  bool stays(PowerState state, Time span = std::chrono::milliseconds(60));
  // By the legal way. What does not work ends the check.
  void bring_to(PowerState state);
  // As `bring_to(operation_enabled)`, in this mode.
  void enable(OperationMode mode);

  // ---- Motion ----

  // Skips the check if the drive does not have it (6502h, 6061h).
  void set_mode(OperationMode mode);
  bool has_mode(OperationMode mode);
  // Units of a distance, a velocity and an acceleration that do no harm; skips if a revolution is not known.
  AxisUnits units();
  // Of the motion that the user allows, in position units.
  std::int32_t distance() { return whole(units().position * settings().revolutions); }
  std::int32_t position();  // 6064h, or 6063h of a drive that does not have it on this bus
  std::int32_t velocity() { return objects().read<std::int32_t>(0x606C); }
  // 6081h, 6083h, 6084h: `speed_factor` revolutions per second, ten (revolutions per second) per second.
  void gentle_profile(double speed_factor = 1.0);
  // Until 6064h does not change any more.
  bool wait_for_rest();
  // A fault that its master can cause: a following error, or the loss of a heartbeat on CAN. False: it could not be
  // caused.
  bool cause_fault();
  template <typename T>
  void write_if_present(std::uint16_t index, std::uint8_t sub, std::type_identity_t<T> value) {
    if (objects().template read_if_present<T>(index, sub)) objects().template write<T>(index, sub, value);
  }
  static std::int32_t whole(double value) { return static_cast<std::int32_t>(value < 0 ? value - 0.5 : value + 0.5); }

 private:
  static Refusal refusal_in(const ObjectError& error);
  void step(PowerState from, std::uint16_t word, PowerState to);
  bool cause_following_error();
  bool lose_heartbeat();

  Subject& subject_;
  Outcome& outcome_;
};

// "6040h = 000Fh (enable operation)"
std::string text_of_controlword(std::uint16_t word);
// "6041h = 0237h operation enabled"
std::string text_of_state(std::uint16_t statusword);
// "0602 0000h"
std::string text_of(dictionary::AbortCode code);
inline std::string text_of(const std::optional<Refusal>& refusal) { return refusal ? refusal->text : "taken"; }

}  // namespace servodrome::host::conform
