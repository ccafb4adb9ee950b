#pragma once

#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "canopen/time.hpp"
#include "links/heard_clients.hpp"

namespace servodrome::master {

using canopen::Frame;
using canopen::Time;

// The master's connection to a CAN bus, shared by all its listeners and senders. Single thread: frames are delivered
// and timers run only inside run_until(), run_for() and drain(). Listeners and timers may send, but must not wait or
// end a subscription.
//
// Time is the monotonic wall clock, or the line's clock if the line runs in the same process in virtual time.
class Bus {
 public:
  using Listener = std::function<void(const Frame&)>;

  // `name` appears in error messages. `clock`: the clock of a line in virtual time; nullptr otherwise.
  Bus(std::unique_ptr<links::CanClient> client, std::string name, links::VirtualClock* clock = nullptr)
      : client_(std::move(client)), name_(std::move(name)), clock_(clock) {}
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Opens `socketcand:HOST:PORT/BUS`, `slcan:PATH` or `socketcan:INTERFACE`. Throws MasterError.
  static std::unique_ptr<Bus> open(std::string_view link, links::Heard heard = {});

  const std::string& name() const { return name_; }
  Time now() const;

  // Throws MasterError if the link is lost, or accepts no frame for one second.
  void send(const Frame& frame);
  void send(std::uint32_t id, std::initializer_list<std::uint8_t> data);
  // Number of frames sent so far.
  std::uint64_t sent() const { return sent_; }

  // Delivers frames and calls `done` after each one. Returns true when `done` returns true, and false at `deadline`.
  // Frames that have arrived by the deadline are delivered before it returns.
  bool run_until(Time deadline, const std::function<bool()>& done);
  void run_for(Time span);
  // Delivers the frames that have already arrived.
  void drain() { run_for(Time{0}); }

  // While this object exists, the bus calls its listener for each frame, or its timer every period.
  class Subscription {
   public:
    Subscription() = default;
    ~Subscription() { reset(); }
    Subscription(Subscription&& other) noexcept { std::swap(cancel_, other.cancel_); }
    Subscription& operator=(Subscription&& other) noexcept {
      std::swap(cancel_, other.cancel_);
      return *this;
    }
    void reset() {
      if (cancel_) std::exchange(cancel_, nullptr)();
    }

   private:
    friend class Bus;
    explicit Subscription(std::function<void()> cancel) : cancel_(std::move(cancel)) {}
    std::function<void()> cancel_;
  };
  [[nodiscard]] Subscription listen(Listener listener);
  // The first call is one `period` from now, the later ones at multiples of `period`. A late call does not shift the
  // calls after it.
  [[nodiscard]] Subscription every(Time period, std::function<void()> action);

 private:
  struct Timer {
    Time period;
    Time due;
    std::function<void()> action;
  };

  std::optional<Frame> receive(Time until);
  void dispatch(const Frame& frame);
  void run_timers();
  Time next_timer() const;

  std::unique_ptr<links::CanClient> client_;
  std::string name_;
  links::VirtualClock* clock_;
  std::uint64_t sent_ = 0;
  std::list<Listener> listeners_;
  std::list<Timer> timers_;
  std::deque<Frame> backlog_;  // frames that arrived while send() waited for room
};

}  // namespace servodrome::master
