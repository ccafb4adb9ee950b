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

namespace servodrome::host {

using canopen::Frame;
using canopen::Time;

// The master's connection to a CAN bus, shared by everything that listens and sends there. One thread: frames arrive,
// and timers run, only inside run_until(), run_for() and drain(); listeners and timers may send, but neither wait nor
// end a subscription.
//
// Time is that of the monotonic wall clock, or of the line if it is in the same process and in virtual time.
class Bus {
 public:
  using Listener = std::function<void(const Frame&)>;

  // `name` stands in error messages. `clock`: the line's, for a line in virtual time.
  Bus(std::unique_ptr<links::CanClient> client, std::string name, links::VirtualClock* clock = nullptr)
      : client_(std::move(client)), name_(std::move(name)), clock_(clock) {}
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Opens `socketcand:HOST:PORT/BUS`, `slcan:PATH` or `socketcan:INTERFACE`. Throws HostError.
  static std::unique_ptr<Bus> open(std::string_view link, links::Heard heard = {});

  const std::string& name() const { return name_; }
  Time now() const;

  // Throws HostError if the link is lost, or takes nothing for a second.
  void send(const Frame& frame);
  void send(std::uint32_t id, std::initializer_list<std::uint8_t> data);

  // Lets frames arrive until `done` (asked after each) is true, or `deadline` has passed (false). What has arrived by
  // the deadline is still handed on.
  bool run_until(Time deadline, const std::function<bool()>& done);
  void run_for(Time span);
  // Hands on what has already arrived.
  void drain() { run_for(Time{0}); }

  // As long as it lives, a listener is called for each frame, or a timer every period.
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
  // First one `period` from now, then on that grid.
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
  std::list<Listener> listeners_;
  std::list<Timer> timers_;
  std::deque<Frame> backlog_;  // arrived while the link took nothing to send
};

}  // namespace servodrome::host
