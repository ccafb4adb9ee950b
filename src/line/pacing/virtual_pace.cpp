#include "line/pacing/virtual_pace.hpp"

#include <algorithm>

namespace servodrome::line {
namespace {

using namespace std::chrono_literals;

constexpr auto step_period = 5ms;      // interval between two steps
constexpr Time longest_pause = 100ms;  // most real time that one step catches up with
constexpr auto longest_step = 20ms;    // most real time that one step may take
constexpr Time stride = 10ms;          // of line time, between two checks of longest_step

}  // namespace

void VirtualPace::follow() {
  if (line_.speed() == speed_) return;
  speed_ = line_.speed();
  advanced_at_ = std::chrono::steady_clock::now();
  if (speed_ > 0) {
    let_time_pass();
  } else {
    timer_.cancel();
  }
}

void VirtualPace::let_time_pass() {
  timer_.expires_after(step_period);
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;
    const auto began = std::chrono::steady_clock::now();
    const auto passed = std::min<Time>(began - advanced_at_, longest_pause);
    const Time target = line_.now() + std::chrono::duration_cast<Time>(passed * speed_);
    // Time that the processor cannot simulate within longest_step is dropped, to leave time for requests.
    while (line_.now() < target && std::chrono::steady_clock::now() - began < longest_step) {
      line_.run_until(std::min(target, line_.now() + stride));
    }
    advanced_at_ = began;
    logs_.flush();
    let_time_pass();
  });
}

}  // namespace servodrome::line
