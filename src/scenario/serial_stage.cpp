#include "scenario/serial_stage.hpp"

#include <algorithm>
#include <utility>

#include "modbus/rtu_server.hpp"
#include "scenario/director.hpp"
#include "scenario/serial_framing.hpp"

namespace servodrome::scenario {
namespace {

// Longer than the pause that ends a Modbus frame at any usual bit rate, and shorter than the pause before a master's
// next request.
constexpr Time request_pause = std::chrono::milliseconds(2);

}  // namespace

std::vector<links::SerialPiece> pieces_of(const Packets& packets, const std::vector<RuleRun*>& acting) {
  Time gap{};
  for (const RuleRun* run : acting) {
    if (const auto* slow = std::get_if<Slow>(&run->rule->action)) gap = slow->gap;
  }
  std::vector<links::SerialPiece> pieces;
  Time before{};
  for (const Packet& packet : packets.all()) {
    const Time pause = std::max(packet.late - before, Time{});
    before = packet.late;
    if (gap == Time{}) {
      pieces.push_back({pause, packet.bytes});
      continue;
    }
    for (std::size_t i = 0; i < packet.bytes.size(); ++i) pieces.push_back({i == 0 ? pause : gap, {packet.bytes[i]}});
  }
  return pieces;
}

void RuleStation::send(std::span<const std::uint8_t> characters, Time now) {
  waiting_.insert(waiting_.end(), characters.begin(), characters.end());
  due_ = now;
}

std::span<const std::uint8_t> RuleStation::take() {
  std::swap(waiting_, taken_);
  waiting_.clear();
  return taken_;
}

SerialStage::SerialStage(Director& director, line::Axis& axis, line::NamedSerialBus& bus)
    : director_(director), axis_(axis), bus_(bus) {
  bus.line.interpose(axis.serial_line_port(), this);
}

SerialStage::~SerialStage() { bus_.line.interpose(axis_.serial_line_port(), nullptr); }

const Framing& SerialStage::framing() const { return speaks_modbus(axis_) ? rtu_framing : serial10_framing; }

void SerialStage::cut(bool is_cut) {
  is_cut_ = is_cut;
  if (is_cut) bus_.line.discard(axis_.serial_line_port());
}

std::vector<links::SerialPiece> SerialStage::answers(std::span<const std::uint8_t> answer, Time at) {
  if (is_cut_) return {};
  Message said = serial_message(answer, speaks_modbus(axis_));
  said.add(MessageKind::answer);
  said.add(MessageKind::from_drive);
  Packets packets(said, director_.seed(), &framing());
  std::vector<RuleRun*> acting;
  if (director_.carry_out(&axis_, said, packets, &acting)) return pieces_of(packets, acting);
  director_.passed(&axis_, said);
  return SerialInterposer::answers(answer, at);
}

void SerialStage::speak(std::span<const std::uint8_t> characters, Time at) {
  for (const links::SerialPiece& piece : answers(characters, at)) {
    at += piece.pause;
    director_.at(at, axis_, [this, spoken = piece.characters] {
      if (axis_.powered() && !is_cut_) {
        bus_.line.transmit(axis_.serial_line_port(), spoken, director_.now());
      }
    });
    at += bus_.line.format().character_time() * static_cast<std::int64_t>(piece.characters.size());
  }
}

// A rule acts on the last character of a request, because the drive has already received the others. To withhold a
// request, the stage falsifies its checksum: the drive then drops the request at once and accepts the next one.
bool SerialStage::receives(std::uint8_t& character, bool& intact, Time at) {
  if (is_cut_) return false;
  if (at - heard_at_ > request_pause || request_.size() > modbus::longest_rtu_frame) request_.clear();
  heard_at_ = at;
  request_.push_back(character);
  const products::SerialPort* port = axis_.serial_port();
  if (!intact || port == nullptr || !is_request(request_, speaks_modbus(axis_), port->station())) return true;
  const std::vector<std::uint8_t> request = std::exchange(request_, {});
  Message asked = serial_message(request, speaks_modbus(axis_));
  asked.add(MessageKind::request);
  asked.add(MessageKind::to_drive);
  Packets packets(asked, director_.seed(), &framing());
  if (!director_.carry_out(&axis_, asked, packets)) {
    director_.passed(&axis_, asked);
    return true;
  }
  const auto& left = packets.all();
  if (left.size() == 1 && left.front().bytes == request) return true;
  if (packets.aborts() && !left.empty()) {
    director_.at(at + request_pause, axis_, [this, refusal = left.front().bytes] { speak(refusal, director_.now()); });
  }
  character = static_cast<std::uint8_t>(character ^ 0xFFU);
  return true;
}

}  // namespace servodrome::scenario
