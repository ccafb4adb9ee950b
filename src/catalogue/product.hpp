#pragma once

#include <span>
#include <string>
#include <string_view>

#include "catalogue/departures.hpp"
#include "catalogue/dialect.hpp"
#include "catalogue/fault_texts.hpp"
#include "catalogue/gains.hpp"
#include "catalogue/object_texts.hpp"
#include "catalogue/parameter_rules.hpp"
#include "catalogue/status_words.hpp"
#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue {

// What masters, tools and the web page know about a type of drive, without a drive. All of it is constants.
struct Product {
  std::string_view name{};  // in line files and commands; empty: a drive that is not in the catalogue
  Dialect dialect{};
  ParameterRules rules{};
  TuningDialect tuning{};
  std::span<const GainLine> gain_guide{};  // empty if the manual describes no gains
  // Ordered by code and then by alarm (is_ordered).
  std::span<const FaultText> fault_texts{};
  // The number of an alarm as the maker prints it: "AL.063", "E105". nullptr: in hexadecimal.
  std::string (*alarm_name)(std::uint16_t alarm) = nullptr;
  std::span<const ObjectText> object_texts{};  // the product's own, in order
  std::span<const StatusWord> status_words{};
  std::span<const ModeName> mode_names{};
  std::span<const TerminalWords> terminal_words{};  // the product's own
  std::span<const Departure> departures{};
};

// A drive about which only the standards are known.
namespace cia402 {
extern const Product product;
}

// In the order of `servodrome products`.
std::span<const Product* const> all_products();

// Returns cia402::product if no product has this name.
const Product& product_of(std::string_view name);

}  // namespace servodrome::catalogue
