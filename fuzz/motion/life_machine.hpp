#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "machine.hpp"

namespace servodrome::motion {

// Carries a sequence out on its line. The ticks are in machine.cpp, the master in machine_master.cpp, the events in
// machine_events.cpp, the recovery in machine_recovery.cpp.
class Life::Machine final : public FrameListener {
 public:
  Machine(const Sequence& sequence, const RunOptions& options);

  bool run_to(std::int64_t end);
  void go_on_with(const Sequence& sequence) { sequence_ = sequence; }
  Outcome end(bool recovers);
  std::int64_t ticks() const { return tick_; }

 private:
  static constexpr std::int64_t set_up_tick = 8;  // a node has booted by then
  static constexpr std::int64_t master_period = ticks_per_ms;
  static constexpr std::int64_t stop_linger = ticks_per_ms;  // time for which a shaft may rebound from a hard stop

  struct Stream {
    std::uint16_t index = 0;
    std::int64_t step = 0;
    std::int64_t left = 0;
    std::int64_t gap = 0;
    std::int64_t sent = 0;
  };
  struct AxisState {
    Surroundings around;
    Stream stream;
    bool held = false;                    // the bench holds the rotor
    std::int64_t touched = -stop_linger;  // tick of the last contact with a hard stop
    bool enabling = false;
    std::int64_t enabling_until = 0;
    bool set_up = false;
    std::int64_t set_up_at = 0;  // tick at which the master sets the axis up again; 0: never
  };

  line::Axis& axis(std::size_t i) { return *line_.axes()[i]; }
  bool on_can() const { return can_ != nullptr; }

  bool one_tick();
  void look_at_stops(std::size_t i);
  void look_for_crowds();
  bool look_at_load();
  void mix(std::uint64_t value) { fingerprint_ = (std::rotl(fingerprint_, 13) ^ value) * 0x9E3779B97F4A7C15ULL; }
  void take_fingerprint();

  // --- The master
  void set_up(std::size_t i);
  void run_cycle();
  void step_stream(std::size_t i);
  void write(std::size_t i, std::uint16_t index, std::uint8_t sub, std::int64_t value, Via via);
  void control(std::size_t i, std::uint16_t word);
  void poll_axis(std::size_t i);
  void heard(std::size_t i, const canopen::Frame& frame, line::Time at) override;

  // --- Events
  void carry_out(const Event& event);
  void carry_out_masters(std::size_t i, const Event& event);
  void carry_out_benchs(std::size_t i, const Event& event);

  // --- Recovery
  void recover();
  void heal();
  bool run_for(int milliseconds);
  bool all_enabled() const;
  bool enable_all(int milliseconds);
  bool brakes();
  bool back_by_the_bus();
  bool lasts(std::size_t i, drive::Cause cause);
  bool is_hot(std::size_t i);
  void back_by_power();

  // --- Log
  void tell();

  Sequence sequence_;
  std::size_t next_ = 0;  // index of the next event
  RunOptions options_;
  line::Line line_;
  std::vector<AxisState> axes_;
  std::unique_ptr<Master> master_;
  CanMaster* can_ = nullptr;
  std::vector<std::unique_ptr<Watch>> watches_;
  std::vector<double> rated_torque_nm_;
  std::vector<double> base_inertia_;
  std::vector<double> base_volts_;
  std::int64_t tick_ = 0;
  std::int64_t cycle_ticks_ = 16;
  std::int64_t pause_ = 0;
  std::int64_t cycles_ = 0;
  bool cycling_ = true;
  std::uint64_t fingerprint_ = 0;
  std::uint64_t bits_ = 0;
  std::uint64_t crowd_bits_ = 0;
  bool streamed_ = false;
  std::optional<Finding> finding_;
  std::vector<std::pair<std::uint16_t, int>> told_;
};

}  // namespace servodrome::motion
