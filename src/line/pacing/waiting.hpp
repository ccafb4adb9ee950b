#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "line/line.hpp"
#include "line/pacing/line_clock.hpp"
#include "line/pacing/vigil.hpp"

namespace servodrome::line {

// How the thread of a server waits: it sleeps or polls until something is due, serves that, and lets the line's time
// pass. Each kind is for different links (make_waiting).
class Waiting {
 public:
  virtual ~Waiting() = default;
  // Serves until the context is stopped.
  virtual void run() = 0;
  // Something was queued on a bus, or a client has come: the present wait may have to end earlier.
  virtual void look_again() {}
};

// What a server waits for, and what it runs meanwhile. All must outlive the Waiting.
struct Served {
  boost::asio::io_context& io;
  links::DescriptorWatch& watch;  // of `raw:` links
  Line& line;
  LineClock& clock;
};

// Chooses BusyWaiting if a link is `busy`, FrameWaiting if there are other `raw:` links, else TimerWaiting.
std::unique_ptr<Waiting> make_waiting(const Served& served);

// Asio waits for everything. In real time a timer wakes the line for the next event on a bus, and at least every 1 ms
// while a CAN client is connected or after an EtherCAT segment was used, otherwise at least every 10 ms.
class TimerWaiting final : public Waiting {
 public:
  explicit TimerWaiting(const Served& served) : served_(served), timer_(served.io) {}
  void run() override;
  void look_again() override;

 private:
  Served served_;
  boost::asio::steady_timer timer_;
};

// For links that Asio does not wait for. Asio, with everything that it serves, is polled at intervals.
class PollingWaiting : public Waiting {
 protected:
  using Moment = LineClock::Moment;

  explicit PollingWaiting(const Served& served);

  // Lets the line keep up with real time, and polls Asio once without waiting: the API, other links and timers.
  void serve_others(Moment present);
  bool is_stopped() const { return served_.io.stopped(); }

  Served served_;
  std::vector<links::EthercatLink*> links_;  // all of the line
 private:
  Moment turn_due_ = Moment::max();  // when serve_others() is due
};

// DescriptorWatch waits for the frames of `raw:` links. While a master sends each frame soon after the answer to the
// one before, the thread polls instead of sleeping (Vigil).
class FrameWaiting final : public PollingWaiting {
 public:
  explicit FrameWaiting(const Served& served) : PollingWaiting(served) {}
  void run() override;

 private:
  void stay_awake(Vigil& vigil, Moment& next_turn);
};

// Polls the `busy` links without sleeping.
class BusyWaiting final : public PollingWaiting {
 public:
  explicit BusyWaiting(const Served& served) : PollingWaiting(served) {}
  void run() override;
};

}  // namespace servodrome::line
