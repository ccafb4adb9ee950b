#include "ethercat/slave/al_status.hpp"

namespace servodrome::ethercat {

const char* text(AlState state) {
  switch (state) {
    case AlState::init: return "Init";
    case AlState::pre_operational: return "Pre-Operational";
    case AlState::bootstrap: return "Bootstrap";
    case AlState::safe_operational: return "Safe-Operational";
    case AlState::operational: return "Operational";
  }
  return "unknown state";
}

const char* text(AlStatusCode code) {
  switch (code) {
    case AlStatusCode::none: return "no error";
    case AlStatusCode::unspecified: return "unspecified error";
    case AlStatusCode::no_memory: return "no memory";
    case AlStatusCode::invalid_device_setup: return "invalid device setup";
    case AlStatusCode::invalid_revision: return "invalid revision";
    case AlStatusCode::sii_does_not_match_firmware: return "SII information does not match the firmware";
    case AlStatusCode::firmware_update_failed: return "firmware update not successful, the old one runs";
    case AlStatusCode::license_error: return "license error";
    case AlStatusCode::invalid_requested_state_change: return "invalid requested state change";
    case AlStatusCode::unknown_requested_state: return "unknown requested state";
    case AlStatusCode::bootstrap_not_supported: return "bootstrap not supported";
    case AlStatusCode::no_valid_firmware: return "no valid firmware";
    case AlStatusCode::invalid_mailbox_configuration_bootstrap: return "invalid mailbox configuration (bootstrap)";
    case AlStatusCode::invalid_mailbox_configuration: return "invalid mailbox configuration";
    case AlStatusCode::invalid_sync_manager_configuration: return "invalid sync manager configuration";
    case AlStatusCode::no_valid_inputs: return "no valid inputs available";
    case AlStatusCode::no_valid_outputs: return "no valid outputs";
    case AlStatusCode::synchronization_error: return "synchronization error";
    case AlStatusCode::sync_manager_watchdog: return "sync manager watchdog";
    case AlStatusCode::invalid_sync_manager_types: return "invalid sync manager types";
    case AlStatusCode::invalid_output_configuration: return "invalid output configuration";
    case AlStatusCode::invalid_input_configuration: return "invalid input configuration";
    case AlStatusCode::invalid_watchdog_configuration: return "invalid watchdog configuration";
    case AlStatusCode::needs_cold_start: return "slave needs cold start";
    case AlStatusCode::needs_init: return "slave needs Init";
    case AlStatusCode::needs_pre_operational: return "slave needs Pre-Operational";
    case AlStatusCode::needs_safe_operational: return "slave needs Safe-Operational";
    case AlStatusCode::invalid_input_mapping: return "invalid input mapping";
    case AlStatusCode::invalid_output_mapping: return "invalid output mapping";
    case AlStatusCode::inconsistent_settings: return "inconsistent settings";
    case AlStatusCode::free_run_not_supported: return "free run not supported";
    case AlStatusCode::synchronization_not_supported: return "synchronization not supported";
    case AlStatusCode::free_run_needs_three_buffers: return "free run needs three-buffer mode";
    case AlStatusCode::background_watchdog: return "background watchdog";
    case AlStatusCode::no_valid_inputs_and_outputs: return "no valid inputs and outputs";
    case AlStatusCode::fatal_sync_error: return "fatal synchronization error";
    case AlStatusCode::no_sync: return "no synchronization signal";
    case AlStatusCode::invalid_input_fmmu_configuration: return "invalid input FMMU configuration";
    case AlStatusCode::invalid_dc_sync_configuration: return "invalid DC SYNC configuration";
    case AlStatusCode::invalid_dc_latch_configuration: return "invalid DC latch configuration";
    case AlStatusCode::pll_error: return "PLL error";
    case AlStatusCode::dc_sync_io_error: return "DC SYNC IO error";
    case AlStatusCode::dc_sync_timeout: return "DC SYNC timeout";
    case AlStatusCode::invalid_sync_cycle_time: return "DC invalid SYNC cycle time";
    case AlStatusCode::invalid_sync0_cycle_time: return "DC invalid SYNC0 cycle time";
    case AlStatusCode::invalid_sync1_cycle_time: return "DC invalid SYNC1 cycle time";
    case AlStatusCode::mailbox_aoe: return "mailbox error, AoE";
    case AlStatusCode::mailbox_eoe: return "mailbox error, EoE";
    case AlStatusCode::mailbox_coe: return "mailbox error, CoE";
    case AlStatusCode::mailbox_foe: return "mailbox error, FoE";
    case AlStatusCode::mailbox_soe: return "mailbox error, SoE";
    case AlStatusCode::mailbox_voe: return "mailbox error, VoE";
    case AlStatusCode::eeprom_no_access: return "EEPROM no access";
    case AlStatusCode::eeprom_error: return "EEPROM error";
    case AlStatusCode::external_hardware_not_ready: return "external hardware not ready";
    case AlStatusCode::restarted_locally: return "slave restarted locally";
    case AlStatusCode::identification_updated: return "device identification value updated";
    case AlStatusCode::module_list_does_not_match: return "detected module ident list does not match";
    case AlStatusCode::supply_voltage_too_low: return "supply voltage too low";
    case AlStatusCode::supply_voltage_too_high: return "supply voltage too high";
    case AlStatusCode::temperature_too_low: return "temperature too low";
    case AlStatusCode::temperature_too_high: return "temperature too high";
    case AlStatusCode::application_controller_available: return "application controller available";
  }
  return "unknown AL status code";
}

}  // namespace servodrome::ethercat
