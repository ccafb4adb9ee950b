#pragma once

#include "line/line.hpp"
#include "scenario/rule_run.hpp"

namespace servodrome::scenario {

class Director;

// Lets the rules act on the frames of one EtherCAT segment.
class SegmentStage final : public links::EthercatInterposer {
 public:
  SegmentStage(Director& director, line::NamedEthercatBus& bus);
  ~SegmentStage() { bus_.bus.interpose(nullptr); }
  SegmentStage(const SegmentStage&) = delete;
  SegmentStage& operator=(const SegmentStage&) = delete;

  Entry enters(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;
  Return returns(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;

 private:
  void change(std::span<std::uint8_t> frame, Encapsulation encapsulation, Return& result);
  void keep(std::span<const std::uint8_t> frame) { before_.assign(frame.begin(), frame.end()); }

  Director& director_;
  line::NamedEthercatBus& bus_;
  std::vector<RuleRun*> acting_;      // on the frame that is under way
  std::vector<std::uint8_t> before_;  // the cycle that came back last, for Stale
  bool is_cycle_ = false;
  Time last_entry_{};
  Time period_{};  // between the last two frames
};

}  // namespace servodrome::scenario
