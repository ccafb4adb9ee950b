#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// What a fault code of a product says to people: what it is, what brings it, and what to do.
namespace servodrome::describe {

struct FaultText {
  std::uint16_t code;     // 603Fh and EMCY error code
  std::string_view text;  // a few words, for a line of a list
  std::string_view cause;
  std::string_view remedy;
  // The product's own number of it, as drive::FaultRow::alarm has it; 0: none. iSMK: where it shows, 0..15 for the bits
  // of 2601h, 16..31 for those of 2602h, 32..47 for those of 2605h sub 7.
  std::uint16_t alarm = 0;
};

// All of a product's alarms, by code and then by alarm. Empty for a product without texts of its own.
std::span<const FaultText> fault_texts(std::string_view product);

// Those with this code: several where a product gives one code to several alarms. Empty if it has none.
std::span<const FaultText> fault_texts(std::string_view product, std::uint16_t code);

// The row of an alarm number; nullptr if the product has no such alarm. `alarm` is not 0.
const FaultText* find_alarm_text(std::string_view product, std::uint16_t alarm);

// What the standard says of a code (CiA 301 table 26, CiA 402-1 and IEC 61800-7-201 on error codes): of the code
// itself, else of the class it belongs to, which is found by replacing the last digits by zeros, one after another; the
// row's code says which. nullptr for 0 ("no error") and for the manufacturer's ranges that the standard does not know.
const FaultText* fault_class_text(std::uint16_t code);

// The product's first text for the code, else fault_class_text().
const FaultText* find_fault_text(std::string_view product, std::uint16_t code);

// As the maker prints the number: "AL.063", "E105", "A 69", "2601h bit 9 (020.0)". Empty for 0.
std::string alarm_name(std::string_view product, std::uint16_t alarm);

}  // namespace servodrome::describe
