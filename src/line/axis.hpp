#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "drive/faults.hpp"
#include "line/config.hpp"
#include "line/registry.hpp"
#include "line/tap.hpp"
#include "links/can/bus.hpp"
#include "links/can/interposer.hpp"
#include "links/ethercat/bus.hpp"
#include "links/serial/line.hpp"
#include "plant/plant.hpp"

namespace servodrome::line {

using Time = links::Time;

class CoupledAxes;

inline constexpr Time tick_length{62'500};  // drive::tick_seconds, exactly

// The buses that an axis is connected to; nullptr: it has no bus of this kind.
struct AxisBuses {
  links::CanBus* can = nullptr;
  links::EthercatBus* ethercat = nullptr;
  links::SerialLine* serial = nullptr;
  Time serial_silence{};  // pause that ends a Modbus frame, as set in the drives of the RS485 line
};

// A drive and its plant. The drive is connected to a fieldbus (a CAN bus or an EtherCAT segment), to an RS485 line, or
// to both. Tick n ends at the time n * tick_length. In each tick the plant advances to that time, then the drive
// samples its inputs and sets its outputs. A position-loop cycle that ends in a tick may send frames on a CAN bus at
// the end of the tick. An EtherCAT slave sends nothing by itself, so it need not catch up before a frame comes. Its own
// clock may cause events between ticks (SYNC0).
class Axis final : public links::Receiver {
 public:
  // The drive has power from the start. Throws std::runtime_error when the store file cannot be used.
  Axis(const AxisSettings& settings, const AxisBuses& buses);
  ~Axis() override;
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  // Runs all ticks up to and including number `tick`; of a coupled axis also those of its partner.
  void run_to(std::int64_t tick);
  // The same for this axis only, not for its partner. CoupledAxes calls it.
  void run_alone_to(std::int64_t tick);
  void couple(CoupledAxes& pair) { pair_ = &pair; }
  const CoupledAxes* pair() const { return pair_; }  // nullptr: the axis is not coupled
  std::int64_t ticks() const { return tick_; }       // the last tick that has run
  // Adds a tap, which samples from the axis' next tick on. Must not be called while the axis runs.
  void attach(Tap& tap);
  void detach(Tap& tap);
  // Returns true if the axis may send without having received anything. A slave on EtherCAT never does.
  bool sends() const { return ethercat_ == nullptr; }
  // The earliest time from `now` on at which the axis may do something that shows on its bus: the next position-loop
  // cycle or the next poll. If the axis can send, the line must not run other axes beyond this time, or they would miss
  // the frame.
  Time next_appearance(Time now) const;
  // Polls the device if its deadline has come.
  void poll(Time now);
  // Passes on the device's waiting frames to the bus, after an event outside the ticks (such as an object that the
  // bench API wrote).
  void send_waiting(Time now);

  void power_off(Time now);
  void power_on(Time now);
  bool powered() const { return powered_; }
  // The number of power-ons and NMT resets (reset node, reset communication). After each of them, delayed actions of
  // the drive from before it are void.
  std::uint32_t starts() const { return starts_; }

  // links::Receiver
  void on_frame(const canopen::Frame& frame, Time at) override;
  void on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) override;
  void on_error_state(links::ErrorState state, Time at) override;

  const AxisSettings& settings() const { return settings_; }
  products::Device& device() { return *device_; }
  plant::Plant& plant() { return plant_; }
  const plant::Plant& plant() const { return plant_; }
  const drive::Feedback& feedback() const { return feedback_; }
  const drive::Actuation& actuation() const { return actuation_; }
  links::PortId port() const { return port_; }         // of the CAN bus, if the axis is on one
  std::size_t position() const { return slave_ + 1; }  // on the EtherCAT segment, if the axis is on one; the first is 1
  links::SerialPortId serial_line_port() const { return serial_port_; }  // of the RS485 line, if the axis is on one
  // The drive's RS485 port. Returns nullptr if there is none, if it is not connected or if the drive has no power.
  products::SerialPort* serial_port() const {
    return powered_ && serial_ != nullptr ? device_->serial_port() : nullptr;
  }

  // Returns a copy of the drive in the state that it would have after a power-on now. The copy has a copy of the
  // non-volatile memory and never runs.
  std::shared_ptr<products::Device> stored_device() const;

  // Moves the shaft to another encoder position, at rest. Returns false, and does nothing, while the motor is
  // energised.
  bool place(std::int64_t position_counts);
  // Forces an input wire to a level, for the bench API. Without `level` the switches of the travel set it again.
  void force_input(int wire, std::optional<bool> level);
  const std::map<int, bool>& forced_inputs() const { return forced_inputs_; }
  // Injects, or removes, a fault cause that occurs only in real hardware, for the bench API. The cause stays through a
  // power cycle.
  void inject(drive::Cause cause, bool present);
  bool injected(drive::Cause cause) const { return injected_.contains(cause); }

  // Counts a command that a client of the bench API gave the axis without a job: by the controlword, the power, or a
  // stop of all axes.
  void note_command() { ++commands_; }
  std::uint64_t commands() const { return commands_; }

  // Puts `interposer` between the drive and its CAN bus; nullptr: none. It must outlive the axis or be removed.
  void interpose(links::CanInterposer* interposer) { can_interposer_ = interposer; }
  // The drive receives a frame that the interposer has kept back or made.
  void deliver(const canopen::Frame& frame, Time now);

 private:
  static constexpr std::int64_t unknown = -1;
  static constexpr std::int64_t no_tick = std::numeric_limits<std::int64_t>::max();

  // The axis as a station of the RS485 line.
  class Station final : public links::SerialStation {
   public:
    explicit Station(Axis& axis) : axis_(axis) {}
    void receive(std::uint8_t character, bool intact, Time at) override;
    void poll(Time now) override;
    Time next_deadline() const override;
    std::span<const std::uint8_t> take() override;

   private:
    Axis& axis_;
  };

  // The axis as a slave of the EtherCAT segment.
  class EthercatStation final : public links::EthercatStation {
   public:
    explicit EthercatStation(Axis& axis) : axis_(axis) {}
    ethercat::Esc& esc() override { return *axis_.device_->ethercat_controller(); }
    Time frame_passed(Time at) override;

   private:
    Axis& axis_;
  };

  void run_ticks(std::int64_t tick);
  void take_samples();
  Time next_poll() const;
  void poll_slave(Time until);
  void poll_due_slave(Time until);
  void poll_node(Time now);
  const canopen::WaitingFrame* next_frame(Time now);
  void follow_bit_rate();
  void follow_serial_format();

  AxisSettings settings_;
  links::CanBus* bus_;
  links::EthercatBus* ethercat_;
  links::SerialLine* serial_;
  std::shared_ptr<dictionary::Medium> store_;
  products::Settings device_settings_;
  std::shared_ptr<products::Device> device_;
  plant::Plant plant_;
  drive::Feedback feedback_{};
  drive::Actuation actuation_{};
  links::PortId port_{};
  EthercatStation ethercat_station_{*this};
  ethercat::Slave* ethercat_slave_ = nullptr;
  std::size_t slave_ = 0;  // place on the EtherCAT segment, from 0
  links::CanInterposer* can_interposer_ = nullptr;
  CoupledAxes* pair_ = nullptr;
  std::uint32_t port_bit_rate_ = 0;
  Station station_{*this};
  links::SerialPortId serial_port_{};
  modbus::CharacterFormat serial_format_;  // as last reported to the RS485 line
  std::int64_t tick_ = 0;
  std::int64_t last_cycle_ = unknown;  // tick at which the drive last completed a position-loop cycle
  std::int64_t cycle_ticks_ = unknown;
  Time last_poll_{-1};
  bool powered_ = false;
  std::uint32_t starts_ = 0;
  std::uint64_t commands_ = 0;
  std::vector<Tap*> taps_;
  std::int64_t samples_due_ = no_tick;  // the next tick at which a tap takes a sample
  std::map<int, bool> forced_inputs_;
  std::set<drive::Cause> injected_;
};

}  // namespace servodrome::line
