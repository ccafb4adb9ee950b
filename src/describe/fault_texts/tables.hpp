#pragma once

#include <algorithm>

#include "describe/fault_texts.hpp"

// The tables for fault_texts.hpp, one file for each product.
namespace servodrome::describe {

std::span<const FaultText> cia402_fault_texts();
std::span<const FaultText> generic402_fault_texts();
std::span<const FaultText> ismc_fault_texts();
std::span<const FaultText> ismk_fault_texts();
std::span<const FaultText> jmc_ec_fault_texts();
std::span<const FaultText> pronet_fault_texts();

// Checks the order by code and alarm without duplicates, which the searches require.
constexpr bool is_ordered(std::span<const FaultText> texts) {
  return std::adjacent_find(texts.begin(), texts.end(), [](const FaultText& a, const FaultText& b) {
           return a.code > b.code || (a.code == b.code && a.alarm >= b.alarm);
         }) == texts.end();
}

}  // namespace servodrome::describe
