#include "master/emergency.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "catalogue/fault_texts.hpp"

namespace servodrome::master {

std::string text_of_error_code(std::uint16_t code) {
  if (code < 0x1000) return "no error";  // 00xxh: error reset or no error
  const catalogue::FaultText* const text = catalogue::fault_class_text(code);
  if (text == nullptr) return "manufacturer-specific code";
  return fmt::format("{}{}", text->code == code ? "" : "class: ", text->text);
}

std::string text_of(const Emergency& emergency) {
  return fmt::format("EMCY {:04X}h {}, error register {:02X}h, vendor {:02X}", emergency.code,
                     text_of_error_code(emergency.code), emergency.error_register, fmt::join(emergency.vendor, " "));
}

}  // namespace servodrome::master
