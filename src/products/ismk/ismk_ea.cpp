#include "products/ismk/ismk_ea.hpp"

namespace servodrome::products {

ethercat::SiiDescription IsmkEa::sii_description(const Settings& settings) {
  static constexpr std::array clock_modes{
      ethercat::DcMode{.name = "DC", .description = "DC-Synchron", .assign_activate = 0x0300, .sync0_factor = 1},
      ethercat::DcMode{.name = "FreeRun", .description = "FreeRun or SM-Synchron"},
  };
  return {.vendor_id = vendor_id,
          .product_code = ismk::ethercat_product_code,
          .revision_number = ismk::revision_number,
          .serial_number = settings.serial_number,
          .station_alias = settings.ethercat.station_alias,
          .group = "iSMK",
          .order = "iSMK-EA",
          .name = "Kinco iSMK integrated servo, EtherCAT",
          .dc_modes = clock_modes};
}

// As on CAN: with 6007h = 1 a lost master is an alarm, with 6007h = 0 its loss has no effect (Table 9-26; Table 10-2,
// bit 12). A master that leaves Operational while the axis is enabled counts as lost too.
void IsmkEa::state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time) {
  using ethercat::AlState;
  if (from == AlState::pre_operational && to == AlState::safe_operational) {
    servo().set_set_point_period(1e-9 * objects().communication.output_sync.sync0_cycle_time_ns);
  }
  const bool left_enabled = drive().energised() && drive().state() != drive::PowerState::fault_reaction_active;
  const bool lost = from == AlState::operational && (cause != ethercat::AlStatusCode::none || left_enabled);
  if (lost && objects().servo.drive.abort_connection_option_code == 1) drive().raise(drive::Cause::communication_lost);
}

void IsmkEa::process_data(Time now) {
  servo().sync(now);
  EthercatDevice::process_data(now);
}

void IsmkEa::fault_raised(const drive::FaultRow& fault) {
  servo().raise(fault);
  report(fault.code, fault.error_register, servo().emergency_bytes());
}

void IsmkEa::errors_gone(std::uint8_t remaining) {
  servo().alarms_gone();
  objects().communication.error_register = remaining;
  slave().emergency(0, remaining, servo().emergency_bytes());
}

}  // namespace servodrome::products
