#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// Explanations of a product's fault codes for people: meaning, cause and remedy.
namespace servodrome::catalogue {

struct FaultText {
  std::uint16_t code;     // 603Fh and EMCY error code
  std::string_view text;  // a few words, for a list
  std::string_view cause;
  std::string_view remedy;
  // The product's own number of the alarm, as in drive::FaultRow::alarm; 0: none. iSMK: the bit in which it appears,
  // 0..15 for 2601h, 16..31 for 2602h, 32..47 for 2605h sub 7.
  std::uint16_t alarm = 0;
};

// Checks the order by code and alarm without duplicates, which the searches require.
constexpr bool is_ordered(std::span<const FaultText> texts) {
  return std::adjacent_find(texts.begin(), texts.end(), [](const FaultText& a, const FaultText& b) {
           return a.code > b.code || (a.code == b.code && a.alarm >= b.alarm);
         }) == texts.end();
}

// The codes of CiA 301 and CiA 402, in order.
std::span<const FaultText> standard_fault_texts();

// All alarms of a product, ordered by code and then by alarm. Empty for a product that is not in the catalogue.
std::span<const FaultText> fault_texts(std::string_view product);

// The alarms with this code; several if the product uses one code for several alarms. Empty if there are none.
std::span<const FaultText> fault_texts(std::string_view product, std::uint16_t code);

// The text for an alarm number; nullptr if the product has no such alarm. `alarm` must not be 0.
const FaultText* find_alarm_text(std::string_view product, std::uint16_t alarm);

// The standard's text for a code (CiA 301 table 26, CiA 402-1 and IEC 61800-7-201 on error codes): the text of the code
// itself, otherwise of its class, which is found by replacing the last digits by zeros one by one; the row's code shows
// which. nullptr for 0 ("no error") and for manufacturer ranges that the standard does not define.
const FaultText* fault_class_text(std::uint16_t code);

// The product's first text for the code, otherwise fault_class_text().
const FaultText* find_fault_text(std::string_view product, std::uint16_t code);

// The number as the maker prints it: "AL.063", "E105", "A 69", "2601h bit 9 (020.0)". Empty for 0.
std::string alarm_name(std::string_view product, std::uint16_t alarm);

}  // namespace servodrome::catalogue
