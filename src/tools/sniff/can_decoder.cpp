#include "tools/sniff/can_decoder.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "canopen/object_access.hpp"
#include "master/canopen/emergency.hpp"
#include "master/canopen/master.hpp"
#include "tools/sniff/can_services.hpp"

namespace servodrome::master {
namespace {

using canopen::Frame;

constexpr std::uint16_t rpdo_communication = 0x1400;
constexpr std::uint16_t tpdo_communication = 0x1800;
constexpr std::uint16_t to_mapping = 0x0200;
constexpr std::uint16_t pdos_of_connection_set = 4;

// Default PDO mapping of a drive that has not been configured (CiA 402-2 clause 6).
std::vector<MappedField> profile_mapping(bool transmit, unsigned number) {
  constexpr std::array<std::uint32_t, 4> rpdos{0, 0x60600008, 0x607A0020, 0x60FF0020};
  constexpr std::array<std::uint32_t, 4> tpdos{0, 0x60610008, 0x60640020, 0x606C0020};
  if (number >= rpdos.size()) return {};
  std::vector<MappedField> mapping{MappedField::of(transmit ? 0x60410010 : 0x60400010)};
  if (const std::uint32_t second = transmit ? tpdos[number] : rpdos[number]; second != 0) {
    mapping.push_back(MappedField::of(second));
  }
  return mapping;
}

std::span<const std::uint8_t> data_of(const Frame& frame) {
  return std::span(frame.data).first(std::min<std::size_t>(frame.length, frame.data.size()));
}

}  // namespace

CanDecoder::CanDecoder() : standard_(DeviceModel::standard()) {}

void CanDecoder::set_model(std::uint8_t node_id, DeviceModel model) {
  models_[node_id] = std::make_shared<const DeviceModel>(std::move(model));
  nodes_.erase(node_id);
  if (node_id != 0) node(node_id);
}

CanDecoder::Node& CanDecoder::node(std::uint8_t node_id) {
  const auto [place, is_new] = nodes_.try_emplace(node_id);
  Node& made = place->second;
  if (is_new) {
    const auto own = models_.find(node_id);
    const auto common = models_.find(0);
    made.model = own != models_.end() ? own->second : common != models_.end() ? common->second : standard_;
    made.pdos = made.model->pdo_objects(node_id);
    if (!made.model->pdo_defaults.empty()) rebuild_places();
  }
  return made;
}

// If a TPDO and an RPDO have the same CAN-ID, the TPDO takes precedence, because its node sends the frame.
void CanDecoder::rebuild_places() {
  places_.clear();
  for (const bool transmit : {false, true}) {
    const std::uint16_t first = transmit ? tpdo_communication : rpdo_communication;
    for (const auto& [node_id, node] : nodes_) {
      for (std::uint16_t number = 0; number < 0x200; ++number) {
        const auto cob_id = node.pdos.get(static_cast<std::uint16_t>(first + number), 1);
        if (!cob_id || (*cob_id & canopen::cob_id::invalid) != 0) continue;
        places_[*cob_id & canopen::cob_id::can_id_mask] = {node_id, transmit, number};
      }
    }
  }
}

CanDecoder::Place CanDecoder::place_of(std::uint32_t can_id) {
  const auto node_id = static_cast<std::uint8_t>(can_id & 0x7F);
  const unsigned function = can_id >> 7;
  const bool predefined = node_id != 0 && function >= 3 && function <= 10;
  if (predefined) node(node_id);
  if (const auto found = places_.find(can_id); found != places_.end()) return found->second;
  if (!predefined) return {};
  const bool transmit = function % 2 == 1;
  const auto number = static_cast<std::uint16_t>((function - 3) / 2);
  static_assert((10 - 3) / 2 < pdos_of_connection_set);
  // If the node's COB-ID of this PDO is known to differ, the default COB-ID is not valid for it.
  const std::uint16_t communication = transmit ? tpdo_communication : rpdo_communication;
  if (node(node_id).pdos.get(static_cast<std::uint16_t>(communication + number), 1)) return {};
  return {node_id, transmit, number};
}

Decoded CanDecoder::decode(const Frame& frame, Time time) {
  Decoded decoded;
  decoded.time = time;
  decoded.raw = raw_text(frame);
  decoded.kind = FrameKind::can;
  if (frame.length > frame.data.size()) {
    decoded.kind = FrameKind::garbage;
    decoded.text = fmt::format("a length of {} is not a classical CAN frame", frame.length);
    decoded.error = true;
    return decoded;
  }
  if (frame.extended) {
    decoded.text = "29-bit identifier: not used by CANopen";
    return decoded;
  }
  if (decode_service(frame, decoded)) return decoded;
  const auto node_id = static_cast<std::uint8_t>(frame.id & 0x7F);
  const unsigned function = frame.id >> 7;
  if (const Place place = place_of(frame.id); place.node_id != 0) {
    decode_pdo(frame, place, decoded);
  } else if (node_id != 0 && (function == 11 || function == 12)) {
    decode_sdo(frame, node_id, function == 12, decoded);
  }
  return decoded;
}

// Decodes the stateless services: all except SDO and PDO.
bool CanDecoder::decode_service(const Frame& frame, Decoded& decoded) {
  const auto as = [&](FrameKind kind, std::string text) {
    decoded.kind = kind;
    decoded.text = std::move(text);
    return true;
  };
  const auto of_node = [&](FrameKind kind, std::string text) {
    decoded.node = frame.id & 0x7F;
    decoded.source = fmt::format("node {}", *decoded.node);
    return as(kind, std::move(text));
  };
  switch (frame.id) {
    case 0x000:
      if (frame.length == 2 && frame.data[1] != 0) decoded.node = frame.data[1];
      // A reset node returns to its saved configuration, which is unknown (CiA 301 7.2.8.3.2).
      if (frame.length == 2 && (frame.data[0] == 0x81 || frame.data[0] == 0x82)) {
        std::erase_if(nodes_, [&](const auto& one) { return frame.data[1] == 0 || one.first == frame.data[1]; });
        rebuild_places();
      }
      return as(FrameKind::nmt, nmt_text(frame));
    case 0x080: return as(FrameKind::sync, frame.length == 1 ? fmt::format("SYNC {}", frame.data[0]) : "SYNC");
    case 0x100: return as(FrameKind::time, time_text(frame));
    case 0x7E4:
    case 0x7E5: return as(FrameKind::lss, lss_text(frame));
    default: break;
  }
  if ((frame.id & 0x7F) == 0) return false;
  switch (frame.id >> 7) {
    case 1: {
      const auto emergency = parse_emergency(frame);
      decoded.error = !emergency || emergency->code >= 0x1000;
      return of_node(FrameKind::emcy, emergency ? text_of(*emergency) : "EMCY of wrong length");
    }
    case 14:
      if (frame.remote) return of_node(FrameKind::guarding, "guarding request");
      if (frame.length != 1) return of_node(FrameKind::heartbeat, "error control of wrong length");
      if (frame.data[0] == 0) return of_node(FrameKind::heartbeat, "boot-up");
      return of_node(FrameKind::heartbeat,
                     fmt::format("heartbeat {}", name(static_cast<NmtState>(frame.data[0] & 0x7F))));
    default: return false;
  }
}

void CanDecoder::decode_sdo(const Frame& frame, std::uint8_t node_id, bool from_client, Decoded& decoded) {
  decoded.kind = FrameKind::sdo;
  decoded.node = node_id;
  decoded.source = fmt::format("node {}", node_id);
  if (frame.remote || frame.length != 8) {
    decoded.text = "SDO of wrong length";
    decoded.error = true;
    return;
  }
  Node& its = node(node_id);
  const SdoConversation::Heard heard = its.sdo.hear(from_client, frame.data, its.model->catalogue);
  decoded.text = "SDO " + heard.text;
  decoded.error = heard.abort.has_value();
  if (!heard.object) return;
  decoded.objects.push_back(*heard.object);
  if (heard.carries_value && heard.complete) {
    decoded.values.push_back(decoded_value(*heard.object, heard.value, its.model->catalogue));
  }
  if (heard.complete && PdoObjects::concerns(heard.object->index)) {
    its.pdos.set(*heard.object, heard.value);
    rebuild_places();
  }
}

void CanDecoder::decode_pdo(const Frame& frame, Place place, Decoded& decoded) {
  decoded.kind = FrameKind::pdo;
  decoded.node = place.node_id;
  decoded.source = fmt::format("node {}", place.node_id);
  const std::string title = fmt::format("{}{}", place.transmit ? "TPDO" : "RPDO", place.number + 1);
  if (frame.remote) {
    decoded.text = title + " request";
    return;
  }
  Node& its = node(place.node_id);
  const auto communication = place.transmit ? tpdo_communication : rpdo_communication;
  const auto known = its.pdos.mapping(static_cast<std::uint16_t>(communication + to_mapping + place.number));
  const auto mapping = known ? *known : profile_mapping(place.transmit, place.number);
  const unsigned bits = bits_of(mapping);
  // The default mapping is only an assumption, so its length must equal that of the frame.
  if (!known && bits != frame.length * 8U) {
    decoded.text = fmt::format("{} {}", title, hex_text(data_of(frame)));
    return;
  }
  decoded.values = values_of(mapping, data_of(frame), 0, its.model->catalogue);
  for (const DecodedValue& value : decoded.values) decoded.objects.push_back(value.object);
  decoded.error = frame.length * 8U < bits;
  decoded.text = fmt::format("{} {}{}", title, text_of(decoded.values),
                             decoded.error ? fmt::format(", {} bytes missing", (bits + 7) / 8 - frame.length) : "");
}

std::string raw_text(const Frame& frame) {
  const std::string id = frame.extended ? fmt::format("{:08X}", frame.id) : fmt::format("{:03X}", frame.id);
  return fmt::format("{} [{}] {}", id, frame.length, frame.remote ? "remote" : hex_text(data_of(frame)));
}

}  // namespace servodrome::master
