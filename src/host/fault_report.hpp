#pragma once

#include <vector>

#include "describe/fault_texts.hpp"
#include "drive/power/power_state.hpp"
#include "host/dialect.hpp"
#include "host/object_client.hpp"

// What a drive says about its faults, by whatever objects it has for it, and what that means.
namespace servodrome::host {

struct ReportedFault {
  std::uint16_t code = 0;   // 0: the drive gives none
  std::uint16_t alarm = 0;  // the product's own number, if the object it came from has that; see describe::FaultText
  ObjectAddress source;
  // What it may be: several where the code alone does not tell alarms apart. Empty: unknown.
  std::vector<const describe::FaultText*> meanings{};

  friend bool operator==(const ReportedFault&, const ReportedFault&) = default;
};

struct FaultReport {
  std::uint16_t statusword = 0;
  std::optional<std::uint8_t> error_register{};  // 1001h
  std::vector<ReportedFault> active{};           // what keeps the drive in fault; never empty in the states of a fault
  std::vector<ReportedFault> warnings{};         // statusword bit 7, outside of these states
  std::vector<ReportedFault> history{};          // 1003h, the newest first
  std::vector<ReportedFault> log{};              // the product's own, which outlives the supply; the newest first
};

ReportedFault fault_of_code(std::uint16_t code, ObjectAddress source, std::string_view product);

// Reads only. Throws ObjectError.
FaultReport read_faults(ObjectClient& objects, const Dialect& dialect);

// Empties 1003h. Throws ObjectError, also if the drive does not have it.
void clear_fault_history(ObjectClient& objects);

// "3210h over-voltage", "5003h AL.051 EEPROM parameters damaged or AL.062 parameters not stored"
std::string text_of(const ReportedFault& fault, std::string_view product);

// The bits of 1001h that are set: "generic, voltage".
std::string text_of_error_register(std::uint8_t value);

}  // namespace servodrome::host
