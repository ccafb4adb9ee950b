#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "line/axis.hpp"
#include "line/config.hpp"
#include "links/can/bus.hpp"
#include "links/can/client.hpp"
#include "links/can/link.hpp"
#include "links/ethercat/link.hpp"
#include "links/serial/link.hpp"

namespace servodrome::line {

// A bus of the line and its name.
struct NamedBus {
  BusSettings settings;
  links::CanBus bus;
  std::vector<std::unique_ptr<links::CanLink>> links;  // what a LineServer opened; gone before the bus

  explicit NamedBus(const BusSettings& its_settings);
};

// An RS485 line of the line and its name.
struct NamedSerialBus {
  SerialBusSettings settings;
  links::SerialLine line;
  std::vector<std::unique_ptr<links::SerialLink>> links;  // what a LineServer opened; gone before the line

  explicit NamedSerialBus(const SerialBusSettings& its_settings) : settings(its_settings), line(its_settings.format) {}
};

// An EtherCAT segment of the line and its name.
struct NamedEthercatBus {
  EthercatBusSettings settings;
  links::EthercatBus bus;
  std::vector<std::unique_ptr<links::EthercatLink>> links;  // what a LineServer opened; gone before the bus

  explicit NamedEthercatBus(const EthercatBusSettings& its_settings) : settings(its_settings) {}
};

// Follows the time of a line: is called when the line has come to the follower's deadline.
class Follower {
 public:
  // The next time at which it wants to be called; links::never: not at all.
  virtual Time next_deadline() const = 0;
  // The line has come to the deadline: all that happens up to and at `now` has happened. Not to be used to let time
  // pass. The next deadline is later than `now`.
  virtual void reached(Time now) = 0;

 protected:
  ~Follower() = default;
};

// Axes and buses, and the order in which things happen to them. It has no clock: time passes when run_until is called,
// in virtual time by a caller, in real time by a LineServer. A pure function of its settings and the calls made
// to it; how the time is cut into calls changes nothing. Nothing is allocated while it runs.
class Line final : public links::VirtualClock {
 public:
  // The settings must have come out of parse_line_file without diagnostics. Throws std::runtime_error when a store file
  // cannot be used.
  explicit Line(const LineSettings& settings);

  // Lets everything up to and including `target` happen, in order of time: an axis is caught up to a frame's arrival
  // before it is given the frame. A target in the past does nothing.
  void run_until(Time target) override;

  // The same, lazily, before a frame of an EtherCAT segment passes at `target`: the line stays behind while that cannot
  // be noticed, since many ticks at once cost less than one after the other, each with the drives' memory to be
  // fetched. `now` then stays behind as well. What EthercatBus::settle returns belongs to expect(), and a caller that
  // does anything else to the line calls changed(), or run_until before.
  void keep_up(Time target) {
    if (target < appears_at_) return;
    run_until(target);
    appears_at_ = next_appearance();
  }
  void expect(Time time) { appears_at_ = std::min(appears_at_, time); }
  void changed() { appears_at_ = Time::min(); }

  Time now() const override { return now_; }
  // From now on; not from within Follower::reached. A follower changes nothing by being there.
  void add_follower(Follower& follower) { followers_.push_back(&follower); }
  void remove_follower(Follower& follower) { std::erase(followers_, &follower); }

  // To the next instant at which anything may happen on a bus, at most 1 ms.
  void step(Time latest = links::never) override;
  // The next such instant, for pacing.
  Time next_bus_event() const;

  const std::vector<std::unique_ptr<Axis>>& axes() const { return axes_; }
  const std::vector<std::unique_ptr<NamedBus>>& buses() const { return buses_; }
  const std::vector<std::unique_ptr<NamedSerialBus>>& serial_buses() const { return serial_buses_; }
  const std::vector<std::unique_ptr<NamedEthercatBus>>& ethercat_buses() const { return ethercat_buses_; }
  // nullptr if there is none of that name.
  Axis* find_axis(std::string_view name) const;
  NamedBus* find_bus(std::string_view name) const;
  NamedSerialBus* find_serial_bus(std::string_view name) const;
  NamedEthercatBus* find_ethercat_bus(std::string_view name) const;
  // The registers of the drive that has a Modbus unit identifier on the RS485 line; nullptr: none with power does that
  // speaks Modbus. A drive that is alone on its line answers to 0 and 255 as well (modbus::Units).
  modbus::Server* find_unit(const NamedSerialBus& bus, std::uint8_t unit) const;
  ClockMode clock_mode() const { return clock_mode_; }

  // In virtual time: at how many times real time it is to pass by itself, 0 .. 1000. That is for a LineServer to do.
  static constexpr double most_speed = 1000;
  double speed() const { return speed_; }
  void set_speed(double speed) { speed_ = speed; }

  // Real time that was given up because the machine could not keep pace.
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
  void run_to_instant(Time instant);

  ClockMode clock_mode_;
  std::vector<std::unique_ptr<NamedBus>> buses_;
  std::vector<std::unique_ptr<NamedSerialBus>> serial_buses_;
  std::vector<std::unique_ptr<NamedEthercatBus>> ethercat_buses_;
  std::vector<std::unique_ptr<Axis>> axes_;
  std::vector<const Axis*> senders_;  // on CAN or alone, see Axis::sends
  std::vector<Follower*> followers_;
  std::int64_t tick_ = 0;  // up to which all axes have run
  Time now_{};
  Time appears_at_ = Time::min();  // up to then it cannot be noticed that time passes; min: unknown
  Lag lag_;
  double speed_ = 0;
};

}  // namespace servodrome::line
