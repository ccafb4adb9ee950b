#pragma once

#include <cstddef>
#include <cstdint>

// Addresses and bits of a slave controller's registers (ETG.1000.4 clause 6, tables 31 to 63).
namespace servodrome::ethercat::reg {

// Information
inline constexpr std::uint16_t type = 0x0000;
inline constexpr std::uint16_t revision = 0x0001;
inline constexpr std::uint16_t build = 0x0002;
inline constexpr std::uint16_t fmmu_count = 0x0004;
inline constexpr std::uint16_t sync_manager_count = 0x0005;
inline constexpr std::uint16_t ram_size = 0x0006;
inline constexpr std::uint16_t port_descriptor = 0x0007;
inline constexpr std::uint16_t features = 0x0008;
inline constexpr std::uint16_t station_address = 0x0010;
inline constexpr std::uint16_t station_alias = 0x0012;
inline constexpr std::uint16_t register_write_enable = 0x0020;
inline constexpr std::uint16_t register_write_protection = 0x0021;
inline constexpr std::uint16_t write_enable = 0x0030;
inline constexpr std::uint16_t write_protection = 0x0031;
inline constexpr std::uint16_t reset_ecat = 0x0040;
inline constexpr std::uint16_t reset_pdi = 0x0041;

// Data link and application layer
inline constexpr std::uint16_t dl_control = 0x0100;
inline constexpr std::uint16_t physical_offset = 0x0108;
inline constexpr std::uint16_t dl_status = 0x0110;
inline constexpr std::uint16_t al_control = 0x0120;
inline constexpr std::uint16_t al_status = 0x0130;
inline constexpr std::uint16_t al_status_code = 0x0134;
inline constexpr std::uint16_t run_led_override = 0x0138;
inline constexpr std::uint16_t err_led_override = 0x0139;
inline constexpr std::uint16_t pdi_control = 0x0140;
inline constexpr std::uint16_t esc_configuration = 0x0141;
inline constexpr std::uint16_t pdi_configuration = 0x0150;

// Events
inline constexpr std::uint16_t ecat_event_mask = 0x0200;
inline constexpr std::uint16_t al_event_mask = 0x0204;
inline constexpr std::uint16_t ecat_event_request = 0x0210;
inline constexpr std::uint16_t al_event_request = 0x0220;

// Error counters
inline constexpr std::uint16_t rx_errors = 0x0300;            // per port: invalid frames, then RX errors
inline constexpr std::uint16_t forwarded_rx_errors = 0x0308;  // per port
inline constexpr std::uint16_t processing_unit_errors = 0x030C;
inline constexpr std::uint16_t pdi_errors = 0x030D;
inline constexpr std::uint16_t lost_links = 0x0310;  // per port

// Watchdogs
inline constexpr std::uint16_t watchdog_divider = 0x0400;
inline constexpr std::uint16_t watchdog_pdi = 0x0410;
inline constexpr std::uint16_t watchdog_process_data = 0x0420;
inline constexpr std::uint16_t watchdog_status = 0x0440;
inline constexpr std::uint16_t watchdog_process_data_count = 0x0442;
inline constexpr std::uint16_t watchdog_pdi_count = 0x0443;

// Slave information interface
inline constexpr std::uint16_t sii_configuration = 0x0500;
inline constexpr std::uint16_t sii_pdi_access = 0x0501;
inline constexpr std::uint16_t sii_control = 0x0502;
inline constexpr std::uint16_t sii_address = 0x0504;
inline constexpr std::uint16_t sii_data = 0x0508;

inline constexpr std::uint16_t fmmu = 0x0600;
inline constexpr unsigned fmmu_bytes = 16;
inline constexpr unsigned fmmus = 8;
inline constexpr std::uint16_t sync_manager = 0x0800;
inline constexpr unsigned sync_manager_bytes = 8;
inline constexpr unsigned sync_managers = 8;
// Registers of one sync manager (ETG.1000.4 table 58), to add to sync_manager_at().
inline constexpr unsigned sync_manager_length = 2;
inline constexpr unsigned sync_manager_status = 5;
inline constexpr unsigned sync_manager_activate = 6;
constexpr std::uint16_t sync_manager_at(unsigned number, unsigned offset = 0) {
  return static_cast<std::uint16_t>(sync_manager + sync_manager_bytes * number + offset);
}

// Distributed clock
inline constexpr std::uint16_t receive_time_port = 0x0900;  // 4 bytes each
inline constexpr std::uint16_t system_time = 0x0910;
inline constexpr std::uint16_t receive_time_processing_unit = 0x0918;
inline constexpr std::uint16_t system_time_offset = 0x0920;
inline constexpr std::uint16_t system_time_delay = 0x0928;
inline constexpr std::uint16_t system_time_difference = 0x092C;
inline constexpr std::uint16_t speed_counter_start = 0x0930;
inline constexpr std::uint16_t speed_counter_difference = 0x0932;
inline constexpr std::uint16_t system_time_filter = 0x0934;
inline constexpr std::uint16_t speed_counter_filter = 0x0935;
inline constexpr std::uint16_t cyclic_unit_control = 0x0980;
inline constexpr std::uint16_t sync_activation = 0x0981;
inline constexpr std::uint16_t sync_pulse_length = 0x0982;
inline constexpr std::uint16_t sync_activation_status = 0x0984;
inline constexpr std::uint16_t sync0_status = 0x098E;
inline constexpr std::uint16_t sync1_status = 0x098F;
inline constexpr std::uint16_t sync_start_time = 0x0990;  // read: next SYNC0
inline constexpr std::uint16_t next_sync1 = 0x0998;
inline constexpr std::uint16_t sync0_cycle = 0x09A0;
inline constexpr std::uint16_t sync1_cycle = 0x09A4;
inline constexpr std::uint16_t latch0_control = 0x09A8;
inline constexpr std::uint16_t latch1_control = 0x09A9;
inline constexpr std::uint16_t latch0_status = 0x09AE;
inline constexpr std::uint16_t latch1_status = 0x09AF;
inline constexpr std::uint16_t latch_times = 0x09B0;  // 8 bytes each: 0 positive, 0 negative, 1 positive, 1 negative

inline constexpr std::uint16_t process_memory = 0x1000;  // registers end, process data RAM begins

// Bits of the ECAT event request (ETG.1000.4 table 38).
namespace ecat_event {
inline constexpr std::uint16_t latch = 0x0001;
inline constexpr std::uint16_t dl_status = 0x0004;
inline constexpr std::uint16_t al_status = 0x0008;
inline constexpr std::uint16_t sync_manager0 = 0x0010;
}  // namespace ecat_event

// Bits of the AL event request (ETG.1000.4 table 37).
namespace al_event {
inline constexpr std::uint32_t al_control = 0x0001;
inline constexpr std::uint32_t latch = 0x0002;
inline constexpr std::uint32_t sync0 = 0x0004;
inline constexpr std::uint32_t sync1 = 0x0008;
inline constexpr std::uint32_t sync_manager_activation = 0x0010;
inline constexpr std::uint32_t watchdog_process_data = 0x0040;
inline constexpr std::uint32_t sync_manager0 = 0x0100;
}  // namespace al_event

}  // namespace servodrome::ethercat::reg
