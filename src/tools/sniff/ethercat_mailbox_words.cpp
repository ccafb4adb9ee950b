// Text for EtherCAT mailboxes: CoE, FoE and mailbox errors (ETG.1000.4 clause 5.6, ETG.1000.6 clauses 5.6 and 5.8).
#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "ethercat/slave/mailbox_wire.hpp"
#include "master/emergency.hpp"
#include "tools/sniff/ethercat_decoder.hpp"

namespace servodrome::master {
namespace {

using ethercat::CoeService;
using ethercat::load_u16;
using ethercat::load_u32;
using ethercat::MailboxType;

std::string information_text(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue,
                             std::vector<ObjectAddress>& objects) {
  constexpr std::size_t header = 4;
  if (message.size() < header + 2) return "SDO information of wrong length";
  const unsigned opcode = message[0] & 0x7FU;
  const std::span<const std::uint8_t> data = message.subspan(header);
  const std::uint16_t first = load_u16(data.data());
  const auto name_of = [&](std::uint16_t index, std::uint8_t sub) {
    objects.push_back({index, sub});
    return catalogue.title({index, sub});
  };
  switch (opcode) {
    case 1: return fmt::format("SDO information: which objects, list {}", first);
    case 2: return fmt::format("SDO information: list of objects, {} fragments follow", load_u16(&message[2]));
    case 3: return "SDO information: describe " + name_of(first, 0);
    case 4: return "SDO information: " + name_of(first, 0) + " is described";
    case 5: return "SDO information: describe " + name_of(first, data.size() > 2 ? data[2] : std::uint8_t{0});
    case 6: return "SDO information: " + name_of(first, data.size() > 2 ? data[2] : std::uint8_t{0}) + " is described";
    case 7: {
      if (data.size() < 4) break;
      const std::uint32_t code = load_u32(data.data());
      return fmt::format("SDO information refused: {:08X}h {}", code,
                         dictionary::text(static_cast<dictionary::AbortCode>(code)));
    }
    default: break;
  }
  return fmt::format("SDO information, service {}", opcode);
}

std::string file_text(std::span<const std::uint8_t> message) {
  if (message.size() < 6) return "FoE of wrong length";
  const std::uint32_t number = load_u32(&message[2]);
  const std::string_view rest(reinterpret_cast<const char*>(message.data()) + 6, message.size() - 6);
  switch (message[0]) {
    case 1: return fmt::format("FoE read \"{}\"", rest);
    case 2: return fmt::format("FoE write \"{}\"", rest);
    case 3: return fmt::format("FoE packet {}, {} bytes", number, rest.size());
    case 4: return fmt::format("FoE packet {} taken", number);
    case 5: return fmt::format("FoE error {:08X}h {}", number, rest);
    case 6: return "FoE busy";
    default: return fmt::format("FoE service {}", message[0]);
  }
}

}  // namespace

void EthercatDecoder::describe_mailbox(Slave& slave, std::span<const std::uint8_t> data, bool from_master,
                                       Decoded& decoded) {
  decoded.kind = FrameKind::mailbox;
  if (data.size() < ethercat::mailbox_header_size) {
    decoded.text = "mailbox message of wrong length";
    decoded.error = true;
    return;
  }
  const std::size_t length = load_u16(data.data());
  const std::span<const std::uint8_t> message = data.subspan(ethercat::mailbox_header_size);
  if (length > message.size()) {
    decoded.text = fmt::format("mailbox message whose length is {} bytes, with {} present", length, message.size());
    decoded.error = true;
    return;
  }
  switch (static_cast<MailboxType>(data[5] & 0x0F)) {
    case MailboxType::coe: return describe_coe(slave, message.first(length), from_master, decoded);
    case MailboxType::foe: decoded.text = file_text(message.first(length)); return;
    case MailboxType::error:
      decoded.error = true;
      decoded.text = length >= 4 ? fmt::format("mailbox error {:04X}h", load_u16(&message[2])) : "mailbox error";
      return;
    default: decoded.text = fmt::format("mailbox protocol {}: {}", data[5] & 0x0F, hex_text(message.first(length), 16));
  }
}

void EthercatDecoder::describe_coe(Slave& slave, std::span<const std::uint8_t> coe, bool from_master,
                                   Decoded& decoded) {
  if (coe.size() < ethercat::coe_header_size) {
    decoded.text = "CoE of wrong length";
    decoded.error = true;
    return;
  }
  const auto service = static_cast<CoeService>(coe[1] >> 4);
  const std::span<const std::uint8_t> message = coe.subspan(ethercat::coe_header_size);
  const ObjectCatalogue& catalogue = slave.model->catalogue;
  switch (service) {
    case CoeService::emergency: {
      decoded.kind = FrameKind::emcy;
      if (message.size() < 8) {
        decoded.text = "EMCY of wrong length";
        decoded.error = true;
        return;
      }
      Emergency emergency{.code = load_u16(message.data()), .error_register = message[2]};
      std::copy_n(message.begin() + 3, emergency.vendor.size(), emergency.vendor.begin());
      decoded.error = emergency.code >= 0x1000;
      decoded.text = text_of(emergency);
      return;
    }
    case CoeService::sdo_information:
      decoded.kind = FrameKind::sdo;
      decoded.text = information_text(message, catalogue, decoded.objects);
      return;
    case CoeService::sdo_request:
    case CoeService::sdo_response: {
      decoded.kind = FrameKind::sdo;
      const SdoConversation::Heard heard = slave.sdo.hear(from_master, message, catalogue);
      decoded.text = "SDO " + heard.text;
      decoded.error = heard.abort.has_value();
      if (!heard.object) return;
      decoded.objects.push_back(*heard.object);
      if (!heard.complete) return;
      const ObjectAddress object = *heard.object;
      // With complete access the data are sub-index 0 in two bytes and then the other sub-indices, not the value of one
      // object.
      const bool all = slave.sdo.complete_access();
      if (heard.carries_value && !all) decoded.values.push_back(decoded_value(object, heard.value, catalogue));
      if (!PdoObjects::concerns(object.index)) return;
      if (all) {
        slave.pdos.set_all(object, heard.value);
      } else {
        slave.pdos.set(object, heard.value);
      }
      return;
    }
    default: decoded.text = fmt::format("CoE service {}", static_cast<unsigned>(service));
  }
}

}  // namespace servodrome::master
