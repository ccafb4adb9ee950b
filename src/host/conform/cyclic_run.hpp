#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "host/canopen/pdo_set_up.hpp"
#include "host/conform/trial.hpp"
#include "host/cyclic/cyclic_axis.hpp"
#include "host/cyclic/cyclic_bus.hpp"

namespace servodrome::host::conform {

// A mode in which the master gives a target in each cycle.
struct CyclicMode {
  OperationMode mode;
  PdoObject target;
  bool is_position = false;
  // What follows a target that is no position.
  std::optional<PdoObject> actual{};
  // Where the target is if the drive does not have the object above.
  std::optional<PdoObject> other_target{};
  std::uint16_t enable_bits = 0;  // of the controlword, beside those that enable operation
};

// The drive in a cyclic mode: by SYNC and PDOs on CAN, by the process data in OP on EtherCAT. When this ends the axis
// is stopped and without power, and the PDOs are as they were.
class CyclicRun {
 public:
  // The mode is taken, and the exchange runs; the axis is not enabled. Skips if the drive does not have the mode, or
  // does not map what it needs.
  CyclicRun(Trial& trial, const CyclicMode& mode);
  ~CyclicRun();
  CyclicRun(const CyclicRun&) = delete;
  CyclicRun& operator=(const CyclicRun&) = delete;

  // Targets where the axis is, or 0. Ends the check if it does not become enabled.
  void enable();
  // Cycles run for `span`, or until `each`, called in each of them, is true; false: it was not. `each` does not wait.
  bool run(Time span, const std::function<bool()>& each = {});
  void control(std::uint16_t word) { control_ = word; }
  std::uint16_t enabled_word() const { return static_cast<std::uint16_t>(0x000F | mode_.enable_bits); }
  void set_target(double value) { target_ = static_cast<std::int32_t>(std::lround(value)); }
  std::int32_t target() const { return target_; }
  // Until the position has not changed for some cycles.
  bool comes_to_rest(Time patience);

  std::uint16_t statusword() const { return axis_->statusword(); }
  PowerState state() const { return axis_->state(); }
  std::int32_t position() const { return position_->get<std::int32_t>(); }
  std::int32_t actual() const { return actual_ ? actual_->get<std::int32_t>() : position(); }
  bool shows_actual() const { return actual_.has_value(); }
  // Of the last cycles, in position units per second.
  double speed() const { return speed_; }
  double period_s() const;

 private:
  static constexpr std::size_t cycles_of_speed = 4;
  struct Slave;  // an EtherCAT slave's mapping from before

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
  std::optional<std::uint16_t> control_;
  std::int32_t target_ = 0;
  std::function<bool()> each_;
  bool done_ = false;
  std::vector<std::int32_t> positions_;  // of the last cycles, the newest last
  double speed_ = 0.0;
  bool ends_ = false;  // and is cancelled no more
};

}  // namespace servodrome::host::conform
