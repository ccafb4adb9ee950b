#include "describe/fault_texts.hpp"

#include <array>
#include <fmt/format.h>

#include "describe/fault_texts/tables.hpp"

namespace servodrome::describe {
namespace {

std::string pronet_alarm(std::uint16_t alarm) { return fmt::format("A {:02X}", alarm); }

std::string jmc_alarm(std::uint16_t alarm) {
  return alarm < 0xE000 ? fmt::format("AL.{:03X}", alarm) : fmt::format("{:04X}", alarm);
}

// The display of the drive shows a word of bits in hexadecimal, with a point before the last digit.
std::string ismk_alarm(std::uint16_t alarm) {
  const unsigned bit = alarm & 15U;
  if (alarm >= 32) return fmt::format("2605h sub 7 bit {}", bit);
  const unsigned word = 1U << bit;
  return fmt::format("{} bit {} ({:03X}.{:X})", alarm < 16 ? "2601h" : "2602h", bit, word >> 4U, word & 15U);
}

struct ProductTexts {
  std::string_view product;
  std::span<const FaultText> (*texts)();
  std::string (*alarm_name)(std::uint16_t alarm) = nullptr;
};

constexpr std::array products{ProductTexts{"generic402", generic402_fault_texts},
                              ProductTexts{"generic402-ec", generic402_fault_texts},
                              ProductTexts{"ismc", ismc_fault_texts},
                              ProductTexts{"ismk", ismk_fault_texts, ismk_alarm},
                              ProductTexts{"ismk-ea", ismk_fault_texts, ismk_alarm},
                              ProductTexts{"jmc_ec", jmc_ec_fault_texts, jmc_alarm},
                              ProductTexts{"pronet", pronet_fault_texts, pronet_alarm}};

const ProductTexts* find(std::string_view product) {
  const auto* const found = std::find_if(products.begin(), products.end(),
                                         [product](const ProductTexts& row) { return row.product == product; });
  return found != products.end() ? found : nullptr;
}

std::span<const FaultText> with_code(std::span<const FaultText> texts, std::uint16_t code) {
  const auto before = [](const FaultText& row, std::uint16_t wanted) { return row.code < wanted; };
  const auto first = std::lower_bound(texts.begin(), texts.end(), code, before);
  auto last = first;
  while (last != texts.end() && last->code == code) ++last;
  return {first, last};
}

}  // namespace

std::span<const FaultText> fault_texts(std::string_view product) {
  const ProductTexts* const found = find(product);
  return found != nullptr ? found->texts() : std::span<const FaultText>{};
}

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
    const auto found = with_code(cia402_fault_texts(), static_cast<std::uint16_t>(code & mask));
    if (!found.empty()) return &found.front();
  }
  return nullptr;
}

const FaultText* find_fault_text(std::string_view product, std::uint16_t code) {
  const auto found = fault_texts(product, code);
  return found.empty() ? fault_class_text(code) : &found.front();
}

std::string alarm_name(std::string_view product, std::uint16_t alarm) {
  const ProductTexts* const found = find(product);
  if (alarm == 0 || found == nullptr) return {};
  return found->alarm_name != nullptr ? found->alarm_name(alarm) : fmt::format("{:X}", alarm);
}

}  // namespace servodrome::describe
