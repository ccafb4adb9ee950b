#pragma once

#include "described/blueprint.hpp"
#include "drive/drive.hpp"
#include "products/generic402/objects.hpp"

namespace servodrome::described {

// Synchronises a drive's fields with the objects of the description. This class contains the code of a described
// device that is independent of the fieldbus and not part of drive::Drive.
class Binding {
 public:
  Binding(const Blueprint& blueprint, dictionary::Dictionary& dictionary, drive::Drive& drive)
      : blueprint_(blueprint), dictionary_(dictionary), drive_(drive) {}

  // Sets factory values that no table contains: strings, objects without a description, the nameplate of the motor.
  void prepare(drive::Objects& objects, const products::Settings& settings, dictionary::Area areas);
  // Call it when the objects have their saved values: copies those of a different size to the drive's fields.
  void loaded(dictionary::Area areas);

  // dictionary::Listener for Owner::product
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value);
  void written(const dictionary::Entry& entry);
  void refresh(const dictionary::Entry& entry);
  std::span<const std::byte> domain(const dictionary::Entry& entry) const;

 private:
  const Adapted* find_adapted(const dictionary::Entry& entry) const;
  void to_drive(const dictionary::Entry& entry, const dictionary::Entry& reference);
  void put(const dictionary::Entry& entry, std::int64_t value);

  const Blueprint& blueprint_;
  dictionary::Dictionary& dictionary_;
  drive::Drive& drive_;
};

// Units of a described drive. A feed constant of 1:1, which makers print for "none", makes the position unit one
// increment of 608Fh. The encoder itself is that of the motor, independent of 608Fh.
bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units);

}  // namespace servodrome::described
