#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "canopen/frame.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

// What a rule did, for reports.
struct ActRecord {
  Time at{};
  std::string bus;   // the bus of the message; empty: the act is about no message
  std::string axis;  // empty: it is about a bus
  std::string rule;
  std::string what;                     // "withhold sdo_answer"
  std::string raw;                      // bytes of the message
  std::optional<canopen::Frame> frame;  // the message, on a CAN bus
  std::string result;                   // what became of the message: "nothing passes"
};

// The acts of all rules of a trial: the first ones of each rule, and the latest ones of all.
class ActLog {
 public:
  static constexpr std::size_t first_of_each = 64;
  static constexpr std::size_t latest = 1024;

  // `message` and `packets` are nullptr for an act that is about no message.
  void add(const RuleRun& rule, Time at, const Message* message, const Packets* packets);
  // In the order of time.
  std::vector<ActRecord> records() const;

 private:
  std::map<std::size_t, std::size_t> counts_;  // by the number of the rule
  std::vector<ActRecord> first_;
  std::deque<ActRecord> latest_;
};

}  // namespace servodrome::scenario
