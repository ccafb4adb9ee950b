#pragma once

#include "line/line.hpp"
#include "links/serial/interposer.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

class Director;

// Lets the rules act on the answers of one drive on an RS485 line, and on the requests to it.
class SerialStage final : public links::SerialInterposer {
 public:
  SerialStage(Director& director, line::Axis& axis, line::NamedSerialBus& bus);
  ~SerialStage();
  SerialStage(const SerialStage&) = delete;
  SerialStage& operator=(const SerialStage&) = delete;

  std::vector<links::SerialPiece> answers(std::span<const std::uint8_t> answer, Time at) override;
  bool receives(std::uint8_t& character, bool& intact, Time at) override;

 private:
  Message message(std::span<const std::uint8_t> bytes) const;
  bool completes_request() const;

  Director& director_;
  line::Axis& axis_;
  line::NamedSerialBus& bus_;
  std::vector<std::uint8_t> request_;  // characters since the last pause
  Time heard_at_{};
};

// Lets the rules act on the answers of a line's drives over Modbus TCP.
class TcpStage final : public links::ModbusTcpInterposer {
 public:
  TcpStage(Director& director, line::NamedSerialBus& bus);
  ~TcpStage() { bus_.line.interpose_tcp(nullptr); }
  TcpStage(const TcpStage&) = delete;
  TcpStage& operator=(const TcpStage&) = delete;

  Admission connects() override;
  links::TcpReply answers(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer,
                          Time at) override;

 private:
  Director& director_;
  line::NamedSerialBus& bus_;
};

}  // namespace servodrome::scenario
