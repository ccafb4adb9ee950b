#include "line/pacing/waiting.hpp"

#include <algorithm>
#include <thread>
#include <utility>

#include "line/pacing/clients.hpp"

namespace servodrome::line {
namespace {

using namespace std::chrono_literals;

constexpr Time longest_sleep = 1ms;  // a frame that an axis sends by itself is late by at most this time
constexpr Time longest_nap = 10ms;   // the same, while no CAN client and no master is connected
// Intervals between two polls of Asio. They limit the delay of the API and of the links that Asio serves.
constexpr Time longest_between_turns = 1ms;
constexpr Time attentive_between_turns = 250us;  // while a client or a master is connected
constexpr Time busy_between_turns = 20us;        // beside busy links, if another EtherCAT link is not busy
constexpr unsigned busy_frames = 32;             // number of frames from busy links after which the clock is read

}  // namespace

std::unique_ptr<Waiting> make_waiting(const Served& served) {
  const auto& buses = served.line.ethercat_buses();
  const bool any_busy = std::any_of(buses.begin(), buses.end(), [](const auto& bus) {
    return std::any_of(bus->links.begin(), bus->links.end(), [](const auto& link) { return link->busy(); });
  });
  if (any_busy) return std::make_unique<BusyWaiting>(served);
  if (!served.watch.empty()) return std::make_unique<FrameWaiting>(served);
  return std::make_unique<TimerWaiting>(served);
}

// ---- TimerWaiting

void TimerWaiting::run() {
  look_again();
  served_.io.run();
}

void TimerWaiting::look_again() {
  LineClock& clock = served_.clock;
  const Line& line = served_.line;
  if (!clock.is_real()) return;
  // Axes on CAN send without a request, and a master of EtherCAT expects its cycles; without them the long interval is
  // enough.
  const Time nap = has_can_clients(line) || has_master(line) ? Time{} : longest_nap;
  clock.set_nap(nap);
  timer_.expires_at(clock.moment_of(std::min(line.next_bus_event(), line.now() + std::max(longest_sleep, nap))));
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;  // cancelled: the timer is set again
    served_.clock.note_lateness(timer_.expiry(), std::chrono::steady_clock::now());
    served_.clock.catch_up();
    look_again();
  });
}

// ---- PollingWaiting

PollingWaiting::PollingWaiting(const Served& served) : served_(served) {
  for (const auto& bus : served.line.ethercat_buses()) {
    for (const auto& link : bus->links) links_.push_back(link.get());
  }
  // The frames of these links are served here, and everything else in serve_others().
  served.clock.set_lazy(true);
}

void PollingWaiting::serve_others(Moment present) {
  if (served_.clock.is_real()) {
    served_.clock.note_lateness(turn_due_, present);
    turn_due_ = present + longest_between_turns;
    served_.clock.keep_up(present);
  }
  if (served_.io.poll() > 0) served_.clock.others_acted();
}

// ---- FrameWaiting

void FrameWaiting::run() {
  Vigil vigil;
  Time between{};  // the period of the watch's timer
  auto next_turn = std::chrono::steady_clock::now();
  while (!is_stopped()) {
    const bool is_attentive = has_clients(served_.line) || has_master(served_.line);
    const Time wanted = is_attentive ? attentive_between_turns : longest_between_turns;
    if (wanted != between) served_.watch.tick_every(between = wanted);
    const bool tick = served_.watch.wait();
    const auto present = std::chrono::steady_clock::now();
    if (!tick) vigil.served(present);
    if (tick || present >= next_turn) {
      serve_others(present);
      next_turn = present + between;
    }
    if (!vigil.worthwhile()) continue;
    stay_awake(vigil, next_turn);
    between = Time{};
  }
}

// Busy-waits while frames keep coming. It yields the processor between polls, because the master may run on the same
// one.
void FrameWaiting::stay_awake(Vigil& vigil, Moment& next_turn) {
  auto present = std::chrono::steady_clock::now();
  const auto look = [&] {
    served_.clock.set_polled_at(present);
    bool any = false;
    for (links::EthercatLink* link : links_) any = link->poll() || any;
    served_.clock.set_polled_at(std::nullopt);
    if (any) vigil.answered(present = std::chrono::steady_clock::now());
    return any;
  };
  served_.watch.tick_every(Time{});  // this loop reads the clock itself
  served_.watch.pause();             // and polls the links itself
  while (vigil.worthwhile() && !is_stopped()) {
    if (!look()) {
      std::this_thread::yield();
      const auto before = std::exchange(present, std::chrono::steady_clock::now());
      vigil.lent(present - before);
      if (!look() && vigil.over(present)) vigil.in_vain();  // serves frames that came while others had the processor
    }
    if (present < next_turn) continue;
    serve_others(present);
    for (links::EthercatLink* link : links_) link->check();
    present = std::chrono::steady_clock::now();
    next_turn = present + (has_clients(served_.line) ? attentive_between_turns : longest_between_turns);
  }
  served_.watch.resume();
}

// ---- BusyWaiting

// Runs the line in real time tick by tick, so that a frame has at most one tick to catch up with.
void BusyWaiting::run() {
  std::vector<links::EthercatLink*> busy;
  std::copy_if(links_.begin(), links_.end(), std::back_inserter(busy), [](const auto* link) { return link->busy(); });
  const bool alone = busy.size() == links_.size();
  LineClock& clock = served_.clock;
  const Line& line = served_.line;
  auto next_tick = std::chrono::steady_clock::now();
  auto next_turn = next_tick;
  unsigned frames = 0;
  while (!is_stopped()) {
    bool any = false;
    for (links::EthercatLink* link : busy) any = link->poll() || any;
    if (any && ++frames < busy_frames) continue;
    frames = 0;
    const auto present = std::chrono::steady_clock::now();
    if (present >= next_tick) {
      clock.catch_up();
      next_tick =
          clock.is_real() ? clock.moment_of((line.now() / tick_length + 1) * tick_length) : present + tick_length;
    }
    if (present < next_turn) continue;
    next_turn = present + (alone ? attentive_between_turns : busy_between_turns);
    serve_others(present);
    if (!alone) served_.watch.wait(Time{});
    for (links::EthercatLink* link : busy) link->check();
  }
}

}  // namespace servodrome::line
