#include "line/pacing/line_clock.hpp"

#include <algorithm>

namespace servodrome::line {

constexpr Time most_late = std::chrono::milliseconds(5);  // lateness above this counts as lag

Time LineClock::due(Moment present) {
  const Time due = real_pace_.due(present, std::max(line_.now(), frame_at_), nap_);
  if (real_pace_.given_up() > Time{}) line_.add_lag(real_pace_.given_up());
  return due;
}

Time LineClock::catch_up() {
  if (!real_) return line_.now();
  line_.run_until(due(std::chrono::steady_clock::now()));
  logs_.flush_in_time(moment_of(line_.now()));
  return line_.now();
}

Time LineClock::frame_time() {
  if (!real_) return line_.now();
  frame_at_ = due(polled_at_ ? *polled_at_ : std::chrono::steady_clock::now());
  if (lazy_) {
    line_.keep_up(frame_at_);
  } else {
    line_.run_until(frame_at_);
  }
  return frame_at_;
}

void LineClock::keep_up(Moment present) {
  if (!real_) return;
  line_.keep_up(due(present));
  logs_.flush_in_time(moment_of(line_.now()));
}

// Lateness above RealPace::most_behind is time that due() drops and counts.
void LineClock::note_lateness(Moment due, Moment present) {
  if (const Time late = present - due; late > most_late && late <= RealPace::most_behind + nap_) line_.add_lag(late);
}

}  // namespace servodrome::line
