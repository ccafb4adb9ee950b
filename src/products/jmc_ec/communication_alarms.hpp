#pragma once

#include <array>
#include <cstdint>

#include "ethercat/slave/al_status.hpp"

namespace servodrome::products::jmc_ec {

// The error LED of the bus pair (Table 10). Its blink codes differ from ETG.1300 (C-07).
enum class ErrorLed : std::uint8_t {
  off,              // the values of the next four are their numbers of flashes
  single_flash,     // boot error
  double_flash,     // communication setting
  triple_flash,     // synchronisation or data
  quadruple_flash,  // watchdog
  on,               // internal bus watchdog
};

// The drive's alarm for each error of the EtherCAT state machine (Table 128). 1001h is 11h for all; the manual prints
// it only in the first row (C-06).
struct CommunicationAlarm {
  std::uint16_t al_status_code;
  std::uint16_t alarm;  // as it is printed, in hexadecimal
  std::uint16_t code;   // 603Fh
  ErrorLed led;
  const char* name;
};

inline constexpr std::uint8_t communication_error_register = 0x11;

inline constexpr auto communication_alarms = std::to_array<CommunicationAlarm>({
    {0x0006, 0xE601, 0x6101, ErrorLed::single_flash, "Firmware does not match EEPROM"},
    {0x0007, 0xE602, 0x6102, ErrorLed::single_flash, "Firmware update failed"},
    {0x0013, 0xE603, 0x6301, ErrorLed::single_flash, "Bootstrap not supported"},
    {0x0014, 0xE604, 0x6103, ErrorLed::single_flash, "No valid firmware"},
    {0x0050, 0xE605, 0x9001, ErrorLed::single_flash, "EEPROM not accessible"},
    {0x0051, 0xE606, 0x9002, ErrorLed::single_flash, "EEPROM error"},
    {0x0011, 0xE607, 0x6302, ErrorLed::double_flash, "Invalid requested state change"},
    {0x0012, 0xE608, 0x6303, ErrorLed::double_flash, "Unknown requested state"},
    {0x0015, 0xE609, 0x6304, ErrorLed::double_flash, "Invalid mailbox configuration (boot)"},
    {0x0016, 0xE60A, 0x6305, ErrorLed::double_flash, "Invalid mailbox configuration (pre-op)"},
    {0x0017, 0xE60B, 0x6306, ErrorLed::double_flash, "Invalid sync manager configuration"},
    {0x001C, 0xE60C, 0x6307, ErrorLed::double_flash, "Invalid sync manager types"},
    {0x001D, 0xE60D, 0x6308, ErrorLed::double_flash, "Invalid output configuration"},
    {0x001E, 0xE60E, 0x6309, ErrorLed::double_flash, "Invalid input configuration"},
    {0x001F, 0xE60F, 0x630A, ErrorLed::double_flash, "Invalid watchdog configuration"},
    {0x0020, 0xE610, 0x630B, ErrorLed::double_flash, "Slave needs cold start"},
    {0x0021, 0xE611, 0x630C, ErrorLed::double_flash, "Slave needs Init"},
    {0x0022, 0xE612, 0x630D, ErrorLed::double_flash, "Slave needs Pre-Op"},
    {0x0023, 0xE613, 0x630E, ErrorLed::double_flash, "Slave needs Safe-Op"},
    {0x0024, 0xE614, 0x630F, ErrorLed::double_flash, "No valid input mapping"},
    {0x0025, 0xE615, 0x6310, ErrorLed::double_flash, "No valid output mapping"},
    {0x0026, 0xE616, 0x6311, ErrorLed::double_flash, "Inconsistent settings"},
    {0x0027, 0xE617, 0xF001, ErrorLed::double_flash, "Free run not supported"},
    {0x0028, 0xE618, 0xF002, ErrorLed::double_flash, "Sync mode not supported"},
    {0x0029, 0xE619, 0xF003, ErrorLed::double_flash, "Free run needs three buffers"},
    {0x002A, 0xE61A, 0xF004, ErrorLed::double_flash, "Internal (background) watchdog"},
    {0x002E, 0xE61B, 0x6312, ErrorLed::double_flash, "Cycle below slave minimum"},
    {0x0030, 0xE61C, 0x6313, ErrorLed::double_flash, "Invalid DC sync configuration"},
    {0x0031, 0xE61D, 0x6314, ErrorLed::double_flash, "Invalid DC latch configuration"},
    {0x0035, 0xE61E, 0x6315, ErrorLed::double_flash, "Invalid DC sync cycle time"},
    {0x001A, 0xE61F, 0xFF01, ErrorLed::triple_flash, "Synchronisation initialisation error"},
    {0x002C, 0xE620, 0xFF02, ErrorLed::triple_flash, "Fatal synchronisation error"},
    {0x002D, 0xE621, 0xFF03, ErrorLed::triple_flash, "No synchronisation"},
    {0x0032, 0xE622, 0xFF04, ErrorLed::triple_flash, "PLL error"},
    {0x0033, 0xE623, 0xFF05, ErrorLed::triple_flash, "DC synchronisation IO error"},
    {0x0034, 0xE624, 0xFF06, ErrorLed::triple_flash, "DC synchronisation time-out"},
    {0x0018, 0xE625, 0xFF07, ErrorLed::quadruple_flash, "Invalid input variable (no valid inputs)"},
    {0x0019, 0xE626, 0xFF08, ErrorLed::quadruple_flash, "Invalid output (no valid outputs)"},
    {0x001B, 0xE627, 0xFF09, ErrorLed::quadruple_flash, "Process data watchdog time-out"},
    {0x002B, 0xE628, 0xFF0A, ErrorLed::quadruple_flash, "No valid input or output"},
    {0x0002, 0xE629, 0x9003, ErrorLed::on, "No memory"},
    {0x0052, 0xE62A, 0x9004, ErrorLed::on, "External hardware not ready"},
    {0x0001, 0xE62B, 0xFFFF, ErrorLed::on, "Unspecified error"},
});

// The row of a code. A code that the manual does not list has the last row, "unspecified".
constexpr std::size_t communication_alarm_index(ethercat::AlStatusCode code) {
  for (std::size_t i = 0; i < communication_alarms.size(); ++i) {
    if (communication_alarms[i].al_status_code == static_cast<std::uint16_t>(code)) return i;
  }
  return communication_alarms.size() - 1;
}
static_assert(communication_alarms.back().al_status_code == 0x0001);

}  // namespace servodrome::products::jmc_ec
