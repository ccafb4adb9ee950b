#pragma once

#include "described/binding.hpp"
#include "described/objects.hpp"
#include "products/generic402/servo.hpp"

namespace servodrome::described {

// A CANopen drive created from an electronic data sheet.
class CanDrive final : public products::CanDevice<CanDrive, CanObjects, 4096> {
 public:
  // For compile-time decisions only; the device's own policy is that of the blueprint.
  static constexpr const drive::Policy& policy = products::generic402::policy;
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr std::uint8_t factory_node_id = 1;
  static constexpr std::uint32_t factory_bit_rate = 1'000'000;

  CanDrive(std::shared_ptr<const Blueprint> blueprint, const products::Settings& settings);

 private:
  friend CanDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas) { binding_.prepare(drive_objects(), settings(), areas); }
  void loaded(dictionary::Area areas) { binding_.loaded(areas); }
  drive::Configuration configuration() const {
    return products::generic402::configuration(objects().manufacturer, settings().motor);
  }
  std::uint8_t chosen_node_id() const { return settings().node_id != 0 ? settings().node_id : factory_node_id; }
  std::uint32_t chosen_bit_rate() const { return settings().bit_rate != 0 ? settings().bit_rate : factory_bit_rate; }

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override {
    return binding_.check(entry, value);
  }
  void written(const dictionary::Entry& entry) override { binding_.written(entry); }
  void refresh(const dictionary::Entry& entry) override { binding_.refresh(entry); }
  std::span<const std::byte> domain(const dictionary::Entry& entry) override { return binding_.domain(entry); }

  std::shared_ptr<const Blueprint> blueprint_;
  Binding binding_{*blueprint_, dictionary(), drive()};
};

}  // namespace servodrome::described
