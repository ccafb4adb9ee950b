#pragma once

#include "line/line.hpp"
#include "links/serial/interposer.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

class Director;

// A station of an RS485 line that sends the characters of the rules, also while another station sends.
class RuleStation final : public links::SerialStation {
 public:
  explicit RuleStation(links::SerialLine& line)
      : line_(line), port_(line.attach(*this, links::SerialSender::unknown)) {}
  ~RuleStation() override { line_.detach(port_); }
  RuleStation(const RuleStation&) = delete;
  RuleStation& operator=(const RuleStation&) = delete;

  // Sending begins at `now`, or when earlier characters have been sent.
  void send(std::span<const std::uint8_t> characters, Time now);

  void receive(std::uint8_t, bool, Time) override {}
  Time next_deadline() const override { return waiting_.empty() ? links::never : due_; }
  std::span<const std::uint8_t> take() override;

 private:
  links::SerialLine& line_;
  links::SerialPortId port_;
  std::vector<std::uint8_t> waiting_, taken_;
  Time due_{};
};

// Lets the rules act on the answers of one drive on an RS485 line, and on the requests to it.
class SerialStage final : public links::SerialInterposer {
 public:
  SerialStage(Director& director, line::Axis& axis, line::NamedSerialBus& bus);
  ~SerialStage();
  SerialStage(const SerialStage&) = delete;
  SerialStage& operator=(const SerialStage&) = delete;

  // Disconnects the drive's stub: the drive receives nothing, and no other station receives what the drive sends.
  void cut(bool is_cut);
  bool is_cut() const { return is_cut_; }

  std::vector<links::SerialPiece> answers(std::span<const std::uint8_t> answer, Time at) override;
  bool receives(std::uint8_t& character, bool& intact, Time at) override;

 private:
  const Framing& framing() const;
  // Sends characters as if the drive sent them.
  void speak(std::span<const std::uint8_t> characters, Time at);

  Director& director_;
  line::Axis& axis_;
  line::NamedSerialBus& bus_;
  std::vector<std::uint8_t> request_;  // characters since the last pause
  Time heard_at_{};
  bool is_cut_ = false;
};

// The message that results from the rules, with the pauses that they add between its characters.
std::vector<links::SerialPiece> pieces_of(const Packets& packets, const std::vector<RuleRun*>& acting);

}  // namespace servodrome::scenario
