#pragma once

#include "products/can_device.hpp"
#include "products/ismk/device.hpp"

namespace servodrome::products {

class Ismk;
using IsmkOnCan = IsmkDevice<CanDevice<Ismk, ismk::Objects>>;

// Kinco iSMK integrated servo, variant AA: CANopen and RS485.
class Ismk final : public IsmkOnCan {
 public:
  static constexpr std::span<const dictionary::Entry> table{ismk::object_table};
  static constexpr drive::Policy policy = ismk::make_policy();
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr canopen::Profile profile{
      .rpdo_types = {.reserved = true},  // "all 256" (ch. 9.3.3.3)
      .tpdo_types = {.reserved = true},
      .inhibit_time_unit = std::chrono::milliseconds(1),  // Table 9-14, ch. 9.3.3.3
      .sdo_block = false,                                 // five services, ch. 9.3.2
      .sdo_download_response_echoes_data = true,          // ch. 9.3.2
      .sdo_expedited_upload_sign_extends = true,          // Table 9-9, ch. 9.3.2
      .time_consumer = false,
      .lss = false};
  static constexpr std::uint8_t factory_node_id = 1;          // ch. 4.1.2.1
  static constexpr std::uint32_t factory_bit_rate = 500'000;  // Table 9-26, 2F81h

  explicit Ismk(const Settings& settings) : IsmkOnCan(settings) {}

 private:
  friend CanDevice;
  friend ServoDevice;

  std::uint8_t chosen_node_id() const { return static_cast<std::uint8_t>(objects().servo.buses.station); }
  std::uint32_t chosen_bit_rate() const;

  // --- canopen::DeviceEvents
  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override;
  void sync(std::uint8_t counter, Time now) override;
  canopen::LossReaction communication_lost(canopen::LossCause cause, canopen::LossReaction standard) override;

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override;
  void errors_gone(std::uint8_t remaining) override;
};

}  // namespace servodrome::products
