#include "tools/sniff/modbus_tcp_decoder.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "modbus/tcp_connection.hpp"

namespace servodrome::master {
namespace {

using modbus::Mbap;
using modbus::read_u16;

constexpr std::size_t most_pending = 256;      // requests that wait for an answer
constexpr std::size_t most_connections = 256;  // connections tracked at the same time
constexpr std::size_t ethernet_header_bytes = 14;
constexpr std::uint16_t ethertype_ipv4 = 0x0800;
constexpr std::uint16_t ethertype_ipv6 = 0x86DD;
constexpr std::uint16_t ethertype_vlan = 0x8100;
constexpr std::uint8_t protocol_tcp = 6;
constexpr std::size_t least_tcp_header = 20;
constexpr std::uint8_t tcp_syn = 0x02;

}  // namespace

ModbusTcpDecoder::ModbusTcpDecoder() : standard_(SerialModel::standard()) {}

void ModbusTcpDecoder::set_model(unsigned unit, SerialModel model) {
  models_[unit] = std::make_shared<const SerialModel>(std::move(model));
}

const SerialModel& ModbusTcpDecoder::model_of(unsigned unit) const {
  for (const unsigned one : {unit, 0U}) {
    if (const auto found = models_.find(one); found != models_.end()) return *found->second;
  }
  // A single model applies to all units, such as 0 and 255.
  return models_.size() == 1 ? *models_.begin()->second : *standard_;
}

bool ModbusTcpDecoder::parse(std::span<const std::uint8_t> frame, Segment& segment) const {
  if (frame.size() < ethernet_header_bytes) return false;
  std::size_t at = ethernet_header_bytes;
  std::uint16_t type = read_u16(&frame[12]);
  if (type == ethertype_vlan && frame.size() >= at + 4) {
    type = read_u16(&frame[at + 2]);
    at += 4;
  }
  const std::span<const std::uint8_t> packet = frame.subspan(at);
  std::size_t addresses = 0;
  std::size_t address_bytes = 0;
  std::size_t tcp = 0;
  std::size_t end = 0;
  if (type == ethertype_ipv4 && packet.size() >= 20 && packet[0] >> 4 == 4) {
    const bool is_fragment = (read_u16(&packet[6]) & 0x1FFF) != 0;
    if (packet[9] != protocol_tcp || is_fragment) return false;
    addresses = 12;
    address_bytes = 4;
    tcp = 4U * (packet[0] & 0x0FU);
    end = read_u16(&packet[2]);
  } else if (type == ethertype_ipv6 && packet.size() >= 40 && packet[0] >> 4 == 6) {
    if (packet[6] != protocol_tcp) return false;
    addresses = 8;
    address_bytes = 16;
    tcp = 40;
    end = 40U + read_u16(&packet[4]);
  } else {
    return false;
  }
  // The length field may be 0 if the network adapter does the segmentation.
  if (end <= tcp || end > packet.size()) end = packet.size();
  if (tcp < 20 || end < tcp + least_tcp_header) return false;
  const std::size_t header = 4U * (packet[tcp + 12] >> 4);
  if (header < least_tcp_header || end < tcp + header) return false;
  const auto is_server = [&](std::size_t where) {
    return std::find(ports_.begin(), ports_.end(), read_u16(&packet[where])) != ports_.end();
  };
  segment.from_client = is_server(tcp + 2);
  if (!segment.from_client && !is_server(tcp)) return false;
  const auto side = [&](std::size_t number) {
    Flow bytes(packet.begin() + static_cast<std::ptrdiff_t>(addresses + number * address_bytes),
               packet.begin() + static_cast<std::ptrdiff_t>(addresses + (number + 1) * address_bytes));
    bytes.insert(bytes.end(), packet.begin() + static_cast<std::ptrdiff_t>(tcp + 2 * number),
                 packet.begin() + static_cast<std::ptrdiff_t>(tcp + 2 * number + 2));
    return bytes;
  };
  const Flow sender = side(0);
  const Flow receiver = side(1);
  const auto both = [](Flow one, const Flow& other) {
    one.insert(one.end(), other.begin(), other.end());
    return one;
  };
  segment.flow = both(sender, receiver);
  segment.connection = segment.from_client ? both(sender, receiver) : both(receiver, sender);
  segment.sequence = std::uint32_t{read_u16(&packet[tcp + 4])} << 16 | read_u16(&packet[tcp + 6]);
  segment.begins = (packet[tcp + 13] & tcp_syn) != 0;
  segment.data = packet.subspan(tcp + header, end - tcp - header);
  return true;
}

bool ModbusTcpDecoder::takes(std::span<const std::uint8_t> ethernet_frame) const {
  Segment segment;
  return parse(ethernet_frame, segment);
}

std::vector<Decoded> ModbusTcpDecoder::decode(std::span<const std::uint8_t> ethernet_frame, Time time) {
  Segment segment;
  if (!parse(ethernet_frame, segment)) return {};
  if (streams_.size() >= 2 * most_connections && !streams_.contains(segment.flow)) streams_.clear();
  if (connections_.size() >= most_connections && !connections_.contains(segment.connection)) connections_.clear();
  Stream& stream = streams_[segment.flow];
  if (segment.begins) {
    stream = {segment.sequence + 1, true, {}};
    return {};
  }
  if (segment.data.empty()) return {};
  std::vector<Decoded> all;
  const auto ahead = static_cast<std::int32_t>(segment.sequence - stream.next);
  if (stream.is_known && ahead < 0) {  // retransmission
    const auto known = static_cast<std::size_t>(-static_cast<std::int64_t>(ahead));
    if (known >= segment.data.size()) return {};
    segment.data = segment.data.subspan(known);
    segment.sequence += static_cast<std::uint32_t>(known);
  } else if (!stream.is_known || ahead > 0) {  // start of the capture or a gap: assumes that a message begins here
    stream.bytes.clear();
  }
  stream.is_known = true;
  stream.next = segment.sequence + static_cast<std::uint32_t>(segment.data.size());
  stream.bytes.insert(stream.bytes.end(), segment.data.begin(), segment.data.end());
  const std::uint64_t connection = connections_.try_emplace(segment.connection, connections_.size() + 1).first->second;
  std::size_t at = 0;
  while (stream.bytes.size() - at >= Mbap::size) {
    const Mbap header = Mbap::read(&stream.bytes[at]);
    const std::size_t size = Mbap::size - 1 + header.length;
    if (header.is_valid() && stream.bytes.size() - at < size) break;
    if (!header.is_valid()) {
      Decoded decoded;
      decoded.time = time;
      decoded.error = true;
      decoded.raw = hex_text(std::span(stream.bytes).subspan(at));
      decoded.text = "no Modbus TCP: the header is wrong";
      all.push_back(std::move(decoded));
      at = stream.bytes.size();
      break;
    }
    all.push_back(decode_message(std::span(stream.bytes).subspan(at, size), time, segment.from_client, connection));
    at += size;
  }
  stream.bytes.erase(stream.bytes.begin(), stream.bytes.begin() + static_cast<std::ptrdiff_t>(at));
  return all;
}

Decoded ModbusTcpDecoder::decode_message(std::span<const std::uint8_t> message, Time time, bool from_client,
                                         std::uint64_t connection) {
  Decoded decoded;
  decoded.time = time;
  decoded.raw = hex_text(message);
  if (message.size() <= Mbap::size) {
    decoded.error = true;
    decoded.text = "no Modbus TCP: the message is too short";
    return decoded;
  }
  const Mbap header = Mbap::read(message.data());
  const std::span<const std::uint8_t> pdu = message.subspan(Mbap::size);
  const SerialModel& model = model_of(header.unit);
  decoded.node = header.unit;
  decoded.source = fmt::format("unit {}", header.unit);
  if (from_client) {
    ModbusRequest request = describe_modbus_request(header.unit, pdu, model, decoded);
    if (pending_.size() == most_pending) pending_.pop_front();
    pending_.push_back({connection, header.transaction, std::move(request)});
    return decoded;
  }
  const auto found = std::find_if(pending_.begin(), pending_.end(), [&](const Pending& one) {
    return one.connection == connection && one.transaction == header.transaction;
  });
  const bool is_awaited = found != pending_.end() && (found->request.function == pdu[0] ||
                                                      found->request.function == answered_function(pdu[0], model));
  describe_modbus_response(pdu, is_awaited ? &found->request : nullptr, model, decoded);
  if (found != pending_.end()) pending_.erase(found);
  return decoded;
}

}  // namespace servodrome::master
