#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// Storage of the objects 1000h..1FFFh of a device: a plain struct that a product puts into its objects struct.
namespace servodrome::canopen {

// 1400h.. and 1800h.. (CiA 301 tables 66 and 71). RPDOs leave sub-index 6 unused.
struct PdoParameters {
  std::uint32_t cob_id = 0;
  std::uint8_t transmission_type = 0;
  std::uint8_t sync_start_value = 0;
  std::uint16_t inhibit_time = 0;  // TPDO: in the profile's unit, normally 100 us
  std::uint16_t event_timer = 0;   // ms
};

// 1600h.. and 1A00h..: index << 16 | sub-index << 8 | length in bits.
template <std::size_t MappingEntries>
struct PdoMapping {
  std::uint8_t count = 0;
  std::array<std::uint32_t, MappingEntries> objects{};
};

template <std::size_t Rpdos = 4, std::size_t Tpdos = 4, std::size_t MappingEntries = 8,
          std::size_t HeartbeatConsumers = 1, std::size_t ErrorHistory = 4>
struct CommunicationObjects {
  static constexpr std::size_t rpdo_count = Rpdos;
  static constexpr std::size_t tpdo_count = Tpdos;
  static constexpr std::size_t mapping_entries = MappingEntries;
  static constexpr std::size_t heartbeat_consumer_count = HeartbeatConsumers;
  static constexpr std::size_t error_history = ErrorHistory;

  std::uint32_t device_type = 0;                   // 1000h
  std::uint8_t error_register = 0;                 // 1001h
  std::uint8_t predefined_error_count = 0;         // 1003h sub 0
  std::uint32_t manufacturer_status_register = 0;  // 1002h
  std::array<std::uint32_t, ErrorHistory> predefined_error_field{};
  std::uint32_t cob_id_sync = 0x80;                                         // 1005h
  std::uint32_t communication_cycle_period_us = 0;                          // 1006h
  std::uint32_t synchronous_window_length_us = 0;                           // 1007h
  std::uint16_t guard_time_ms = 0;                                          // 100Ch
  std::uint8_t life_time_factor = 0;                                        // 100Dh
  std::uint8_t synchronous_counter_overflow = 0;                            // 1019h
  std::uint32_t cob_id_time = 0x80000100;                                   // 1012h
  std::uint32_t cob_id_emergency = 0x80;                                    // 1014h
  std::uint16_t emergency_inhibit_time = 0;                                 // 1015h, 100 us
  std::uint16_t producer_heartbeat_time_ms = 0;                             // 1017h
  std::array<std::uint32_t, HeartbeatConsumers> consumer_heartbeat_time{};  // 1016h
  std::uint32_t vendor_id = 0;                                              // 1018h
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  std::uint32_t configuration_date = 0;  // 1020h
  std::uint32_t configuration_time = 0;
  std::array<std::uint32_t, HeartbeatConsumers> emergency_consumer{};  // 1028h
  std::uint8_t communication_error_behaviour = 0;                      // 1029h sub 1
  std::uint32_t sdo_cob_id_client_to_server = 0x600;                   // 1200h
  std::uint32_t sdo_cob_id_server_to_client = 0x580;
  std::array<PdoParameters, Rpdos> rpdo_parameters{};             // 1400h..
  std::array<PdoMapping<MappingEntries>, Rpdos> rpdo_mappings{};  // 1600h..
  std::array<PdoParameters, Tpdos> tpdo_parameters{};             // 1800h..
  std::array<PdoMapping<MappingEntries>, Tpdos> tpdo_mappings{};  // 1A00h..
};

}  // namespace servodrome::canopen
