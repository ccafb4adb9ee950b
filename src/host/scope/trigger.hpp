#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace servodrome::host::scope {

enum class Condition : std::uint8_t {
  rises,    // from below the value to it or above
  falls,    // from above the value to it or below
  changes,  // is another number than before
  sets,     // a bit of the value that was 0 is 1
  has,      // all bits of the value are 1
  lacks,    // all bits of the value are 0
  equal,
  not_equal,
  less,
  at_most,
  greater,
  at_least,
};

// Before a recording knows its channels.
struct TriggerText {
  std::string channel;
  Condition condition{};
  double value = 0;
};

// `CHANNEL rises VALUE`, `falls`, `sets`, `has`, `lacks`, `==`, `!=`, `<`, `<=`, `>`, `>=`, `CHANNEL changes`, or
// `fault`, which is bit 3 of the statusword being set. Throws HostError.
TriggerText parse_trigger(std::string_view text);

struct Trigger {
  std::size_t channel = 0;
  Condition condition{};
  double value = 0;

  // With the channel's sample and the one before it. Edges and changes need one before.
  bool fires(std::optional<double> before, double now) const;
};

}  // namespace servodrome::host::scope
