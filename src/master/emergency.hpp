#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace servodrome::master {

// An EMCY message (CiA 301 7.2.7), on CAN or in an EtherCAT mailbox (ETG.1000.6 clause 5.6.4).
struct Emergency {
  std::uint8_t node_id = 0;  // 0 on EtherCAT
  std::uint16_t code = 0;    // 00xxh: error reset or no error
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> vendor{};
};

// The meaning of an EMCY code or of 603Fh: the standard's text for the code, or "class: ..." with the text of its class
// (CiA 301 table 26, CiA 402-1 table of error codes).
std::string text_of_error_code(std::uint16_t code);

// For example "EMCY 3210h DC link over-voltage, error register 05h, vendor 01 00 00 00 00".
std::string text_of(const Emergency& emergency);

}  // namespace servodrome::master
