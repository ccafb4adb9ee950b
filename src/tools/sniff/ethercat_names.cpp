#include "tools/sniff/ethercat_names.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "ethercat/esc/registers.hpp"
#include "master/ethercat/al_state.hpp"
#include "tools/sniff/decoded.hpp"

namespace servodrome::master {
namespace {

namespace reg = ethercat::reg;

struct RegisterName {
  std::uint16_t address;
  const char* name;
};

// Sorted by address; a register extends to the next one.
constexpr auto registers = std::to_array<RegisterName>({
    {reg::type, "type"},
    {reg::revision, "revision"},
    {reg::build, "build"},
    {reg::fmmu_count, "number of FMMUs"},
    {reg::sync_manager_count, "number of sync managers"},
    {reg::ram_size, "RAM size"},
    {reg::port_descriptor, "port descriptor"},
    {reg::features, "features"},
    {0x000A, nullptr},
    {reg::station_address, "station address"},
    {reg::station_alias, "station alias"},
    {0x0014, nullptr},
    {reg::register_write_enable, "register write enable"},
    {reg::register_write_protection, "register write protection"},
    {0x0022, nullptr},
    {reg::write_enable, "write enable"},
    {reg::write_protection, "write protection"},
    {0x0032, nullptr},
    {reg::reset_ecat, "reset"},
    {reg::reset_pdi, "reset by PDI"},
    {0x0042, nullptr},
    {reg::dl_control, "DL control"},
    {0x0104, nullptr},
    {reg::physical_offset, "physical read/write offset"},
    {0x010A, nullptr},
    {reg::dl_status, "DL status"},
    {0x0112, nullptr},
    {reg::al_control, "AL control"},
    {0x0122, nullptr},
    {reg::al_status, "AL status"},
    {0x0132, nullptr},
    {reg::al_status_code, "AL status code"},
    {0x0136, nullptr},
    {reg::run_led_override, "RUN LED override"},
    {reg::err_led_override, "ERR LED override"},
    {0x013A, nullptr},
    {reg::pdi_control, "PDI control"},
    {reg::esc_configuration, "ESC configuration"},
    {0x0142, nullptr},
    {reg::pdi_configuration, "PDI configuration"},
    {0x0154, nullptr},
    {reg::ecat_event_mask, "ECAT event mask"},
    {0x0202, nullptr},
    {reg::al_event_mask, "AL event mask"},
    {0x0208, nullptr},
    {reg::ecat_event_request, "ECAT event request"},
    {0x0212, nullptr},
    {reg::al_event_request, "AL event request"},
    {0x0224, nullptr},
    {reg::rx_errors, "RX error counters"},
    {reg::forwarded_rx_errors, "forwarded RX error counters"},
    {reg::processing_unit_errors, "processing unit error counter"},
    {reg::pdi_errors, "PDI error counter"},
    {0x030E, nullptr},
    {reg::lost_links, "lost link counters"},
    {0x0314, nullptr},
    {reg::watchdog_divider, "watchdog divider"},
    {0x0402, nullptr},
    {reg::watchdog_pdi, "watchdog time PDI"},
    {0x0412, nullptr},
    {reg::watchdog_process_data, "watchdog time process data"},
    {0x0422, nullptr},
    {reg::watchdog_status, "watchdog status"},
    {reg::watchdog_process_data_count, "watchdog counter process data"},
    {reg::watchdog_pdi_count, "watchdog counter PDI"},
    {0x0444, nullptr},
    {reg::sii_configuration, "SII configuration"},
    {reg::sii_pdi_access, "SII PDI access"},
    {reg::sii_control, "SII control"},
    {reg::sii_address, "SII address"},
    {reg::sii_data, "SII data"},
    {0x0510, nullptr},
    {reg::receive_time_port, "receive times"},
    {reg::system_time, "system time"},
    {reg::receive_time_processing_unit, "receive time of the processing unit"},
    {reg::system_time_offset, "system time offset"},
    {reg::system_time_delay, "system time delay"},
    {reg::system_time_difference, "system time difference"},
    {reg::speed_counter_start, "speed counter start"},
    {reg::speed_counter_difference, "speed counter difference"},
    {reg::system_time_filter, "system time difference filter"},
    {reg::speed_counter_filter, "speed counter filter"},
    {0x0936, nullptr},
    {reg::cyclic_unit_control, "cyclic unit control"},
    {reg::sync_activation, "SYNC activation"},
    {reg::sync_pulse_length, "SYNC pulse length"},
    {reg::sync_activation_status, "SYNC activation status"},
    {0x0985, nullptr},
    {reg::sync0_status, "SYNC0 status"},
    {reg::sync1_status, "SYNC1 status"},
    {reg::sync_start_time, "SYNC start time"},
    {reg::next_sync1, "next SYNC1"},
    {reg::sync0_cycle, "SYNC0 cycle time"},
    {reg::sync1_cycle, "SYNC1 cycle time"},
    {reg::latch0_control, "latch 0 control"},
    {reg::latch1_control, "latch 1 control"},
    {0x09AA, nullptr},
    {reg::latch0_status, "latch 0 status"},
    {reg::latch1_status, "latch 1 status"},
    {reg::latch_times, "latch times"},
    {0x09D0, nullptr},
});
static_assert(std::is_sorted(registers.begin(), registers.end(),
                             [](const RegisterName& a, const RegisterName& b) { return a.address < b.address; }));

}  // namespace

const char* name(ethercat::Command command) {
  constexpr std::array names{"NOP", "APRD", "APWR", "APRW", "FPRD", "FPWR", "FPRW", "BRD",
                             "BWR", "BRW",  "LRD",  "LWR",  "LRW",  "ARMW", "FRMW"};
  const auto number = static_cast<std::size_t>(command);
  return number < names.size() ? names[number] : nullptr;
}

std::string register_name(std::uint16_t address) {
  if (address >= reg::process_memory) return fmt::format("memory {:04X}h", address);
  const auto behind = [address](std::uint16_t first, unsigned bytes, const char* what) {
    const unsigned offset = (address - first) % bytes;
    const std::string name = fmt::format("{} {}", what, (address - first) / bytes);
    return offset == 0 ? name : fmt::format("{} +{}", name, offset);
  };
  if (address >= reg::fmmu && address < reg::fmmu + 16 * reg::fmmu_bytes)
    return behind(reg::fmmu, reg::fmmu_bytes, "FMMU");
  if (address >= reg::sync_manager && address < reg::sync_manager + 16 * reg::sync_manager_bytes) {
    if (address % reg::sync_manager_bytes == 5) {
      return fmt::format("sync manager {} status", (address - reg::sync_manager) / reg::sync_manager_bytes);
    }
    return behind(reg::sync_manager, reg::sync_manager_bytes, "sync manager");
  }
  const auto after = std::upper_bound(registers.begin(), registers.end(), address,
                                      [](unsigned wanted, const RegisterName& row) { return wanted < row.address; });
  if (after == registers.begin() || std::prev(after)->name == nullptr) return fmt::format("register {:04X}h", address);
  const RegisterName& row = *std::prev(after);
  return row.address == address ? row.name : fmt::format("{} +{}", row.name, address - row.address);
}

std::string register_text(std::uint16_t address, std::span<const std::uint8_t> data) {
  if (address == reg::al_control && data.size() >= 2) {
    const unsigned word = ethercat::load_u16(data.data());
    return fmt::format("AL control {}{}", short_name(static_cast<AlState>(word & 0x0F)),
                       (word & 0x10) != 0 ? ", acknowledges the error" : "");
  }
  if (address == reg::al_status && data.size() >= 2) {
    AlStatus status{.status = ethercat::load_u16(data.data())};
    if (data.size() >= 6) status.code = static_cast<AlStatusCode>(ethercat::load_u16(&data[4]));
    // The answers of several slaves to a broadcast are ORed.
    const unsigned state = status.status & 0x0FU;
    const bool is_one = state == 1 || state == 2 || state == 3 || state == 4 || state == 8;
    if (!is_one) return fmt::format("AL status {:02X}h, of several states", status.status);
    if (status.error() && data.size() < 6) return fmt::format("AL status {} with an error", short_name(status.state()));
    return "AL status " + text_of(status);
  }
  if (address == reg::al_status_code && data.size() >= 2) {
    const auto code = static_cast<AlStatusCode>(ethercat::load_u16(data.data()));
    return fmt::format("AL status code {:04X}h {}", static_cast<unsigned>(code), ethercat::text(code));
  }
  if (data.size() == 2) return fmt::format("{} {:04X}h", register_name(address), ethercat::load_u16(data.data()));
  if (data.size() == 4) return fmt::format("{} {:08X}h", register_name(address), ethercat::load_u32(data.data()));
  return fmt::format("{} {}", register_name(address), hex_text(data, 16));
}

}  // namespace servodrome::master
