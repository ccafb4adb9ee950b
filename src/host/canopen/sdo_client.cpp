#include "host/canopen/sdo_client.hpp"

#include <fmt/format.h>

namespace servodrome::host {
namespace {

constexpr std::uint32_t request_base = 0x600;
constexpr std::uint32_t response_base = 0x580;

std::string what_happened(bool upload, AbortCode code, bool from_node) {
  const char* access = upload ? "read" : "write";
  if (!from_node && code == AbortCode::protocol_timed_out) return fmt::format("no answer to the {}", access);
  return fmt::format("{} {}: {} ({:04X} {:04X}h)", access, from_node ? "refused" : "given up", dictionary::text(code),
                     static_cast<std::uint32_t>(code) >> 16, static_cast<std::uint32_t>(code) & 0xFFFF);
}

std::string what_to_do(AbortCode code, bool from_node) {
  if (!from_node && code == AbortCode::protocol_timed_out) {
    return "check the node-ID and the bit rate (`servodrome scan`), that the node is powered and not in NMT state "
           "stopped, "
           "or give a longer --timeout";
  }
  switch (code) {
    case AbortCode::object_does_not_exist:
    case AbortCode::sub_index_does_not_exist: return "look up the object in the node's EDS or manual";
    case AbortCode::read_only: return "this value cannot be written";
    case AbortCode::write_only: return "this value cannot be read back";
    case AbortCode::value_invalid:
    case AbortCode::value_too_high:
    case AbortCode::value_too_low: return "give a value within the object's range";
    case AbortCode::length_mismatch:
    case AbortCode::length_too_high:
    case AbortCode::length_too_low: return "give the object's own data type with --type";
    case AbortCode::device_state:
    case AbortCode::local_control: return "bring the drive into another state first (disable it, stop the motion)";
    default: return "see the node's manual for this abort code";
  }
}

bool is_absent(AbortCode code) {
  return code == AbortCode::object_does_not_exist || code == AbortCode::sub_index_does_not_exist;
}
}  // namespace

SdoError::SdoError(const std::string& bus, std::uint8_t node_id, ObjectAddress object, bool upload, AbortCode code,
                   bool from_node)
    : ObjectError(what_happened(upload, code, from_node), fmt::format("{}, node {}, {}", bus, node_id, text_of(object)),
                  what_to_do(code, from_node), is_absent(code)),
      node_id_(node_id),
      object_(object),
      code_(code),
      from_node_(from_node) {}

SdoClient::SdoClient(Bus& bus, std::uint8_t node_id, const SdoOptions& options)
    : bus_(bus), node_id_(node_id), options_(options) {
  if (node_id < 1 || node_id > 127) {
    throw HostError(fmt::format("{} is no node-ID", node_id), bus.name(), "give one from 1 to 127");
  }
}

void SdoClient::send_waiting(SdoTransfer& transfer) {
  Frame frame;
  while (transfer.take(frame)) {
    frame.id = request_base + node_id_;
    bus_.send(frame);
  }
}

void SdoClient::run(SdoTransfer& transfer) {
  bus_.drain();  // late answers to what was given up
  Time deadline{};
  unsigned retries = options_.retries;
  // Asking again comes early, before the server gives up in its turn.
  const auto expect_answer = [&] {
    const bool early = retries != 0 && transfer.can_ask_again();
    deadline = bus_.now() + (early ? options_.timeout / 2 : options_.timeout);
  };
  const Bus::Subscription listening = bus_.listen([&](const Frame& frame) {
    if (frame.id != response_base + node_id_ || frame.extended || frame.remote) return;
    if (transfer.receive(frame)) expect_answer();
    send_waiting(transfer);
  });
  send_waiting(transfer);
  expect_answer();
  while (!transfer.finished()) {
    // The deadline moves with each answer.
    bus_.run_until(deadline, [&] { return transfer.finished(); });
    if (transfer.finished() || bus_.now() < deadline) continue;
    if (retries != 0 && transfer.can_ask_again()) {
      --retries;
      transfer.ask_again();
    } else {
      transfer.abort(AbortCode::protocol_timed_out);
    }
    send_waiting(transfer);
    expect_answer();
  }
}

std::vector<std::byte> SdoClient::upload(ObjectAddress object, SdoProtocol protocol) {
  for (unsigned attempt = 0;; ++attempt) {
    SdoTransfer transfer = SdoTransfer::upload(object, protocol);
    run(transfer);
    if (transfer.result() == AbortCode::none) return transfer.data();
    // Whichever side lost patience first.
    const bool timed_out = transfer.result() == AbortCode::protocol_timed_out;
    if (!timed_out || attempt >= options_.retries) {
      throw SdoError(bus_.name(), node_id_, object, true, transfer.result(), transfer.aborted_by_server());
    }
  }
}

void SdoClient::download(ObjectAddress object, std::span<const std::byte> data, SdoProtocol protocol) {
  SdoTransfer transfer = SdoTransfer::download(object, data, protocol);
  run(transfer);
  if (transfer.result() != AbortCode::none) {
    throw SdoError(bus_.name(), node_id_, object, false, transfer.result(), transfer.aborted_by_server());
  }
}

std::string SdoClient::where() const { return fmt::format("{}, node {}", bus_.name(), node_id_); }

}  // namespace servodrome::host
