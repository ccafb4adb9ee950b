#include "master/ethercat/al_state.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::load_u16;

namespace {

constexpr std::uint16_t acknowledge_bit = 0x10;
constexpr Time al_state_poll_interval = std::chrono::microseconds(500);
constexpr std::array states{AlState::init, AlState::pre_operational, AlState::bootstrap, AlState::safe_operational,
                            AlState::operational};

void command(EthercatMaster& master, std::uint16_t station, AlState state, bool acknowledge) {
  const auto control = static_cast<std::uint16_t>(static_cast<unsigned>(state) | (acknowledge ? acknowledge_bit : 0U));
  master.write<std::uint16_t>(station, reg::al_control, control);
}

[[noreturn]] void refuse(EthercatMaster& master, std::uint16_t station, const std::string& doing,
                         const AlStatus& status) {
  throw EthercatError(EthercatError::Kind::refused, fmt::format("{}: it is in {}", doing, text_of(status)),
                      slave_text(master, station), remedy_of(status.code));
}

}  // namespace

const char* short_name(AlState state) {
  switch (state) {
    case AlState::init: return "INIT";
    case AlState::pre_operational: return "PREOP";
    case AlState::bootstrap: return "BOOT";
    case AlState::safe_operational: return "SAFEOP";
    case AlState::operational: return "OP";
  }
  return "no state";
}

std::optional<AlState> parse_al_state(std::string_view word) {
  std::string upper(word);
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const AlState state : states) {
    if (upper == short_name(state)) return state;
  }
  return std::nullopt;
}

std::string text_of(const AlStatus& status) {
  if (!status.error()) return short_name(status.state());
  return fmt::format("{} with error {:04X}h {}", short_name(status.state()), static_cast<unsigned>(status.code),
                     text(status.code));
}

const char* remedy_of(AlStatusCode code) {
  switch (code) {
    case AlStatusCode::none: return "look at the drive's own fault display, and try again";
    case AlStatusCode::unspecified:
    case AlStatusCode::no_memory:
    case AlStatusCode::application_controller_available:
      return "switch it off and on; if it occurs again, ask its manufacturer";
    case AlStatusCode::invalid_device_setup:
    case AlStatusCode::module_list_does_not_match: return "compare its modules and hardware with the configuration";
    case AlStatusCode::invalid_revision:
    case AlStatusCode::sii_does_not_match_firmware:
      return "use the ESI file that belongs to its firmware, and write its SII again";
    case AlStatusCode::firmware_update_failed:
    case AlStatusCode::no_valid_firmware: return "load its firmware in Bootstrap (FoE)";
    case AlStatusCode::license_error: return "ask its manufacturer for a license";
    case AlStatusCode::invalid_requested_state_change:
      return "go one step at a time: INIT, PREOP, SAFEOP, OP; BOOT is reached from INIT only";
    case AlStatusCode::unknown_requested_state: return "request INIT, PREOP, BOOT, SAFEOP or OP";
    case AlStatusCode::bootstrap_not_supported: return "the device has no Bootstrap: leave it out";
    case AlStatusCode::invalid_mailbox_configuration_bootstrap:
    case AlStatusCode::invalid_mailbox_configuration:
      return "set up sync managers 0 and 1 with address and length of its SII (or ESI file)";
    case AlStatusCode::invalid_sync_manager_configuration:
    case AlStatusCode::invalid_sync_manager_types:
      return "set up sync managers 2 and 3 as its SII and 1C00h say: address, length, direction, three buffers";
    case AlStatusCode::no_valid_inputs:
    case AlStatusCode::no_valid_outputs:
    case AlStatusCode::no_valid_inputs_and_outputs:
      return "send process data with valid outputs before and while it goes to OP";
    case AlStatusCode::synchronization_error:
    case AlStatusCode::fatal_sync_error:
      return "send outputs in every cycle at the same distance from SYNC0, keep the clocks synchronised, or raise "
             "10F1h";
    case AlStatusCode::sync_manager_watchdog:
      return "send process data in time: see whether frames are lost or the master was stopped; then acknowledge";
    case AlStatusCode::invalid_output_configuration:
    case AlStatusCode::invalid_output_mapping:
      return "check 1C12h, its RxPDOs (1600h to 17FFh) and the length of sync manager 2";
    case AlStatusCode::invalid_input_configuration:
    case AlStatusCode::invalid_input_mapping:
      return "check 1C13h, its TxPDOs (1A00h to 1BFFh) and the length of sync manager 3";
    case AlStatusCode::invalid_input_fmmu_configuration: return "set up its FMMUs over sync managers 2 and 3";
    case AlStatusCode::invalid_watchdog_configuration:
    case AlStatusCode::background_watchdog: return "check 0400h, 0420h and the watchdog bit of sync manager 2";
    case AlStatusCode::needs_cold_start: return "switch it off and on";
    case AlStatusCode::needs_init: return "take it to INIT and start again";
    case AlStatusCode::needs_pre_operational: return "take it to PREOP and go on from there";
    case AlStatusCode::needs_safe_operational: return "take it to SAFEOP and go on from there";
    case AlStatusCode::inconsistent_settings: return "compare its parameters with each other: cycle times, PDOs, modes";
    case AlStatusCode::free_run_not_supported:
      return "start SYNC0 (distributed clocks), or synchronise with SM2 events";
    case AlStatusCode::synchronization_not_supported: return "leave SYNC0 off: free run (1C32h:01 = 0)";
    case AlStatusCode::free_run_needs_three_buffers: return "give sync managers 2 and 3 three buffers";
    case AlStatusCode::no_sync: return "start SYNC0 before SAFEOP, and keep sending the frame with the reference time";
    case AlStatusCode::invalid_dc_sync_configuration:
    case AlStatusCode::invalid_dc_latch_configuration:
    case AlStatusCode::dc_sync_io_error:
    case AlStatusCode::dc_sync_timeout:
      return "set 0980h, 0981h and 1C32h as one of its DC modes (ESI, SII category 60) says";
    case AlStatusCode::pll_error: return "keep the cycle steady, and wait until the clocks are synchronised before OP";
    case AlStatusCode::invalid_sync_cycle_time:
    case AlStatusCode::invalid_sync0_cycle_time:
    case AlStatusCode::invalid_sync1_cycle_time:
      return "choose a cycle time it can do: 1C32h:05 is the shortest, see its manual";
    case AlStatusCode::mailbox_aoe:
    case AlStatusCode::mailbox_eoe:
    case AlStatusCode::mailbox_coe:
    case AlStatusCode::mailbox_foe:
    case AlStatusCode::mailbox_soe:
    case AlStatusCode::mailbox_voe: return "take it to INIT and PREOP again, which resets its mailbox";
    case AlStatusCode::eeprom_no_access: return "give the SII back to the slave: 0500h = 1";
    case AlStatusCode::eeprom_error: return "write its SII again; the checksum or the content is wrong";
    case AlStatusCode::external_hardware_not_ready: return "switch on its power stage or the device that it waits for";
    case AlStatusCode::restarted_locally: return "acknowledge the error and start it again from INIT";
    case AlStatusCode::identification_updated:
      return "switch it off and on, so that its new identification takes effect";
    case AlStatusCode::supply_voltage_too_low:
    case AlStatusCode::supply_voltage_too_high: return "check its supply";
    case AlStatusCode::temperature_too_low:
    case AlStatusCode::temperature_too_high: return "check its temperature, cooling and load";
  }
  return "see its manual for this AL status code";
}

bool is_transient(AlStatusCode code) {
  constexpr std::array codes{AlStatusCode::no_valid_inputs,
                             AlStatusCode::no_valid_outputs,
                             AlStatusCode::no_valid_inputs_and_outputs,
                             AlStatusCode::synchronization_error,
                             AlStatusCode::sync_manager_watchdog,
                             AlStatusCode::fatal_sync_error,
                             AlStatusCode::no_sync,
                             AlStatusCode::pll_error};
  return std::find(codes.begin(), codes.end(), code) != codes.end();
}

AlStatus read_al_status(EthercatMaster& master, std::uint16_t station) {
  std::array<std::uint8_t, 6> bytes{};
  master.read(station, reg::al_status, bytes);
  return {.status = load_u16(bytes.data()), .code = static_cast<AlStatusCode>(load_u16(&bytes[4]))};
}

void acknowledge_error(EthercatMaster& master, std::uint16_t station, Time timeout) {
  const Time deadline = master.now() + timeout;
  AlStatus status = read_al_status(master, station);
  if (!status.error()) return;
  command(master, station, status.state(), true);
  for (status = read_al_status(master, station); status.error(); status = read_al_status(master, station)) {
    if (master.now() >= deadline) refuse(master, station, "the error cannot be acknowledged", status);
    master.wait(al_state_poll_interval);
  }
}

void request_state(EthercatMaster& master, std::uint16_t station, AlState state, Time timeout) {
  acknowledge_error(master, station, timeout);
  command(master, station, state, false);
  const Time deadline = master.now() + timeout;
  while (true) {
    const AlStatus status = read_al_status(master, station);
    if (status.state() == state && !status.error()) return;
    if (status.error()) refuse(master, station, fmt::format("it does not go to {}", short_name(state)), status);
    if (master.now() >= deadline) {
      refuse(master, station,
             fmt::format("it is not in {} after {} ms", short_name(state), timeout / std::chrono::milliseconds(1)),
             status);
    }
    master.wait(al_state_poll_interval);
  }
}

}  // namespace servodrome::master
