#pragma once

#include "drive/drive.hpp"
#include "products/device.hpp"
#include "products/generic402/objects.hpp"

// The part of the reference drive that is the same on all fieldbuses: it converts objects to the drive's settings and
// back.
namespace servodrome::products::generic402 {

inline constexpr drive::Policy policy = make_policy();

// Sets values that are not defaults: commissioning settings and the nameplate of the motor.
void prepare(Manufacturer& own, drive::Objects& objects, const Settings& settings, dictionary::Area areas);

drive::Configuration configuration(const Manufacturer& own, const drive::MotorData& motor);

// The set-up of its RS485 port; station 0: it has no station number.
SerialSetup serial_setup(const Manufacturer& own, const Settings& settings);

// Sets 60C2h to a period in ns. 60C2h stays as it is unless the period is 1 to 255 times a power of ten (1 us to 1 s).
void set_interpolation_period(drive::Objects& objects, std::uint32_t period_ns);

std::uint16_t i2t_utilisation(const drive::Drive& drive);  // 2060h, %

}  // namespace servodrome::products::generic402
