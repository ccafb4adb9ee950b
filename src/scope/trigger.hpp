#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace servodrome::scope {

enum class Condition : std::uint8_t {
  now,      // always
  rises,    // from below the value to the value or above
  falls,    // from above the value to the value or below
  changes,  // differs from the previous sample
  becomes,  // is the value, and the previous sample is not
  appears,  // is above 0, and the previous sample is not: an error code
  sets,     // a bit of the value changes from 0 to 1
  has,      // all bits of the value are 1
  lacks,    // all bits of the value are 0
  equal,
  not_equal,
  less,
  at_most,
  greater,
  at_least,
};

// The event that starts a recording, on the samples of one channel. It has two notations: text (parse_trigger) for the
// command line, and JSON (api/scope/trigger.hpp) for the bench API.
struct Trigger {
  Condition condition = Condition::now;
  double value = 0;

  // Evaluates a sample. `before` is the previous one; nullopt: this is the first, at which rises, falls, changes,
  // becomes, appears and sets never fire. A sample that is not a number fires nothing: the axis has no power.
  bool fires(std::optional<double> before, double now) const;
  // Returns the `before` of the sample after `now`. A value rises and falls, and its bits change, from the last sample
  // that is a number.
  std::optional<double> next_before(std::optional<double> before, double now) const;
};

// The word of a condition: "rises", "<=". `condition_of` returns nullopt if there is none.
std::string_view word_of(Condition condition);
std::optional<Condition> condition_of(std::string_view word);
std::vector<std::string_view> condition_words();
// True if a trigger with this condition has a value.
bool takes_value(Condition condition);

class TriggerError : public std::runtime_error {
 public:
  TriggerError(const std::string& what, std::string hint) : std::runtime_error(what), hint_(std::move(hint)) {}
  const std::string& hint() const { return hint_; }

 private:
  std::string hint_;
};

struct TriggerText {
  std::string channel;  // not resolved
  Trigger trigger{};
};

// Accepts `CHANNEL CONDITION VALUE`, where the condition is one of rises, falls, becomes, sets, has, lacks, ==, !=, <,
// <=, > and >=; `CHANNEL changes`; `CHANNEL appears`; and `fault`, which means that bit 3 of the statusword becomes 1.
// Values are decimal, or hexadecimal with 0x or h. Throws TriggerError.
TriggerText parse_trigger(std::string_view text);

}  // namespace servodrome::scope
