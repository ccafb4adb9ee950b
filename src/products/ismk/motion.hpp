#pragma once

#include "dictionary/dictionary.hpp"
#include "drive/homing/device_homing.hpp"
#include "products/device.hpp"
#include "products/ismk/objects.hpp"

namespace servodrome::drive {
class Drive;
struct Configuration;
}  // namespace servodrome::drive

// What the motion objects of the iSMK mean to the drive, beyond those that CiA 402 has as well.
namespace servodrome::products::ismk {

inline constexpr std::uint8_t initialise_command = 10;  // of 2FF0h sub 1

// Counts SYNCs that do not come when they are due (3011h sub 4, Tables 9-26 and 9-27).
class SyncMonitor {
 public:
  void stop() { running_ = false; }
  // Both answer how many were lost: a SYNC came, or time has gone by. One that comes much too early tells of another
  // period than the one that is set.
  std::uint16_t sync(Time now, Time period);
  std::uint16_t wait(Time now, Time period);

 private:
  bool running_ = false;
  Time last_{};
};

class MotionControl {
 public:
  void power_on() { *this = {}; }

  // Once per position-loop cycle, before the process image is read: homing that the device starts itself, and what it
  // learns by homing. Answers whether the drive needs a new configuration.
  bool cycle(drive::Drive& drive, ServoObjects& objects);

  void sync(const drive::Drive& drive, ServoObjects& objects, Time now);
  void watch_sync(const drive::Drive& drive, ServoObjects& objects, Time now);

  // `configuration.motor` must be there.
  static void configure(const ServoObjects& objects, drive::Configuration& configuration);
  // Values that follow from saved ones.
  static void loaded(ServoObjects& objects);

  // For objects of Owner::product; what is not of this group is left alone. `written` answers whether the drive needs
  // no new configuration.
  static dictionary::AbortCode check(const dictionary::Entry& entry, std::int64_t number, const drive::Drive& drive);
  static bool written(const dictionary::Entry& entry, ServoObjects& objects, const drive::Drive& drive);
  static void refresh(const dictionary::Entry& entry, ServoObjects& objects, const drive::Drive& drive);

 private:
  SyncMonitor sync_monitor_{};
  drive::DeviceHoming homing_{};
  bool enabled_once_ = false;  // since power on
  bool was_homed_ = false;
};

}  // namespace servodrome::products::ismk
