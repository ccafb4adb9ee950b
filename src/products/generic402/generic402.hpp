#pragma once

#include "products/can_device.hpp"
#include "products/generic402/objects.hpp"
#include "products/generic402/registers.hpp"
#include "products/generic402/servo.hpp"

namespace servodrome::products {

// The reference drive: strictly CiA 301, 305 and 402-2, with every mode, homing method and service.
class Generic402 final : public CanDevice<Generic402, generic402::Objects, 1024> {
 public:
  static constexpr std::span<const dictionary::Entry> table{generic402::object_table};
  static constexpr const drive::Policy& policy = generic402::policy;
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr canopen::Profile profile{};
  static constexpr std::uint8_t factory_node_id = 2;
  static constexpr std::uint32_t factory_bit_rate = 1'000'000;

  static constexpr std::span<const modbus::Register> registers{generic402::registers};
  static constexpr modbus::Profile modbus_profile{.identification = generic402::identification};

  explicit Generic402(const Settings& settings) : CanDevice(settings) {}

  void power_on(const drive::Feedback& feedback, Time now) override;
  SerialPort* serial_port() override { return &serial_port_; }
  Lamps lamps(Time now) override;

 private:
  friend CanDevice;
  friend ServoDevice;

  void open_serial_port();
  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override;

  void prepare(dictionary::Area areas);
  drive::Configuration configuration() const;
  std::uint8_t chosen_node_id() const { return objects().manufacturer.node_id; }
  std::uint32_t chosen_bit_rate() const { return objects().manufacturer.bit_rate; }

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;
  std::span<const std::byte> domain(const dictionary::Entry& entry) override;

  bool lss_bit_timing_supported(std::uint8_t index) override;
  canopen::LssStore lss_store(std::uint8_t node_id, std::uint8_t bit_timing_index) override;
  void lss_activate_bit_timing(std::uint8_t index, Time delay, Time now) override;

  SerialPort serial_port_{dictionary(), registers, modbus_profile};
};

}  // namespace servodrome::products
