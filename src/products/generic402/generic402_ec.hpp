#pragma once

#include "products/ethercat_device.hpp"
#include "products/generic402/ethercat_objects.hpp"
#include "products/generic402/servo.hpp"

namespace servodrome::products {

// The reference drive on EtherCAT (ETG.6010).
class Generic402Ec final : public EthercatDevice<Generic402Ec, generic402::EthercatObjects> {
 public:
  static constexpr std::span<const dictionary::Entry> table{generic402::ethercat_object_table};
  static constexpr const drive::Policy& policy = generic402::policy;
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr ethercat::Profile ethercat_profile{};
  static ethercat::SiiDescription sii_description(const Settings& settings);

  explicit Generic402Ec(const Settings& settings) : EthercatDevice(settings) {}

 private:
  friend EthercatDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  drive::Configuration configuration() const;

  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;
};

}  // namespace servodrome::products
