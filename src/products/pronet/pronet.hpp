#pragma once

#include "products/can_device.hpp"
#include "products/pronet/objects.hpp"

namespace servodrome::products {

// ESTUN ProNet servo drive with CANopen (manual V1.04).
class Pronet final : public CanDevice<Pronet, pronet::Objects> {
 public:
  static constexpr std::span<const dictionary::Entry> table{pronet::object_table};
  static constexpr drive::Policy policy = pronet::make_policy();
  static constexpr dictionary::LengthAborts length_aborts{};  // ch. 3.2
  static constexpr canopen::Profile profile{
      .rpdo_types = {.acyclic_synchronous = false,
                     .synchronous_remote = false,
                     .asynchronous_remote = false,
                     .manufacturer_event_driven = false},
      .tpdo_types = {.acyclic_synchronous = false,
                     .synchronous_remote = false,
                     .asynchronous_remote = false},  // ch. 3.3, 'Transmit type of PDO' (C4)
      .remote_frames = false,                        // ch. 3
      .valid_pdo_may_be_remapped = true,             // ch. 3.3, 'PDO mapping case'
      .valid_pdo_parameters_may_change = true,       // ch. 3.3, 'PDO mapping case'
      .padded_mappings = pronet::padded_mappings,    // C7
      .cob_id_ranges = pronet::cob_id_ranges,        // ch. 3.3, 1800h
      .rpdo_excess_length_is_reported = false,       // 8220h is not in the list of ch. 3.5
      .type_255_sends_on_change = false,             // but by the event time (ch. 3.3)
      .sdo_block = false,                            // ch. 3.2
      .sdo_timeout = std::chrono::seconds(0),        // 0504 0000h is not in the list of ch. 3.2
      .sync_producer = false,                        // ch. 3.4, 1005h
      .sync_cob_id_fixed = true,
      .time_consumer = false,
      .error_reset_tells_the_last_only = true,
      .bus_off_is_reported_on_recovery = false,                // 8140h is an alarm of the drive
      .frame_length_code = 0x8200,                             // ch. 3.5
      .consumers_have_possible_nodes = true,                   // 1016h
      .node_guarding = canopen::NodeGuarding::absent,          // ch. 3
      .reset_communication_restores = dictionary::Area::none,  // ch. 3.7 and 9.2
      .lss = false};
  static constexpr std::uint8_t factory_node_id = 1;            // ch. 9
  static constexpr std::uint32_t factory_bit_rate = 1'000'000;  // not printed

  explicit Pronet(const Settings& settings) : CanDevice(settings) {}

  void power_on(const drive::Feedback& feedback, Time now) override;

 private:
  friend CanDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  void loaded(dictionary::Area areas);
  void limit_torque();
  drive::Configuration configuration() const;
  std::uint8_t chosen_node_id() const;
  std::uint32_t chosen_bit_rate() const;

  void apply_transmit_masks();
  void record_alarm(const drive::FaultRow& row);

  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override;
  void fault_raised(const drive::FaultRow& fault) override;
  void warning_raised(const drive::FaultRow& warning) override;
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;

  drive::Counts encoder_zero_ = 0;  // where an incremental encoder was at power-on
};

}  // namespace servodrome::products
