#pragma once

#include "products/ethercat_device.hpp"
#include "products/generic402/ethercat_objects.hpp"
#include "products/generic402/servo.hpp"
#include "products/parameter_file.hpp"

namespace servodrome::products {

// The reference drive on EtherCAT (ETG.6010).
class Generic402Ec final : public EthercatDevice<Generic402Ec, generic402::EthercatObjects> {
 public:
  static constexpr std::span<const dictionary::Entry> table{generic402::ethercat_object_table};
  static constexpr const drive::Policy& policy = generic402::policy;
  static constexpr dictionary::LengthAborts length_aborts{};
  // Start-up commands for a master to send before its targets: the mode and the period of targets.
  static constexpr auto start_up = std::to_array<ethercat::StartUpParameter>({
      {"PS", 0x6060, 0, 8, "Mode: cyclic synchronous position"},
      {"PS", 0x60C2, 1, 1, "Interpolation time period: 1"},
      {"PS", 0x60C2, 2, -3, "ms"},
  });
  static constexpr ethercat::Profile ethercat_profile{.bootstrap = true, .file_access = true, .start_up = start_up};
  static ethercat::SiiDescription sii_description(const Settings& settings);

  explicit Generic402Ec(const Settings& settings) : EthercatDevice(settings) { slave().set_files(&parameter_file_); }

 private:
  friend EthercatDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  drive::Configuration configuration() const;

  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;

  // --- ethercat::SlaveEvents
  void state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time now) override;

  double set_point_period_s_ = 0.0;  // of SYNC0; 0: 60C2h
  ParameterFile parameter_file_{dictionary(), drive(), settings().store};
};

}  // namespace servodrome::products
