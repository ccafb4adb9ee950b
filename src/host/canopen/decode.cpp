#include "host/canopen/decode.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "canopen/301/sdo_wire.hpp"
#include "host/canopen/emergency.hpp"
#include "host/canopen/master.hpp"
#include "host/canopen/sdo_client.hpp"

namespace servodrome::host {
namespace {

using canopen::Frame;
namespace sdo = canopen::sdo;

std::string data_text(const Frame& frame) {
  std::string text;
  for (unsigned i = 0; i < frame.length; ++i) text += fmt::format("{}{:02X}", i == 0 ? "" : " ", frame.data[i]);
  return text;
}

std::string describe_nmt(const Frame& frame) {
  if (frame.length != 2) return "NMT  of wrong length";
  const auto word = [&]() -> const char* {
    switch (static_cast<NmtCommand>(frame.data[0])) {
      case NmtCommand::start: return "start";
      case NmtCommand::stop: return "stop";
      case NmtCommand::enter_pre_operational: return "enter pre-operational";
      case NmtCommand::reset_node: return "reset node";
      case NmtCommand::reset_communication: return "reset communication";
    }
    return "unknown command";
  }();
  return frame.data[1] == 0 ? fmt::format("NMT  {}: all nodes", word)
                            : fmt::format("NMT  {}: node {}", word, frame.data[1]);
}

std::string value_in(const Frame& frame, const ObjectCatalogue& catalogue, ObjectAddress object) {
  const bool sized = (frame.data[0] & sdo::size_indicated) != 0;
  const std::size_t size = sized ? 4U - (frame.data[0] >> 2 & 3U) : 4U;
  const NamedObject* known = catalogue.find(object);
  return text_of_value(std::as_bytes(std::span(frame.data)).subspan(4, size), known ? known->type : std::nullopt);
}

// Segments carry no object and blocks no command, so a frame alone says only so much about them.
std::string describe_sdo(const Frame& frame, bool from_client, const ObjectCatalogue& catalogue) {
  if (frame.length != 8) return "SDO  of wrong length";
  const std::uint8_t command = frame.data[0];
  const ObjectAddress object{sdo::multiplexer_index(frame), frame.data[3]};
  const bool expedited = (command & sdo::expedited) != 0;
  if (command == sdo::abort_transfer) {
    const std::uint32_t code = sdo::get_u32(frame);
    return fmt::format("SDO  abort {}: {:04X} {:04X}h {}", catalogue.title(object), code >> 16, code & 0xFFFF,
                       dictionary::text(static_cast<AbortCode>(code)));
  }
  if (from_client) {
    switch (sdo::specifier(command)) {
      case sdo::client::initiate_upload: return "SDO  read " + catalogue.title(object);
      case sdo::client::initiate_download:
        return expedited
                   ? fmt::format("SDO  write {} = {}", catalogue.title(object), value_in(frame, catalogue, object))
                   : fmt::format("SDO  write {}, {} bytes in segments", catalogue.title(object), sdo::get_u32(frame));
      case sdo::client::upload_segment: return "SDO  next segment";
      case sdo::client::download_segment: return "SDO  segment";
      default: return "SDO  block transfer";
    }
  }
  switch (sdo::specifier(command)) {
    case 2:
      return expedited ? fmt::format("SDO  {} is {}", catalogue.title(object), value_in(frame, catalogue, object))
                       : fmt::format("SDO  {} has {} bytes", catalogue.title(object), sdo::get_u32(frame));
    case 3: return "SDO  written " + catalogue.title(object);
    case 0: return "SDO  segment";
    case 1: return "SDO  segment taken";
    default: return "SDO  block transfer";
  }
}

std::string describe_error_control(const Frame& frame) {
  if (frame.remote) return "guarding request";
  if (frame.length != 1) return "error control of wrong length";
  if (frame.data[0] == 0) return "boot-up";
  return fmt::format("heartbeat {}", name(static_cast<NmtState>(frame.data[0] & 0x7F)));
}

std::string describe_lss(const Frame& frame) { return fmt::format("LSS  command {:02X}h", frame.data[0]); }

}  // namespace

std::string describe(const Frame& frame, const ObjectCatalogue& catalogue) {
  if (frame.extended) return "";
  if (frame.id == 0x000) return describe_nmt(frame);
  if (frame.id == 0x080) return frame.length == 1 ? fmt::format("SYNC  {}", frame.data[0]) : "SYNC";
  if (frame.id == 0x100) return "TIME";
  if (frame.id == 0x7E4 || frame.id == 0x7E5) return describe_lss(frame);
  const unsigned function = frame.id >> 7;
  const unsigned node_id = frame.id & 0x7F;
  if (node_id == 0) return "";
  const auto from = [node_id](const std::string& what) { return fmt::format("node {:<3} {}", node_id, what); };
  switch (function) {
    case 1: {
      const auto emergency = parse_emergency(frame);
      return from(emergency ? text_of(*emergency) : "EMCY of wrong length");
    }
    case 3:
    case 5:
    case 7:
    case 9: return from(fmt::format("TPDO{} {}", (function - 1) / 2, frame.remote ? "request" : data_text(frame)));
    case 4:
    case 6:
    case 8:
    case 10: return from(fmt::format("RPDO{} {}", (function - 2) / 2, data_text(frame)));
    case 11: return from(describe_sdo(frame, false, catalogue));
    case 12: return from(describe_sdo(frame, true, catalogue));
    case 14: return from(describe_error_control(frame));
    default: return "";
  }
}

std::string raw_text(const Frame& frame) {
  const std::string id = frame.extended ? fmt::format("{:08X}", frame.id) : fmt::format("{:03X}", frame.id);
  return fmt::format("{} [{}] {}", id, frame.length, frame.remote ? "remote" : data_text(frame));
}

}  // namespace servodrome::host
