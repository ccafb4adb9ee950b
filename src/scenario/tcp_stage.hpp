#pragma once

#include "line/line.hpp"
#include "links/serial/interposer.hpp"

namespace servodrome::scenario {

class Director;

// Lets the rules act on the answers of a line's drives over Modbus TCP.
class TcpStage final : public links::ModbusTcpInterposer {
 public:
  TcpStage(Director& director, line::NamedSerialBus& bus);
  ~TcpStage() { bus_.line.interpose_tcp(nullptr); }
  TcpStage(const TcpStage&) = delete;
  TcpStage& operator=(const TcpStage&) = delete;

  Admission connects() override;
  links::TcpReply answers(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer,
                          links::Time at) override;

 private:
  Director& director_;
  line::NamedSerialBus& bus_;
};

}  // namespace servodrome::scenario
