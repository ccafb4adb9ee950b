#pragma once

#include "drive/drive.hpp"
#include "products/device.hpp"
#include "products/generic402/objects.hpp"

// What the reference drive is on any fieldbus: its objects to the drive's terms and back.
namespace servodrome::products::generic402 {

inline constexpr drive::Policy policy = make_policy();

// Values that are not defaults: how it was commissioned, and the nameplate of its motor.
void prepare(Manufacturer& own, drive::Objects& objects, const Settings& settings, dictionary::Area areas);

drive::Configuration configuration(const Manufacturer& own, const drive::MotorData& motor);

// Of its RS485 port; station 0: it has none.
SerialSetup serial_setup(const Manufacturer& own, const Settings& settings);

// 60C2h to a period in ns; left alone if that is 0, or no 8-bit number of any power of ten down to 1 us.
void set_interpolation_period(drive::Objects& objects, std::uint32_t period_ns);

std::uint16_t i2t_utilisation(const drive::Drive& drive);  // 2060h, %

}  // namespace servodrome::products::generic402
