#pragma once

#include "drive/objects.hpp"

namespace servodrome::drive {

class Drive;

// Homing that the device starts itself, because of an input or its parameters: homing mode until home is found or
// homing has failed, then the mode before. It writes the objects a bus master would write.
class DeviceHoming {
 public:
  // Only while the drive is enabled.
  void start(Drive& drive, Objects& objects);
  // Once per position-loop cycle. Ends it as well when the drive is not enabled any more.
  void step(Drive& drive, Objects& objects);
  bool running() const { return running_; }

 private:
  bool running_ = false;
  std::int8_t mode_before_ = 0;
};

}  // namespace servodrome::drive
