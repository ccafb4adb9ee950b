#include "scenario/tcp_stage.hpp"

#include <algorithm>
#include <iterator>

#include "modbus/tcp_connection.hpp"
#include "scenario/director.hpp"
#include "scenario/serial_framing.hpp"

namespace servodrome::scenario {

TcpStage::TcpStage(Director& director, line::NamedSerialBus& bus) : director_(director), bus_(bus) {
  bus.line.interpose_tcp(this);
}

links::ModbusTcpInterposer::Admission TcpStage::connects() {
  return director_.refuses_connections(bus_) ? Admission::reset : Admission::serve;
}

links::TcpReply TcpStage::answers(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer,
                                  links::Time at) {
  const std::uint8_t unit = request.size() < modbus::Mbap::size ? modbus::no_unit : request[modbus::Mbap::size - 1];
  line::Axis* axis = director_.axis_of_unit(bus_, unit);
  Message asked = tcp_message(request, MessageKind::request);
  Message said = tcp_message(answer, MessageKind::answer);
  if (axis == nullptr) asked.bus = said.bus = bus_.settings.name;
  director_.passed(axis, asked);
  Packets packets(said, director_.seed(), &tcp_framing);
  std::vector<RuleRun*> acting;
  if (!director_.carry_out(axis, said, packets, &acting)) {
    director_.passed(axis, said);
    return ModbusTcpInterposer::answers(request, answer, at);
  }
  std::vector<links::SerialPiece> pieces = pieces_of(packets, acting);
  links::TcpReply reply;
  if (!pieces.empty()) {
    reply.bytes = std::move(pieces.front().characters);
    reply.delay = pieces.front().pause;
    reply.then.assign(std::make_move_iterator(pieces.begin() + 1), std::make_move_iterator(pieces.end()));
  }
  for (const RuleRun* run : acting) {
    const auto* close = std::get_if<Close>(&run->rule->action);
    if (close == nullptr) continue;
    reply.closes = true;
    reply.then.clear();
    reply.bytes.resize(std::min<std::size_t>(reply.bytes.size(), close->length));
  }
  return reply;
}

}  // namespace servodrome::scenario
