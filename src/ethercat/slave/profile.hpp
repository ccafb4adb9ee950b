#pragma once

#include <cstdint>
#include <span>

#include "ethercat/slave/al_status.hpp"
#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// Required start and permitted length of a sync manager's area.
struct AreaRule {
  std::uint16_t start = 0;
  std::uint16_t least_length = 0;
  std::uint16_t greatest_length = 0;
};

// Types of synchronisation as bits of 1C32h sub-index 4 (ETG.1020 table 72).
namespace sync_support {
inline constexpr std::uint16_t free_run = 0x0001;
inline constexpr std::uint16_t sync_manager = 0x0002;
inline constexpr std::uint16_t dc_sync0 = 0x0004;
inline constexpr std::uint16_t local_shift = 0x0020;  // sub-index 3 shifts, with a timer of the slave
}  // namespace sync_support

// An object that a master writes when it starts the slave: recommended in the ESI file and in list 5 of the SDO
// information. `transition` as in the ESI file: "IP", "PS", "SO" and the reverse.
struct StartUpParameter {
  const char* transition = "PS";
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::int64_t value = 0;  // of the entry's type
  const char* comment = "";
};

// Features and requirements of a slave; its SII image and ESI file contain the same values.
struct Profile {
  AreaRule mailbox_out{0x1000, 34, 256};  // sync manager 0: master to slave
  AreaRule mailbox_in{0x1100, 34, 256};   // sync manager 1
  bool bootstrap = false;
  AreaRule bootstrap_out{0x1000, 34, 256};
  AreaRule bootstrap_in{0x1100, 34, 256};
  std::uint16_t outputs_start = 0x1200;  // sync manager 2, three buffers
  std::uint16_t inputs_start = 0x1500;   // sync manager 3
  std::uint16_t greatest_outputs = 256;  // bytes of process data
  std::uint16_t greatest_inputs = 256;
  std::uint16_t greatest_pdo = 0xFFFF;  // bytes of one PDO

  bool file_access = false;  // FoE, as announced in the SII image and the ESI file; see Slave::set_files
  bool complete_access = true;
  // Accepts a mapped length that differs from the object's: maps its low bits, or adds zeros above them.
  bool mapped_length_may_differ = false;
  std::uint32_t empty_mapping = 0;  // a second value, besides 0, of a mapping entry that maps nothing

  std::span<const StartUpParameter> start_up{};

  std::uint16_t synchronisation = sync_support::free_run | sync_support::sync_manager | sync_support::dc_sync0;
  Time least_cycle{std::chrono::microseconds(125)};
  AlStatusCode cycle_too_short = AlStatusCode::invalid_sync0_cycle_time;  // refuses a shorter cycle
  // Greatest time that the change from Safe-Operational to Operational waits for outputs, and with DC for SYNC0.
  Time operational_timeout{std::chrono::seconds(5)};

  // Sets the greatest outputs and inputs: three buffers of each fit into the memory behind their starts.
  constexpr void fit_process_data() {
    constexpr unsigned end = 0x3000;  // of the 8 KiB of memory from 1000h on
    const auto room = [](unsigned from, unsigned to) {
      return static_cast<std::uint16_t>(to > from ? (to - from) / 3 : 0);
    };
    const bool outputs_first = outputs_start < inputs_start;
    greatest_outputs = room(outputs_start, outputs_first ? inputs_start : end);
    greatest_inputs = room(inputs_start, outputs_first ? end : outputs_start);
  }
};

}  // namespace servodrome::ethercat
