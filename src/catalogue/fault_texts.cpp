#include "catalogue/fault_texts.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "catalogue/product.hpp"

namespace servodrome::catalogue {
namespace {

std::span<const FaultText> with_code(std::span<const FaultText> texts, std::uint16_t code) {
  const auto before = [](const FaultText& row, std::uint16_t wanted) { return row.code < wanted; };
  const auto first = std::lower_bound(texts.begin(), texts.end(), code, before);
  auto last = first;
  while (last != texts.end() && last->code == code) ++last;
  return {first, last};
}

}  // namespace

std::span<const FaultText> fault_texts(std::string_view product) { return product_of(product).fault_texts; }

std::span<const FaultText> fault_texts(std::string_view product, std::uint16_t code) {
  return with_code(fault_texts(product), code);
}

const FaultText* find_alarm_text(std::string_view product, std::uint16_t alarm) {
  const std::span<const FaultText> texts = fault_texts(product);
  const auto found =
      std::find_if(texts.begin(), texts.end(), [alarm](const FaultText& row) { return row.alarm == alarm; });
  return found != texts.end() ? &*found : nullptr;
}

const FaultText* fault_class_text(std::uint16_t code) {
  if (code < 0x1000) return nullptr;  // 00xxh: error reset or no error
  for (const unsigned mask : {0xFFFFU, 0xFFF0U, 0xFF00U, 0xF000U}) {
    const auto found = with_code(standard_fault_texts(), static_cast<std::uint16_t>(code & mask));
    if (!found.empty()) return &found.front();
  }
  return nullptr;
}

const FaultText* find_fault_text(std::string_view product, std::uint16_t code) {
  const auto found = fault_texts(product, code);
  return found.empty() ? fault_class_text(code) : &found.front();
}

std::string alarm_name(std::string_view product, std::uint16_t alarm) {
  const Product& known = product_of(product);
  if (alarm == 0 || &known == &cia402::product) return {};
  return known.alarm_name != nullptr ? known.alarm_name(alarm) : fmt::format("{:X}", alarm);
}

}  // namespace servodrome::catalogue
