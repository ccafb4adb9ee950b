#pragma once

#include "drive/objects.hpp"

namespace servodrome::drive {

class Drive;

// Homing that the device starts itself, by an input or a parameter: homing mode until homing succeeds or fails, then
// the mode before. It writes the same objects as a bus master would.
class DeviceHoming {
 public:
  // Has an effect only while the drive is enabled.
  void start(Drive& drive, Objects& objects);
  // Once per position-loop cycle. Also ends the homing when the drive is no longer enabled.
  void step(Drive& drive, Objects& objects);
  bool running() const { return running_; }

 private:
  bool running_ = false;
  std::int8_t mode_before_ = 0;
};

}  // namespace servodrome::drive
