#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace servodrome::scenario {

struct RuleRun;

// A state of the machine that has a number: 0 or 1 for a cable, the power of a drive or an injected fault; more values
// for a clock or an error state. The level of an input that is not forced is nullopt.
struct MachineState {
  using Value = std::optional<std::int64_t>;
  std::string name;  // the same for all rules that hold this state
  Value held{};      // the value that the rule sets
  std::function<Value()> read;
  std::function<std::string(Value)> write;  // returns the error; empty: there is none
};

// The states that rules hold. Several rules may hold one state: the rule that began last decides. When all of them have
// ended, the state gets the value that it had before the first rule, unless the user has changed the value meanwhile.
class HeldStates {
 public:
  // Sets the state while the rule is active. Returns the error of write().
  std::string hold(const RuleRun& rule, MachineState state);
  // Call this when the rule no longer holds any state.
  void release(const RuleRun& rule);

 private:
  struct Holder {
    const RuleRun* rule;
    MachineState::Value value;
  };
  struct Held {
    MachineState state;
    MachineState::Value before;
    std::vector<Holder> holders;  // in the order of their beginning
  };
  std::map<std::string, Held> states_;
};

}  // namespace servodrome::scenario
