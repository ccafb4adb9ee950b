#include "tools/scope/trigger.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>

#include "master/error.hpp"

namespace servodrome::master::scope {

namespace {

struct ConditionRow {
  std::string_view word;
  Condition condition;
};
// Operators of two characters come first, because "<=" begins with "<".
constexpr std::array condition_words{
    ConditionRow{" rises ", Condition::rises}, ConditionRow{" falls ", Condition::falls},
    ConditionRow{" sets ", Condition::sets},   ConditionRow{" has ", Condition::has},
    ConditionRow{" lacks ", Condition::lacks}, ConditionRow{"==", Condition::equal},
    ConditionRow{"!=", Condition::not_equal},  ConditionRow{"<=", Condition::at_most},
    ConditionRow{">=", Condition::at_least},   ConditionRow{"<", Condition::less},
    ConditionRow{">", Condition::greater},
};

std::string_view without_blanks(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// A decimal number, with or without a fraction, or a hexadecimal one with 0x or h.
std::optional<double> trigger_value(std::string_view text) {
  const bool prefix = text.starts_with("0x") || text.starts_with("0X");
  const bool suffix = text.ends_with('h') || text.ends_with('H');
  if (prefix) text.remove_prefix(2);
  if (suffix) text.remove_suffix(1);
  const char* const end = text.data() + text.size();
  if (prefix || suffix) {
    std::uint64_t bits = 0;
    const auto [at, error] = std::from_chars(text.data(), end, bits, 16);
    if (text.empty() || error != std::errc{} || at != end) return std::nullopt;
    return static_cast<double>(bits);
  }
  double number = 0;
  const auto [at, error] = std::from_chars(text.data(), end, number);
  if (text.empty() || error != std::errc{} || at != end || !std::isfinite(number)) return std::nullopt;
  return number;
}

[[noreturn]] void refuse_trigger(std::string_view text, const std::string& what) {
  throw MasterError(
      what, fmt::format("trigger \"{}\"", text),
      "write CHANNEL rises|falls|sets|has|lacks VALUE, CHANNEL ==|!=|<|<=|>|>= VALUE, CHANNEL changes, or "
      "fault");
}

std::uint64_t bits_of_number(double number) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(number)); }

}  // namespace

TriggerText parse_trigger(std::string_view text) {
  const std::string_view whole = without_blanks(text);
  if (whole == "fault") return {.channel = "statusword", .condition = Condition::sets, .value = 0x0008};
  constexpr std::string_view changes = " changes";
  if (whole.ends_with(changes)) {
    const std::string_view channel = without_blanks(whole.substr(0, whole.size() - changes.size()));
    if (channel.empty()) refuse_trigger(text, "a channel is missing");
    return {.channel = std::string(channel), .condition = Condition::changes};
  }
  for (const auto& [word, condition] : condition_words) {
    const std::size_t at = whole.find(word);
    if (at == std::string_view::npos) continue;
    const std::string_view channel = without_blanks(whole.substr(0, at));
    const std::string_view number = without_blanks(whole.substr(at + word.size()));
    if (channel.empty()) refuse_trigger(text, "a channel is missing");
    const auto value = trigger_value(number);
    if (!value) refuse_trigger(text, fmt::format("\"{}\" is not a number", number));
    return {.channel = std::string(channel), .condition = condition, .value = *value};
  }
  refuse_trigger(text, "the condition is missing");
}

bool Trigger::fires(std::optional<double> before, double now) const {
  const std::uint64_t mask = bits_of_number(value);
  const std::uint64_t bits = bits_of_number(now);
  switch (condition) {
    case Condition::rises: return before && *before < value && now >= value;
    case Condition::falls: return before && *before > value && now <= value;
    case Condition::changes: return before && *before != now;
    case Condition::sets: return before && (bits & mask & ~bits_of_number(*before)) != 0;
    case Condition::has: return (bits & mask) == mask;
    case Condition::lacks: return (bits & mask) == 0;
    case Condition::equal: return now == value;
    case Condition::not_equal: return now != value;
    case Condition::less: return now < value;
    case Condition::at_most: return now <= value;
    case Condition::greater: return now > value;
    case Condition::at_least: return now >= value;
  }
  return false;
}

}  // namespace servodrome::master::scope
