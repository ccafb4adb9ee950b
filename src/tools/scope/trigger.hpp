#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace servodrome::master::scope {

enum class Condition : std::uint8_t {
  rises,    // from below the value to the value or above
  falls,    // from above the value to the value or below
  changes,  // differs from the previous sample
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

// A parsed trigger, before the channel numbers are known.
struct TriggerText {
  std::string channel;
  Condition condition{};
  double value = 0;
};

// Accepts `CHANNEL rises VALUE`, `falls`, `sets`, `has`, `lacks`, `==`, `!=`, `<`, `<=`, `>`, `>=`, `CHANNEL changes`,
// or `fault`, which means that bit 3 of the statusword becomes 1. Throws MasterError.
TriggerText parse_trigger(std::string_view text);

struct Trigger {
  std::size_t channel = 0;
  Condition condition{};
  double value = 0;

  // Evaluates a sample; `before`: the previous sample, which rises, falls, changes and sets require.
  bool fires(std::optional<double> before, double now) const;
};

}  // namespace servodrome::master::scope
