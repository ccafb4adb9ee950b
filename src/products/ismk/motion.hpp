#pragma once

#include "dictionary/dictionary.hpp"
#include "drive/homing/device_homing.hpp"
#include "products/ismk/objects.hpp"

namespace servodrome::drive {
class Drive;
struct Configuration;
}  // namespace servodrome::drive

// What the motion objects of the iSMK mean to the drive, beyond those that CiA 402 has as well.
namespace servodrome::products::ismk {

inline constexpr std::uint8_t initialise_command = 10;  // of 2FF0h sub 1

class MotionControl {
 public:
  void power_on() { *this = {}; }

  // Once per position-loop cycle, before the process image is read: homing that the device starts itself, and what it
  // learns by homing. Answers whether the drive needs a new configuration.
  bool cycle(drive::Drive& drive, Objects& objects);

  // `configuration.motor` must be there.
  static void configure(const Objects& objects, drive::Configuration& configuration);
  // Values that follow from saved ones.
  static void loaded(Objects& objects);

  // For objects of Owner::product; what is not of this group is left alone. `written` answers whether the drive needs
  // no new configuration.
  static dictionary::AbortCode check(const dictionary::Entry& entry, std::int64_t number, const drive::Drive& drive);
  static bool written(const dictionary::Entry& entry, Objects& objects, const drive::Drive& drive);
  static void refresh(const dictionary::Entry& entry, Objects& objects, const drive::Drive& drive);

 private:
  drive::DeviceHoming homing_{};
  bool enabled_once_ = false;  // since power on
  bool was_homed_ = false;
};

}  // namespace servodrome::products::ismk
