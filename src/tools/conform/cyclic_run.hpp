#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "axis/cia402_words.hpp"
#include "axis/cyclic/cyclic_axis.hpp"
#include "axis/cyclic/cyclic_bus.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform {

// A mode in which the master sends a target in each cycle.
struct CyclicMode {
  OperationMode mode;
  PdoObject target;
  bool is_position = false;
  // Actual value for a target that is not a position.
  std::optional<PdoObject> actual{};
  // Alternative target, used if the drive does not have the object above.
  std::optional<PdoObject> other_target{};
  std::uint16_t enable_bits = 0;  // bits of the controlword, in addition to enable operation
};

// The drive in a cyclic mode: by SYNC and PDOs on CAN, by process data in OP on EtherCAT. The destructor stops the
// axis, switches it off and restores the PDOs.
class CyclicRun {
 public:
  // Sets the mode and starts the exchange; the axis is not enabled. Skips the check if the drive does not have the mode
  // or cannot map an object that it needs.
  CyclicRun(Trial& trial, const CyclicMode& mode);
  ~CyclicRun();
  CyclicRun(const CyclicRun&) = delete;
  CyclicRun& operator=(const CyclicRun&) = delete;

  // Enables the axis; the target is the present position, or 0. Ends the check if the axis does not become enabled.
  void enable();
  // Runs cycles for `span` and calls `each` in each cycle. Ends early and returns true when `each` returns true;
  // otherwise returns false. `each` must not block.
  bool run(Time span, const std::function<bool()>& each = {});
  void control(std::uint16_t word) { control_ = word; }
  std::uint16_t enabled_word() const {
    return static_cast<std::uint16_t>(command_word::enable_operation | mode_.enable_bits);
  }
  void set_target(double value) { target_ = static_cast<std::int32_t>(std::lround(value)); }
  std::int32_t target() const { return target_; }
  // Waits until the position stays the same for some cycles; false after `patience`.
  bool comes_to_rest(Time patience);

  std::uint16_t statusword() const { return axis_->statusword(); }
  PowerState state() const { return axis_->state(); }
  std::int32_t position() const { return position_->get<std::int32_t>(); }
  std::int32_t actual() const { return actual_ ? actual_->get<std::int32_t>() : position(); }
  bool shows_actual() const { return actual_.has_value(); }
  // Mean speed over the last cycles, in position units per second.
  double speed() const { return speed_; }
  double period_s() const;

 private:
  static constexpr std::size_t cycles_of_speed = 4;
  struct Slave;  // saves and restores an EtherCAT slave's mapping

  void open_can();
  void open_ethercat();
  void set_interpolation_time();
  void set_gentle_ramps();
  bool has(const PdoObject& object);
  std::vector<PdoObject> outputs() const;
  std::vector<PdoObject> inputs() const;
  void cycle();
  void stop();

  Trial& trial_;
  CyclicMode mode_;
  PdoObject shown_position_;
  std::unique_ptr<Slave> slave_;
  std::unique_ptr<CyclicBus> bus_;
  std::optional<CyclicAxis> axis_;
  std::optional<ProcessObject> target_place_, position_, actual_;
  Time brake_delay_{};
  std::optional<std::uint16_t> control_;
  std::int32_t target_ = 0;
  std::function<bool()> each_;
  bool done_ = false;
  std::vector<std::int32_t> positions_;  // positions of the last cycles, the newest last
  double speed_ = 0.0;
  bool ends_ = false;  // the run ends: cancellation has no effect
};

}  // namespace servodrome::master::conform
