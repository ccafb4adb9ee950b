#pragma once

#include "ethercat/slave/slave_interposer.hpp"
#include "scenario/coe_messages.hpp"
#include "scenario/rule_run.hpp"

namespace servodrome::scenario {

class Director;

// Lets the rules act on one EtherCAT slave: its mailbox, its state machine, its SYNC0 and its inputs.
class SlaveStage final : public ethercat::SlaveInterposer {
 public:
  SlaveStage(Director& director, line::Axis& axis);

  std::optional<ethercat::AlStatusCode> refuses(ethercat::AlState from, ethercat::AlState to) override;
  bool acknowledges() override;
  Dispatch sends(Mail& mail) override;
  Receipt receives(std::span<std::uint8_t> mailbox) override;
  Pulse sync0(Time now) override;
  bool keeps_inputs(Time now) override;

 private:
  void release_later(Time late);
  Receipt receives_anew(std::span<std::uint8_t> mailbox);

  Director& director_;
  line::Axis& axis_;
  CoeMessages messages_;
  std::vector<std::uint8_t> kept_;  // the request that stays in the mailbox; empty: none
  Time release_at_{};               // time at which the message that was kept or held last is released
};

}  // namespace servodrome::scenario
