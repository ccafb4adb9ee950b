#pragma once

#include "dictionary/dictionary.hpp"
#include "drive/homing/device_homing.hpp"
#include "products/device.hpp"
#include "products/ismk/objects.hpp"

namespace servodrome::drive {
class Drive;
struct Configuration;
}  // namespace servodrome::drive

// The motion objects of the iSMK that CiA 402 does not have, and their effect on the drive.
namespace servodrome::products::ismk {

inline constexpr std::uint8_t initialise_command = 10;  // of 2FF0h sub 1

// Counts SYNCs that are missing when due (3011h sub 4, Tables 9-26 and 9-27).
class SyncMonitor {
 public:
  void stop() { running_ = false; }
  // Both return the number of SYNCs lost since the last call: sync() when a SYNC arrives, wait() as time passes. A SYNC
  // that comes much too early counts as well, because its period is not the one that is set.
  std::uint16_t sync(Time now, Time period);
  std::uint16_t wait(Time now, Time period);

 private:
  bool running_ = false;
  Time last_{};
};

class MotionControl {
 public:
  void power_on() { *this = {}; }

  // Once per position-loop cycle, before the process image is read: starts automatic homing, and evaluates the results
  // of homing. Returns whether the drive needs a new configuration.
  bool cycle(drive::Drive& drive, ServoObjects& objects);

  void sync(const drive::Drive& drive, ServoObjects& objects, Time now);
  void watch_sync(const drive::Drive& drive, ServoObjects& objects, Time now);

  // `configuration.motor` must be set.
  static void configure(const ServoObjects& objects, drive::Configuration& configuration);
  // Sets values that follow from saved ones.
  static void loaded(ServoObjects& objects);

  // For objects of Owner::product; objects of other groups are ignored. `written` returns true if the drive needs no
  // new configuration.
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
