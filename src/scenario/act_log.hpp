#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "canopen/frame.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

// One act of a rule, for reports.
struct ActRecord {
  Time at{};
  std::string bus;   // the bus of the message; empty: the act concerns no message
  std::string axis;  // empty: the act concerns a bus
  std::string rule;
  std::string what;                     // "withhold sdo_answer"
  std::string raw;                      // bytes of the message
  std::optional<canopen::Frame> frame;  // the message, on a CAN bus
  std::string result;                   // the effect on the message: "nothing passes"
};

// The acts of all rules of a trial: the first ones of each rule, and the latest ones of all.
class ActLog {
 public:
  static constexpr std::size_t first_of_each = 64;
  static constexpr std::size_t latest = 1024;

  // `message` and `packets` are nullptr if the act concerns no message.
  void add(const RuleRun& rule, Time at, const Message* message, const Packets* packets);
  // In the order of time.
  std::vector<ActRecord> records() const;

 private:
  std::map<std::size_t, std::size_t> counts_;  // by the number of the rule
  std::vector<ActRecord> first_;
  std::deque<ActRecord> latest_;
};

}  // namespace servodrome::scenario
