#pragma once

#include "dictionary/dictionary.hpp"
#include "scenario/rule_run.hpp"

namespace servodrome::scenario {

class Director;

// Applies the rules about the objects of one drive: Show, Ignore and Hold.
class ObjectView final : public dictionary::View {
 public:
  ObjectView(Director& director, line::Axis& axis) : director_(director), axis_(axis) {}

  void add(RuleRun& rule);
  void remove(const RuleRun& rule) { std::erase(rules_, &rule); }
  bool empty() const { return rules_.empty(); }

  // Call this when the rule begins: it remembers the value that `freeze` shows.
  void begin(RuleRun& rule) const;
  // Records the values that `late` shows later. Call this once a millisecond.
  void record(Time now) const;

  void show(const dictionary::Entry& entry, std::span<std::byte> value) override;
  bool take(const dictionary::Entry& entry, std::span<std::byte> value) override;

 private:
  std::int64_t shown(const RuleRun& rule, const Show& show, std::uint8_t sub, std::int64_t value) const;
  // The value in the drive.
  std::int64_t present(std::uint16_t index, std::uint8_t sub) const;

  Director& director_;
  line::Axis& axis_;
  std::vector<RuleRun*> rules_;
};

}  // namespace servodrome::scenario
