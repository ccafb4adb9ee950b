#pragma once

#include "line/line.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

class Director;

// Lets the rules act on the frames of one EtherCAT segment.
class SegmentStage final : public links::EthercatInterposer {
 public:
  SegmentStage(Director& director, line::NamedEthercatBus& bus);
  ~SegmentStage();
  SegmentStage(const SegmentStage&) = delete;
  SegmentStage& operator=(const SegmentStage&) = delete;

  Entry enters(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;
  Return returns(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;

  // The frames that the rule holds back come back with the next frame of their sender; nullptr: those of all rules.
  void let_go(const RuleRun* rule = nullptr);

 private:
  // A frame that comes back after frames that were sent later.
  struct HeldFrame {
    const RuleRun* rule;
    links::EthercatSender sender;
    std::vector<std::uint8_t> bytes;
    unsigned later = 0;  // number of frames that come back before it
  };

  void connect_all();
  void change_datagrams(const RuleRun& rule, std::span<std::uint8_t> frame, ethercat::Frame& parsed) const;
  void change_bytes(std::span<std::uint8_t> frame, Encapsulation encapsulation, Return& result);
  void hold_back(const RuleRun& rule, std::span<const std::uint8_t> frame, unsigned frames, Return& result);
  void release_held();

  Director& director_;
  line::NamedEthercatBus& bus_;
  std::vector<RuleRun*> acting_;      // on the frame in progress
  std::vector<ethercat::Esc*> deaf_;  // slaves on which the frame in progress has no effect
  std::vector<std::uint8_t> before_;  // the cycle that came back last, for Stale
  std::vector<HeldFrame> held_;
  std::vector<std::vector<std::uint8_t>> behind_;  // frames that come back with the frame in progress
  bool is_cycle_ = false;
};

}  // namespace servodrome::scenario
