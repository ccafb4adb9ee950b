#pragma once

#include <vector>

#include "catalogue/fault_texts.hpp"
#include "catalogue/product.hpp"
#include "drive/power/power_state.hpp"
#include "master/object_client.hpp"

// Reads the faults of a drive from all objects that report them, and finds their texts.
namespace servodrome::master {

struct ReportedFault {
  std::uint16_t code = 0;   // 0: the drive reports no code
  std::uint16_t alarm = 0;  // the product's own number, if the source object has one; see catalogue::FaultText
  ObjectAddress source;
  // Possible meanings: several if the code alone does not distinguish the alarms. Empty: unknown.
  std::vector<const catalogue::FaultText*> meanings{};

  friend bool operator==(const ReportedFault&, const ReportedFault&) = default;
};

struct FaultReport {
  std::uint16_t statusword = 0;
  std::int8_t mode = 0;                          // 6061h; 0 if the drive does not have it
  std::optional<std::uint8_t> error_register{};  // 1001h
  std::vector<ReportedFault> active{};           // alarms, unless they are only warnings; never empty in fault and
                                                 // fault reaction active
  std::vector<ReportedFault> warnings{};         // alarms while statusword bit 7 is set, except in these two states
  std::vector<ReportedFault> history{};          // 1003h, the newest first
  std::vector<ReportedFault> log{};              // the product's own log; the newest first
};

ReportedFault fault_of_code(std::uint16_t code, ObjectAddress source, std::string_view product);

// Only reads. Throws ObjectError.
FaultReport read_faults(ObjectClient& objects, const catalogue::Product& product);

// Clears 1003h. Throws ObjectError, also if the drive does not have the object.
void clear_fault_history(ObjectClient& objects);

// For example "3210h over-voltage" or "5003h AL.051 EEPROM parameters damaged or AL.062 parameters not stored".
std::string text_of(const ReportedFault& fault, std::string_view product);

// Names of the bits of 1001h that are set: "generic, voltage".
std::string text_of_error_register(std::uint8_t value);

}  // namespace servodrome::master
