#include "scenario/serial_stage.hpp"

#include <algorithm>

#include "modbus/crc16.hpp"
#include "modbus/rtu_server.hpp"
#include "scenario/director.hpp"
#include "serial10/frame.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::uint8_t exception_bit = 0x80;  // of the function code (MODBUS Application Protocol, clause 7)
constexpr std::size_t mbap_bytes = 7;         // transaction 2, protocol 2, length 2, unit 1
constexpr std::size_t least_rtu_bytes = 4;    // station, function, CRC
// Longer than the pause that ends a Modbus frame at any usual bit rate; a master's next request comes later.
constexpr Time request_pause = std::chrono::milliseconds(2);

bool is_modbus(const line::Axis& axis) {
  const products::SerialPort* port = axis.serial_port();
  return port != nullptr && port->protocol() == products::SerialProtocol::modbus_rtu;
}

// An exception response of Modbus RTU, or an error of the 10-byte protocol (iSMK manual, ch. 8.4.1), in place of `of`.
std::vector<std::uint8_t> refusal(std::span<const std::uint8_t> of, bool modbus, std::uint32_t code) {
  if (modbus) {
    const auto function = static_cast<std::uint8_t>(of[1] | exception_bit);
    return {of[0], function, static_cast<std::uint8_t>(code), 0, 0};
  }
  std::vector<std::uint8_t> bytes(of.begin(), of.end());
  bytes.resize(serial10::frame_bytes);
  bytes[1] = static_cast<std::uint8_t>(serial10::Command::error);
  for (unsigned n = 0; n < 4; ++n) bytes[5 + n] = static_cast<std::uint8_t>(code >> 8 * n);
  return bytes;
}

// Computes the checksum at the end of a message again.
void correct(std::vector<std::uint8_t>& bytes, bool modbus) {
  if (modbus && bytes.size() >= 2) {
    const std::uint16_t crc = modbus::crc16(std::span(bytes).first(bytes.size() - 2));
    bytes[bytes.size() - 2] = static_cast<std::uint8_t>(crc);
    bytes[bytes.size() - 1] = static_cast<std::uint8_t>(crc >> 8);
  } else if (!modbus && !bytes.empty()) {
    unsigned sum = 0;
    for (std::size_t i = 0; i + 1 < bytes.size(); ++i) sum += bytes[i];
    bytes.back() = static_cast<std::uint8_t>(0x100U - sum % 0x100U);
  }
}

}  // namespace

SerialStage::SerialStage(Director& director, line::Axis& axis, line::NamedSerialBus& bus)
    : director_(director), axis_(axis), bus_(bus) {
  bus.line.interpose(axis.serial_line_port(), this);
}

SerialStage::~SerialStage() { bus_.line.interpose(axis_.serial_line_port(), nullptr); }

Message SerialStage::message(std::span<const std::uint8_t> bytes) const {
  Message message;
  message.bytes = bytes;
  if (is_modbus(axis_)) {
    if (bytes.size() > 1) message.function = static_cast<std::uint8_t>(bytes[1] & ~exception_bit);
  } else if (bytes.size() == serial10::frame_bytes) {
    message.object = ObjectAddress{static_cast<std::uint16_t>(bytes[2] | bytes[3] << 8), bytes[4]};
  }
  return message;
}

std::vector<links::SerialPiece> SerialStage::answers(std::span<const std::uint8_t> answer, Time at) {
  Message said = message(answer);
  said.add(MessageKind::answer);
  said.add(MessageKind::from_drive);
  Packets packets(said, director_.seed());
  std::vector<RuleRun*> acting;
  if (!director_.carry_out(&axis_, said, packets, &acting)) {
    director_.passed(&axis_, said);
    return SerialInterposer::answers(answer, at);
  }
  const bool modbus = is_modbus(axis_);
  const bool corrects = std::any_of(acting.begin(), acting.end(), [](const auto* run) { return run->rule->checksum; });
  Time gap{};
  for (const RuleRun* run : acting) {
    if (const auto* slow = std::get_if<Slow>(&run->rule->action)) gap = slow->gap;
  }
  std::vector<links::SerialPiece> pieces;
  Time before{};
  for (const Packet& packet : packets.all()) {
    std::vector<std::uint8_t> bytes = packets.aborts() ? refusal(answer, modbus, packets.abort_code()) : packet.bytes;
    if (corrects || packets.aborts()) correct(bytes, modbus);
    const Time pause = std::max(packet.late - before, Time{});
    before = packet.late;
    if (gap == Time{}) {
      pieces.push_back({pause, std::move(bytes)});
      continue;
    }
    for (std::size_t i = 0; i < bytes.size(); ++i) pieces.push_back({i == 0 ? pause : gap, {bytes[i]}});
  }
  return pieces;
}

// A request is complete with its checksum; characters that belong to another station are no request.
bool SerialStage::completes_request() const {
  const products::SerialPort* port = axis_.serial_port();
  if (port == nullptr || request_.empty()) return false;
  if (is_modbus(axis_)) {
    return request_.size() >= least_rtu_bytes && (request_[0] == port->station() || request_[0] == 0) &&
           modbus::crc16(request_) == 0;
  }
  serial10::Frame frame;
  if (request_.size() != serial10::frame_bytes) return false;
  std::copy(request_.begin(), request_.end(), frame.bytes.begin());
  return frame.is_intact() && (frame.id() == port->station() || frame.id() == serial10::universal_id);
}

// A rule acts with the last character of a request: the characters before it have been received. So a request that a
// rule changes is one that the drive finds damaged.
bool SerialStage::receives(std::uint8_t& character, bool& intact, Time at) {
  if (at - heard_at_ > request_pause || request_.size() > modbus::longest_rtu_frame) request_.clear();
  heard_at_ = at;
  request_.push_back(character);
  if (!intact || !completes_request()) return true;
  Message asked = message(request_);
  asked.add(MessageKind::request);
  asked.add(MessageKind::to_drive);
  Packets packets(asked, director_.seed());
  if (!director_.carry_out(&axis_, asked, packets)) {
    director_.passed(&axis_, asked);
    return true;
  }
  if (packets.aborts()) {
    std::vector<std::uint8_t> bytes = refusal(request_, is_modbus(axis_), packets.abort_code());
    correct(bytes, is_modbus(axis_));
    director_.at(at + std::chrono::milliseconds(1), [this, bytes] {
      if (axis_.powered()) bus_.line.transmit(axis_.serial_line_port(), bytes, director_.now());
    });
    return false;
  }
  if (packets.all().empty()) return false;
  const bool same =
      packets.all().size() == 1 && std::equal(request_.begin(), request_.end(), packets.all().front().bytes.begin(),
                                              packets.all().front().bytes.end());
  if (!same) character = static_cast<std::uint8_t>(character ^ 0xFFU);
  return true;
}

TcpStage::TcpStage(Director& director, line::NamedSerialBus& bus) : director_(director), bus_(bus) {
  bus.line.interpose_tcp(this);
}

links::ModbusTcpInterposer::Admission TcpStage::connects() {
  return director_.refuses_connections(bus_.settings.name) ? Admission::reset : Admission::serve;
}

links::TcpReply TcpStage::answers(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer,
                                  Time at) {
  const auto described = [](std::span<const std::uint8_t> bytes, MessageKind kind) {
    Message message;
    message.bytes = bytes;
    message.add(kind);
    if (bytes.size() > mbap_bytes) message.function = static_cast<std::uint8_t>(bytes[mbap_bytes] & ~exception_bit);
    return message;
  };
  line::Axis* axis = director_.axis_of_unit(bus_, request.size() >= mbap_bytes ? request[mbap_bytes - 1] : 0);
  director_.passed(axis, described(request, MessageKind::request));
  const Message said = described(answer, MessageKind::answer);
  Packets packets(said, director_.seed());
  std::vector<RuleRun*> acting;
  if (!director_.carry_out(axis, said, packets, &acting)) {
    director_.passed(axis, said);
    return ModbusTcpInterposer::answers(request, answer, at);
  }
  links::TcpReply reply;
  for (const Packet& packet : packets.all()) {
    reply.bytes.insert(reply.bytes.end(), packet.bytes.begin(), packet.bytes.end());
    reply.delay = std::max(reply.delay, packet.late);
  }
  if (packets.aborts() && answer.size() > mbap_bytes) {
    reply.bytes.assign(answer.begin(), answer.begin() + mbap_bytes);
    reply.bytes[4] = 0;
    reply.bytes[5] = 3;  // unit, function and code follow
    reply.bytes.push_back(static_cast<std::uint8_t>(answer[mbap_bytes] | exception_bit));
    reply.bytes.push_back(static_cast<std::uint8_t>(packets.abort_code()));
  }
  for (const RuleRun* run : acting) {
    const auto* close = std::get_if<Close>(&run->rule->action);
    if (close == nullptr) continue;
    reply.closes = true;
    reply.bytes.resize(std::min<std::size_t>(reply.bytes.size(), close->length));
  }
  return reply;
}

}  // namespace servodrome::scenario
