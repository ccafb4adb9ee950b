#pragma once

#include <chrono>
#include <optional>

#include "line/bus_logs.hpp"
#include "line/line.hpp"
#include "line/pacing/real_pace.hpp"

namespace servodrome::line {

// The clock of a line that a server runs. Without begin() the line has virtual time, which only requests and
// VirtualPace advance. From begin() on the line has real time: its time follows CLOCK_MONOTONIC, and time that the line
// cannot catch up with is dropped and counted as lag.
class LineClock {
 public:
  using Moment = RealPace::Moment;

  // `logs` are flushed as time passes. Both must outlive this object.
  LineClock(Line& line, BusLogs& logs) : line_(line), logs_(logs) {}

  // Starts real time.
  void begin(Moment present) {
    real_pace_.begin(present, line_.now());
    real_ = true;
  }
  bool is_real() const { return real_; }

  // The time that the line should have now.
  Time now() { return real_ ? due(std::chrono::steady_clock::now()) : line_.now(); }
  // Runs the line up to the present. Returns its time.
  Time catch_up();
  // The arrival time of an EtherCAT frame that was just read. The line has caught up with it.
  Time frame_time();
  // Runs the line up to `present` if anything shows on a bus by then.
  void keep_up(Moment present);
  // The moment at which the line should be at `time`.
  Moment moment_of(Time time) const { return real_pace_.moment_of(time); }

  // Lazy evaluation: frame_time() runs the line by Line::keep_up instead of Line::run_until. The caller promises that
  // between two frames nothing but frames acts on the line, unless it calls others_acted() before the next frame.
  void set_lazy(bool lazy) { lazy_ = lazy; }
  void others_acted() { line_.changed(); }
  // Sets the moment that frame_time() uses during a poll for frames, because the caller has just read the clock;
  // nullopt: frame_time() reads the clock itself.
  void set_polled_at(std::optional<Moment> moment) { polled_at_ = moment; }

  // How long the server sleeps on purpose, which does not count as a pause (RealPace::due).
  void set_nap(Time nap) { nap_ = nap; }
  // Counts lateness of the server as lag although the line catches up: clients of its buses had to wait.
  void note_lateness(Moment due, Moment present);

 private:
  Time due(Moment present);

  Line& line_;
  BusLogs& logs_;
  RealPace real_pace_;
  bool real_ = false;
  bool lazy_ = false;
  Time frame_at_{};  // line time of the last frame that was answered immediately
  Time nap_{};
  std::optional<Moment> polled_at_;
};

}  // namespace servodrome::line
