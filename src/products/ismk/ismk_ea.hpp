#pragma once

#include "products/ethercat_device.hpp"
#include "products/ismk/device.hpp"
#include "products/ismk/ethercat_objects.hpp"

namespace servodrome::products {

class IsmkEa;
using IsmkOnEthercat = IsmkDevice<EthercatDevice<IsmkEa, ismk::EthercatObjects>>;

// Kinco iSMK integrated servo, variant EA: EtherCAT and RS485.
class IsmkEa final : public IsmkOnEthercat {
 public:
  static constexpr std::span<const dictionary::Entry> table{ismk::ethercat_object_table};
  // The manual's modes and cyclic synchronous position, which masters on EtherCAT expect.
  static constexpr drive::Policy policy = [] {
    drive::Policy made = ismk::make_policy();
    made.modes.supported |= drive::mode_bit(drive::Mode::cyclic_sync_position);
    return made;
  }();
  static constexpr dictionary::LengthAborts length_aborts{};
  // Start-up commands for a master to send before its positions: interpolation (mode 7) and the period of set-points.
  static constexpr auto start_up = std::to_array<ethercat::StartUpParameter>({
      {"PS", 0x6060, 0, 7, "Mode: interpolated position"},
      {"PS", 0x3011, 1, 0, "Set-points every 2^0 ms"},
      {"PS", 0x3011, 2, 1, "Taken over with each cycle"},
  });
  static constexpr ethercat::Profile ethercat_profile{.start_up = start_up};
  static ethercat::SiiDescription sii_description(const Settings& settings);

  explicit IsmkEa(const Settings& settings) : IsmkOnEthercat(settings) {}

 private:
  friend EthercatDevice;
  friend ServoDevice;

  // --- ethercat::SlaveEvents
  void state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time now) override;
  void process_data(Time now) override;

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override;
  void errors_gone(std::uint8_t remaining) override;
};

}  // namespace servodrome::products
