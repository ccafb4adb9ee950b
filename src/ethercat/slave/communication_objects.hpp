#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace servodrome::ethercat {

// 1C32h and 1C33h (ETG.1020 table 72).
struct SyncParameters {
  std::uint16_t type = 0;
  std::uint32_t cycle_time_ns = 0;
  std::uint32_t shift_time_ns = 0;
  std::uint16_t types_supported = 0;
  std::uint32_t least_cycle_time_ns = 0;
  std::uint32_t calc_and_copy_time_ns = 0;
  std::uint32_t least_delay_time_ns = 0;
  std::uint16_t get_cycle_time = 0;
  std::uint32_t delay_time_ns = 0;
  std::uint32_t sync0_cycle_time_ns = 0;
  std::uint16_t events_missed = 0;
  std::uint16_t cycle_too_short = 0;
  std::uint16_t shift_too_short = 0;
  bool sync_error = false;
};

// Sub-indices of 1C32h and 1C33h.
namespace sync_parameter {
inline constexpr std::uint8_t type = 0x01;
inline constexpr std::uint8_t cycle_time = 0x02;
inline constexpr std::uint8_t shift_time = 0x03;
inline constexpr std::uint8_t types_supported = 0x04;
inline constexpr std::uint8_t least_cycle_time = 0x05;
inline constexpr std::uint8_t calc_and_copy_time = 0x06;
inline constexpr std::uint8_t least_delay_time = 0x07;
inline constexpr std::uint8_t get_cycle_time = 0x08;
inline constexpr std::uint8_t delay_time = 0x09;
inline constexpr std::uint8_t sync0_cycle_time = 0x0A;
inline constexpr std::uint8_t events_missed = 0x0B;
inline constexpr std::uint8_t cycle_too_short = 0x0C;
inline constexpr std::uint8_t shift_too_short = 0x0D;
inline constexpr std::uint8_t sync_error = 0x20;
}  // namespace sync_parameter

// The objects 1000h..1FFFh of a CoE slave (ETG.1000.6 clause 5.6.7).
template <std::size_t RxPdos, std::size_t TxPdos, std::size_t MappingEntries, std::size_t Assigned>
struct CommunicationObjects {
  static constexpr std::size_t rx_pdos = RxPdos;
  static constexpr std::size_t tx_pdos = TxPdos;
  static constexpr std::size_t mapping_entries = MappingEntries;
  static constexpr std::size_t assigned = Assigned;

  struct Mapping {
    std::array<std::uint32_t, MappingEntries> entry{};
    std::uint8_t count = 0;
  };
  struct Assignment {
    std::array<std::uint16_t, Assigned> pdo{};
    std::uint8_t count = 0;
  };

  std::uint32_t device_type = 0;
  std::uint8_t error_register = 0;
  std::uint32_t vendor_id = 0;
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  std::uint32_t local_error_reaction = 0;
  std::uint16_t sync_error_limit = 0;
  std::array<Mapping, RxPdos> rx_mapping{};
  std::array<Mapping, TxPdos> tx_mapping{};
  Assignment rx_assignment;
  Assignment tx_assignment;
  SyncParameters output_sync;
  SyncParameters input_sync;
};

}  // namespace servodrome::ethercat
