#pragma once

#include "described/binding.hpp"
#include "described/objects.hpp"
#include "products/ethercat_device.hpp"
#include "products/generic402/servo.hpp"

namespace servodrome::described {

inline constexpr products::EthercatSizes ethercat_sizes{
    .mapped_objects = 256, .mailbox_bytes = 1536, .sdo_bytes = 4096, .sii_bytes = ethercat_sii_bytes};

// An EtherCAT drive created from an ESI file.
class EthercatDrive final : public products::EthercatDevice<EthercatDrive, EthercatObjects, ethercat_sizes> {
 public:
  // For compile-time decisions only; the device's own policy is that of the blueprint.
  static constexpr const drive::Policy& policy = products::generic402::policy;
  static constexpr dictionary::LengthAborts length_aborts{};

  EthercatDrive(std::shared_ptr<const Blueprint> blueprint, const products::Settings& settings);

 private:
  friend EthercatDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas) { binding_.prepare(drive_objects(), settings(), areas); }
  void loaded(dictionary::Area areas) { binding_.loaded(areas); }
  drive::Configuration configuration() const {
    drive::Configuration configuration = products::generic402::configuration(objects().manufacturer, settings().motor);
    configuration.set_point_period_s = set_point_period_s_;
    return configuration;
  }

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override {
    return binding_.check(entry, value);
  }
  void written(const dictionary::Entry& entry) override { binding_.written(entry); }
  void refresh(const dictionary::Entry& entry) override { binding_.refresh(entry); }
  std::span<const std::byte> domain(const dictionary::Entry& entry) override { return binding_.domain(entry); }

  // --- ethercat::SlaveEvents
  void state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause,
                     products::Time now) override;

  double set_point_period_s_ = 0.0;  // period of SYNC0; 0: 60C2h is used
  std::shared_ptr<const Blueprint> blueprint_;
  Binding binding_{*blueprint_, dictionary(), drive()};
};

}  // namespace servodrome::described
