#pragma once

#include <array>

#include "axis/axis402.hpp"
#include "master/process_image.hpp"

namespace servodrome::master {

// A CiA 402 axis through its process data, on any bus: reads the inputs of the last cycle and sets the outputs of the
// next. No call blocks; call it from a bus's on_cycle or between waits.
class CyclicAxis {
 public:
  // The exchange that `image` belongs to must outlive this. Throws MasterError if controlword or statusword is not
  // mapped.
  explicit CyclicAxis(ProcessImage& image);
  explicit CyclicAxis(ProcessImage&& image) : CyclicAxis(image) {}

  // Link and address, for error messages.
  const std::string& where() const { return where_; }

  // ---- Inputs of the last cycle, in the units of the objects; 0 for an object that is not mapped ----
  std::uint16_t statusword() const { return statusword_.get<std::uint16_t>(); }
  PowerState state() const { return state_of(statusword()); }
  std::int8_t mode() const { return value<std::int8_t>(mode_display_); }                  // 6061h
  std::int32_t position() const { return value<std::int32_t>(position_); }                // 6064h
  std::int32_t velocity() const { return value<std::int32_t>(velocity_); }                // 606Ch
  std::int16_t torque() const { return value<std::int16_t>(torque_); }                    // 6077h
  std::int32_t following_error() const { return value<std::int32_t>(following_error_); }  // 60F4h
  std::uint16_t error_code() const { return value<std::uint16_t>(error_code_); }          // 603Fh
  std::uint32_t digital_inputs() const { return value<std::uint32_t>(digital_inputs_); }  // 60FDh
  bool shows_mode() const { return mode_display_.has_value(); }
  bool shows_position() const { return position_.has_value(); }
  bool shows_velocity() const { return velocity_.has_value(); }

  // ---- Outputs of the next cycle, in the units of the objects; throw MasterError if the object is not mapped ----
  void set_controlword(std::uint16_t word) { controlword_.set(word); }
  std::uint16_t controlword() const { return controlword_.get<std::uint16_t>(); }
  void set_mode(OperationMode mode) { required(mode_, 0x6060).set(static_cast<std::int8_t>(mode)); }
  bool can_set_mode() const { return mode_.has_value(); }
  void set_target_position(std::int32_t position) { required(target_position_, 0x607A).set(position); }
  void set_interpolated_position(std::int32_t position) { required(interpolated_position_, 0x60C1).set(position); }
  void set_target_velocity(std::int32_t velocity) { required(target_velocity_, 0x60FF).set(velocity); }
  void set_target_torque(std::int16_t torque) { required(target_torque_, 0x6071).set(torque); }
  void set_velocity_offset(std::int32_t velocity) { required(velocity_offset_, 0x60B1).set(velocity); }
  void set_torque_offset(std::int16_t torque) { required(torque_offset_, 0x60B2).set(torque); }
  // True if all objects that a cyclic mode needs are mapped.
  bool can_command(OperationMode mode) const;

  // ---- Touch probes 1 and 2 (CiA 402-2 clause 12); false or 0 if not mapped ----
  bool has_touch_probe(unsigned probe, bool rising) const;
  void set_touch_probe_function(std::uint16_t function) { required(probe_function_, 0x60B8).set(function); }
  std::uint16_t touch_probe_status() const { return value<std::uint16_t>(probe_status_); }  // 60B9h
  std::int32_t touch_probe_position(unsigned probe, bool rising) const;                     // 60BAh to 60BDh

  // Commands one state transition towards operation enabled at each call; returns true once the drive is enabled. Until
  // then the targets follow the actual position, so that the axis does not jump. Does not reset a fault: returns false
  // as long as there is one.
  bool enable();
  // Commands switch on disabled; true once it is reached.
  bool disable();
  // Resets a fault by a rising edge of bit 7, which takes two calls; true when no fault is left.
  bool reset_fault();
  // Sets the target positions to the actual position, target velocity and torque to 0.
  void hold();

 private:
  template <typename T>
  static T value(const std::optional<ProcessObject>& object) {
    return object ? object->get<T>() : T{};
  }
  ProcessObject& required(std::optional<ProcessObject>& object, std::uint16_t index);

  std::string where_;
  ProcessObject controlword_;
  ProcessObject statusword_;
  std::optional<ProcessObject> mode_, target_position_, interpolated_position_, target_velocity_, target_torque_,
      velocity_offset_, torque_offset_, probe_function_;
  std::optional<ProcessObject> mode_display_, position_, velocity_, torque_, following_error_, error_code_,
      digital_inputs_, probe_status_;
  std::array<std::optional<ProcessObject>, 4> probe_positions_;  // 60BAh to 60BDh: 1 rising, 1 falling, 2 rising, ...
};

}  // namespace servodrome::master
