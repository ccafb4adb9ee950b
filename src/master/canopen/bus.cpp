#include "master/canopen/bus.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"
#include "links/link_scheme.hpp"
#include "master/error.hpp"

namespace servodrome::master {
namespace {

using namespace std::chrono_literals;

// send() waits up to this time while the controller's transmit queue is full.
constexpr Time send_patience = 1s;

[[noreturn]] void throw_bus_failure(const std::string& name, const links::LinkError& error) {
  throw MasterError("the link failed: " + error.code().message(), name,
                    "check that the program or device at its other end still runs");
}

}  // namespace

std::unique_ptr<Bus> Bus::open(std::string_view link, links::Heard heard) {
  try {
    return std::make_unique<Bus>(links::heard(links::open_can_client(link), std::move(heard)), std::string(link));
  } catch (const links::LinkError& error) {
    const bool nobody = error.code() == std::errc::connection_refused || error.code() == std::errc::no_such_device ||
                        error.code() == std::errc::no_such_file_or_directory;
    if (nobody)
      throw MasterError("no server listens there", std::string(link), "start `servodrome up` or give --bus LINK");
    if (error.code() == std::errc::invalid_argument) {
      throw MasterError(error.what(), "--bus", fmt::format("give for example {}", links::scheme::socketcand.example));
    }
    throw MasterError(error.what(), std::string(link), "check --bus LINK");
  }
}

Time Bus::now() const { return clock_ != nullptr ? clock_->now() : links::steady_now(); }

std::optional<Frame> Bus::receive(Time until) {
  const Time left = std::max(Time{0}, until - now());
  try {
    return client_->receive(left);
  } catch (const links::LinkError& error) {
    throw_bus_failure(name_, error);
  }
}

void Bus::send(const Frame& frame) {
  const Time give_up = now() + send_patience;
  for (;;) {
    try {
      client_->send(frame);
      ++sent_;
      return;
    } catch (const links::LinkError& error) {
      if (error.code() != std::errc::no_buffer_space || now() >= give_up) throw_bus_failure(name_, error);
    }
    if (const auto arrived = receive(now() + 1ms)) backlog_.push_back(*arrived);
  }
}

void Bus::send(std::uint32_t id, std::initializer_list<std::uint8_t> data) {
  Frame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  send(frame);
}

bool Bus::run_until(Time deadline, const std::function<bool()>& done) {
  for (;;) {
    run_timers();
    if (done()) return true;
    std::optional<Frame> frame;
    if (!backlog_.empty()) {
      frame = backlog_.front();
      backlog_.pop_front();
    } else {
      frame = receive(std::min(deadline, next_timer()));
    }
    if (frame) {
      dispatch(*frame);
    } else if (now() >= deadline) {
      return done();
    }
  }
}

void Bus::run_for(Time span) {
  run_until(now() + span, [] { return false; });
}

void Bus::dispatch(const Frame& frame) {
  for (auto listener = listeners_.begin(); listener != listeners_.end(); ++listener) {
    if (*listener) (*listener)(frame);
  }
}

void Bus::run_timers() {
  for (Timer& timer : timers_) {
    if (timer.due > now()) continue;
    // Periods that elapsed while the bus was not running are skipped.
    timer.due += ((now() - timer.due) / timer.period + 1) * timer.period;
    timer.action();
  }
}

Time Bus::next_timer() const {
  Time next = canopen::never;
  for (const Timer& timer : timers_) next = std::min(next, timer.due);
  return next;
}

Bus::Subscription Bus::listen(Listener listener) {
  const auto place = listeners_.insert(listeners_.end(), std::move(listener));
  return Subscription([this, place] { listeners_.erase(place); });
}

Bus::Subscription Bus::every(Time period, std::function<void()> action) {
  const auto place = timers_.insert(timers_.end(), {period, now() + period, std::move(action)});
  return Subscription([this, place] { timers_.erase(place); });
}

}  // namespace servodrome::master
