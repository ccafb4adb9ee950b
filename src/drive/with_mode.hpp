#pragma once

#include "drive/drive.hpp"

namespace servodrome::drive {

template <typename Self, typename Function>
auto Drive::with_mode(Self& self, Function&& function) {
  if (self.identification_.running()) return function(self.identification_);
  // Products that energise the motor in Switched on hold it there without a mode.
  if (self.state_ == PowerState::switched_on) return function(self.no_mode_);
  switch (self.mode_) {
    case Mode::profile_position: return function(self.profile_position_);
    case Mode::velocity: return function(self.velocity_mode_);
    case Mode::profile_velocity: return function(self.profile_velocity_);
    case Mode::profile_torque: return function(self.profile_torque_);
    case Mode::homing: return function(self.homing_mode_);
    case Mode::interpolated_position:
      return self.policy_.interpolation.source == Interpolation::buffered ? function(self.interpolated_position_)
                                                                          : function(self.synchronous_interpolation_);
    case Mode::cyclic_sync_position: return function(self.cyclic_sync_position_);
    case Mode::cyclic_sync_velocity: return function(self.cyclic_sync_velocity_);
    case Mode::cyclic_sync_torque: return function(self.cyclic_sync_torque_);
    case Mode::immediate_velocity: return function(self.immediate_velocity_);
    case Mode::pulse:
    case Mode::none: break;
  }
  return function(self.no_mode_);
}

}  // namespace servodrome::drive
