#pragma once

#include <deque>

#include "links/can/interposer.hpp"
#include "scenario/rule_run.hpp"

namespace servodrome::scenario {

class Director;

// A port of a CAN bus that sends the frames of the rules. It acknowledges frames of other ports only while it sends.
class RulePort final : public links::Receiver {
 public:
  explicit RulePort(links::CanBus& bus);
  ~RulePort() override;

  // Sends the frame after those that wait, as soon as the bus is free. `rule` is the rule that makes it; nullptr: it is
  // a frame of a drive.
  void send(const canopen::Frame& frame, Time now, const RuleRun* rule = nullptr);
  // The number of frames of the rule that are not sent yet.
  std::size_t waiting(const RuleRun& rule) const;
  bool empty() const { return waiting_.empty(); }
  // The rule has ended. Its waiting frames are dropped, or, if `completes` is true, still sent.
  void leave(const RuleRun& rule, bool completes);

  void on_frame(const canopen::Frame&, Time) override {}
  void on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) override;
  void on_error_state(links::ErrorState state, Time at) override;

 private:
  static constexpr std::size_t depth = 256;
  struct Waiting {
    canopen::Frame frame;
    Time since{};
    const RuleRun* rule = nullptr;
  };
  void offer();

  links::CanBus& bus_;
  links::PortId port_;
  std::deque<Waiting> waiting_;
};

// Lets the rules act on the CANopen messages of one drive.
class CanStage final : public links::CanInterposer {
 public:
  CanStage(Director& director, line::Axis& axis, RulePort& port, links::CanBus& bus);

  bool lets_out(const canopen::Frame& frame, Time now) override;
  void sent(const canopen::Frame& frame, Time at) override;
  bool lets_in(canopen::Frame& frame, Time at) override;

  // Sends a frame as if the drive sent it, if the drive is connected and has power.
  void speak(const canopen::Frame& frame, Time now);

 private:
  Director& director_;
  line::Axis& axis_;
  RulePort& port_;
  links::CanBus& bus_;
  CanopenMessages messages_;
};

}  // namespace servodrome::scenario
