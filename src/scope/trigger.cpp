#include "scope/trigger.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::scope {
namespace {

struct ConditionRow {
  std::string_view word;
  Condition condition;
  bool takes_value = true;
};
// Operators of two characters come first, because "<=" begins with "<".
constexpr std::array condition_rows{
    ConditionRow{"now", Condition::now, false},  ConditionRow{"rises", Condition::rises},
    ConditionRow{"falls", Condition::falls},     ConditionRow{"changes", Condition::changes, false},
    ConditionRow{"becomes", Condition::becomes}, ConditionRow{"appears", Condition::appears, false},
    ConditionRow{"sets", Condition::sets},       ConditionRow{"has", Condition::has},
    ConditionRow{"lacks", Condition::lacks},     ConditionRow{"==", Condition::equal},
    ConditionRow{"!=", Condition::not_equal},    ConditionRow{"<=", Condition::at_most},
    ConditionRow{">=", Condition::at_least},     ConditionRow{"<", Condition::less},
    ConditionRow{">", Condition::greater},
};

const ConditionRow& row_of(Condition condition) {
  return *std::find_if(condition_rows.begin(), condition_rows.end(),
                       [condition](const ConditionRow& row) { return row.condition == condition; });
}

bool is_word(const ConditionRow& row) { return row.word.front() >= 'a'; }

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
  throw TriggerError(fmt::format("trigger \"{}\": {}", text, what),
                     "write CHANNEL rises|falls|becomes|sets|has|lacks VALUE, CHANNEL ==|!=|<|<=|>|>= VALUE, CHANNEL "
                     "changes|appears, or fault");
}

// 0 for a number that no object of 64 bits has.
std::uint64_t bits_of_number(double number) {
  if (number >= 0x1p63 && number < 0x1p64) return static_cast<std::uint64_t>(number);
  return std::abs(number) < 0x1p63 ? static_cast<std::uint64_t>(static_cast<std::int64_t>(number)) : 0;
}

}  // namespace

std::string_view word_of(Condition condition) { return row_of(condition).word; }

std::optional<Condition> condition_of(std::string_view word) {
  for (const ConditionRow& row : condition_rows) {
    if (row.word == word) return row.condition;
  }
  return std::nullopt;
}

std::vector<std::string_view> condition_words() {
  std::vector<std::string_view> words;
  for (const ConditionRow& row : condition_rows) words.push_back(row.word);
  return words;
}

bool takes_value(Condition condition) { return row_of(condition).takes_value; }

TriggerText parse_trigger(std::string_view text) {
  const std::string_view whole = without_blanks(text);
  if (whole == "fault") return {.channel = "statusword", .trigger = {Condition::sets, 0x0008}};
  for (const ConditionRow& row : condition_rows) {
    if (row.condition == Condition::now) continue;
    std::string word(row.word);
    if (is_word(row)) word = " " + word + (row.takes_value ? " " : "");
    const std::size_t at = whole.find(word);
    if (at == std::string_view::npos) continue;
    const std::string_view rest = without_blanks(whole.substr(at + word.size()));
    if (!row.takes_value && !rest.empty()) continue;
    const std::string_view channel = without_blanks(whole.substr(0, at));
    if (channel.empty()) refuse_trigger(text, "a channel is missing");
    if (!row.takes_value) return {.channel = std::string(channel), .trigger = {row.condition}};
    const auto value = trigger_value(rest);
    if (!value) refuse_trigger(text, fmt::format("\"{}\" is not a number", rest));
    return {.channel = std::string(channel), .trigger = {row.condition, *value}};
  }
  refuse_trigger(text, "the condition is missing");
}

bool Trigger::fires(std::optional<double> before, double now) const {
  if (condition == Condition::now) return true;
  if (std::isnan(now)) return false;
  const std::uint64_t mask = bits_of_number(value);
  const std::uint64_t bits = bits_of_number(now);
  switch (condition) {
    case Condition::now: return true;
    case Condition::rises: return before && *before < value && now >= value;
    case Condition::falls: return before && *before > value && now <= value;
    case Condition::changes: return before && *before != now;
    case Condition::becomes: return before && *before != now && now == value;
    case Condition::appears: return before && now > 0 && !(*before > 0);
    case Condition::sets: return before && !std::isnan(*before) && (bits & mask & ~bits_of_number(*before)) != 0;
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

std::optional<double> Trigger::next_before(std::optional<double> before, double now) const {
  const bool from_last_number =
      condition == Condition::rises || condition == Condition::falls || condition == Condition::sets;
  return from_last_number && std::isnan(now) ? before : std::optional(now);
}

}  // namespace servodrome::scope
