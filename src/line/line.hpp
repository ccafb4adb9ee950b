#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "line/axis.hpp"
#include "line/config.hpp"
#include "line/coupled_axes.hpp"
#include "links/can/bus.hpp"
#include "links/can/client.hpp"
#include "links/can/link.hpp"
#include "links/ethercat/link.hpp"
#include "links/serial/link.hpp"

namespace servodrome::line {

// A CAN bus of the line and its name.
struct NamedBus {
  BusSettings settings;
  links::CanBus bus;
  std::vector<std::unique_ptr<links::CanLink>> links;  // opened by a LineServer; must be destroyed before the bus

  explicit NamedBus(const BusSettings& its_settings);
};

// An RS485 line of the simulated line and its name.
struct NamedSerialBus {
  SerialBusSettings settings;
  links::SerialLine line;
  std::vector<std::unique_ptr<links::SerialLink>> links;  // opened by a LineServer; must be destroyed before the line

  explicit NamedSerialBus(const SerialBusSettings& its_settings) : settings(its_settings), line(its_settings.format) {}
};

// An EtherCAT segment of the line and its name.
struct NamedEthercatBus {
  EthercatBusSettings settings;
  links::EthercatBus bus;
  std::vector<std::unique_ptr<links::EthercatLink>> links;  // opened by a LineServer; must be destroyed before the bus

  explicit NamedEthercatBus(const EthercatBusSettings& its_settings) : settings(its_settings) {}
};

// An observer of a line's time: the line calls it when its time reaches the follower's deadline.
class Follower {
 public:
  // The next time at which reached() must be called; links::never: it must not.
  virtual Time next_deadline() const = 0;
  // The line has reached the deadline: all events up to and including `now` have happened. Must not advance the line's
  // time. The next deadline must be later than `now`.
  virtual void reached(Time now) = 0;

 protected:
  ~Follower() = default;
};

// Simulates axes and buses in order of time. A line has no clock: its time advances only when run_until is called, by
// any caller in virtual time, by a LineServer in real time. The result depends only on the settings and on the calls
// that change the line, not on how many calls of run_until the time is divided into. Nothing is allocated while it
// runs.
class Line final : public links::VirtualClock {
 public:
  // `settings` must come from parse_line_file without diagnostics. Throws std::runtime_error when a store file cannot
  // be used.
  explicit Line(const LineSettings& settings);

  // Runs all events up to and including `target` in order of time. An axis catches up to a frame's arrival before it
  // receives the frame. If `target` is in the past, nothing happens.
  void run_until(Time target) override;

  // Lazy evaluation of run_until(target), for a frame that passes an EtherCAT segment at `target`. The line runs only
  // if something that shows on a bus may have happened by then. Otherwise it defers the simulation and now() does not
  // advance. The reason: many ticks in a row cost less than single ticks, because each time the drives' memory must be
  // fetched into the caches again. The line notices every change that a frame causes (EthercatBus::next_event). After
  // any other action on the line, the caller must call changed() first.
  void keep_up(Time target) {
    if (target < quiet_until_ && target < next_segment_event()) return;
    run_until(target);
    quiet_until_ = next_appearance();
    for (const auto& bus : ethercat_buses_) bus->bus.forget_events();
  }
  // Invalidates what keep_up knows: the next call runs the line.
  void changed() { quiet_until_ = Time::min(); }

  Time now() const override { return now_; }
  // Adds a follower, which is called from now on. Must not be called from within Follower::reached. A follower does not
  // influence what the line does.
  void add_follower(Follower& follower) { followers_.push_back(&follower); }
  void remove_follower(Follower& follower) { std::erase(followers_, &follower); }

  // Advances to the next instant at which anything may happen on a bus, by at most 1 ms and not beyond `latest`.
  void step(Time latest = links::never) override;
  // The time of the next event that is already known on a CAN bus or an RS485 line; links::never: none.
  Time next_bus_event() const;

  const std::vector<std::unique_ptr<Axis>>& axes() const { return axes_; }
  const std::vector<std::unique_ptr<NamedBus>>& buses() const { return buses_; }
  const std::vector<std::unique_ptr<NamedSerialBus>>& serial_buses() const { return serial_buses_; }
  const std::vector<std::unique_ptr<NamedEthercatBus>>& ethercat_buses() const { return ethercat_buses_; }
  // They return nullptr if the name does not exist.
  Axis* find_axis(std::string_view name) const;
  NamedBus* find_bus(std::string_view name) const;
  NamedSerialBus* find_serial_bus(std::string_view name) const;
  NamedEthercatBus* find_ethercat_bus(std::string_view name) const;
  // The registers of the drive with this Modbus unit identifier on the RS485 line. Returns nullptr if no drive that has
  // power and speaks Modbus has it. A drive that is alone on its line answers to 0 and 255 too (modbus::Units).
  modbus::Server* find_unit(const NamedSerialBus& bus, std::uint8_t unit) const;
  ClockMode clock_mode() const { return clock_mode_; }

  // The speed at which virtual time advances without requests, as a factor of real time, 0 .. most_speed. A LineServer
  // advances the time.
  static constexpr double most_speed = 1000;
  double speed() const { return speed_; }
  void set_speed(double speed) { speed_ = speed; }

  // Real time by which the line was late or that it dropped, because the machine could not keep pace.
  struct Lag {
    Time total{};
    std::uint64_t count = 0;
  };
  const Lag& lag() const { return lag_; }
  void add_lag(Time given_up) {
    lag_.total += given_up;
    ++lag_.count;
  }

 private:
  static constexpr Time most_behind = std::chrono::milliseconds(1);

  Time next_instant(Time latest) const;
  Time next_appearance() const;
  Time next_segment_event() const {
    Time next = links::never;
    for (const auto& bus : ethercat_buses_) next = std::min(next, bus->bus.next_event());
    return next;
  }
  void run_to_instant(Time instant);

  ClockMode clock_mode_;
  std::vector<std::unique_ptr<NamedBus>> buses_;
  std::vector<std::unique_ptr<NamedSerialBus>> serial_buses_;
  std::vector<std::unique_ptr<NamedEthercatBus>> ethercat_buses_;
  std::vector<std::unique_ptr<Axis>> axes_;
  std::vector<std::unique_ptr<CoupledAxes>> couplings_;
  std::vector<const Axis*> senders_;  // axes that are not on EtherCAT, see Axis::sends
  std::vector<Follower*> followers_;
  std::int64_t tick_ = 0;  // the tick up to which all axes have run
  Time now_{};
  Time quiet_until_ = Time::min();  // before it, only frames change anything on a bus; min: unknown
  Lag lag_;
  double speed_ = 0;
};

}  // namespace servodrome::line
