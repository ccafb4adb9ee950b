#include "studio/foreign_writes.hpp"

#include <cstring>
#include <utility>

#include "canopen/301/sdo_wire.hpp"
#include "canopen/connection_set.hpp"
#include "catalogue/product.hpp"

namespace servodrome::studio {
namespace {

namespace sdo = canopen::sdo;
namespace connection_set = canopen::connection_set;

constexpr std::uint32_t node_id_bits = 0x7F;
constexpr std::uint8_t boot_up = 0;                        // CiA 301 7.2.8.3.3.2
constexpr auto longest_silence = std::chrono::seconds(5);  // of a master within a transfer
constexpr std::size_t most_waiting = 1000;                 // more writes between two calls of take() are not kept

// The object that a message names: an initiate request or response, or an abort (CiA 301 7.2.4.3).
std::optional<master::ObjectAddress> object_of(const canopen::Frame& message, bool is_request) {
  constexpr std::size_t named_bytes = 4;
  const std::uint8_t command = message.data[0];
  const bool begins_block = (command & (is_request ? sdo::last_segment : sdo::subcommand_mask)) == 0;
  bool names = false;
  switch (sdo::specifier(command)) {
    case 1: names = is_request; break;   // initiate download
    case 2: names = true; break;         // initiate upload, and its response
    case 3: names = !is_request; break;  // response to initiate download
    case 4: names = true; break;         // abort
    case 5:
    case 6: names = begins_block; break;
    default: break;
  }
  if (!names || message.length < named_bytes) return std::nullopt;
  return master::ObjectAddress{sdo::multiplexer_index(message), message.data[3]};
}

// The value in an initiate request or response that carries it with its size; empty: another message.
std::span<const std::byte> expedited_value(const canopen::Frame& message) {
  const std::uint8_t command = message.data[0];
  const bool initiates = sdo::specifier(command) == sdo::client::initiate_download ||
                         sdo::specifier(command) == sdo::client::initiate_upload;
  constexpr std::uint8_t with_size = sdo::expedited | sdo::size_indicated;
  if (!initiates || (command & with_size) != with_size) return {};
  return std::as_bytes(std::span(message.data)).subspan(4, 4U - (command >> 2 & 3U));
}

bool is_request_to_write(const canopen::Frame& request) {
  const std::uint8_t specifier = sdo::specifier(request.data[0]);
  return specifier == sdo::client::initiate_download || specifier == sdo::client::block_download;
}

}  // namespace

ForeignWrites::ForeignWrites(std::span<const Node> nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    channels_.try_emplace(nodes[i].id, Channel{i, HeardValues(catalogue::product_of(nodes[i].product).rules)});
  }
}

links::Heard ForeignWrites::heard(links::Heard next) {
  for (auto& [id, channel] : channels_) channel.values.forget();
  return [this, next = std::move(next)](bool sent, std::span<const std::uint8_t> bytes) {
    canopen::Frame frame;
    std::memcpy(&frame, bytes.data(), sizeof frame);
    hear(sent, frame);
    next(sent, bytes);
  };
}

// Returns true if the response answers a request of this program.
bool ForeignWrites::is_own(Channel& channel, const canopen::Frame& response) {
  if (!channel.own) return false;
  const auto object = object_of(response, false);
  if (!object) return true;
  const bool fits = object == channel.own && (channel.foreign != channel.own || channel.own_is_first);
  if (fits) channel.own.reset();
  return fits;
}

// Takes values from expedited transfers only. After a segmented or block transfer the value is unknown.
void ForeignWrites::hear_own_answer(Channel& channel, const canopen::Frame& response) {
  const auto object = object_of(response, false);
  if (!object) return;
  switch (sdo::specifier(response.data[0])) {
    case sdo::client::initiate_upload:
      if (const auto value = expedited_value(response); !value.empty()) channel.values.note_read(*object, value);
      break;
    case 3:  // response to initiate download
      if (!channel.own_value.empty()) channel.values.note_write(*object, channel.own_value);
      break;
    case sdo::client::abort: channel.values.note_refusal(*object); break;
    default: break;
  }
}

void ForeignWrites::hear(bool sent, const canopen::Frame& frame) {
  const std::uint32_t kind = frame.id & ~node_id_bits;
  const bool boots = kind == connection_set::error_control && frame.length == 1 && frame.data[0] == boot_up;
  const bool is_sdo = kind == connection_set::sdo_request || kind == connection_set::sdo_response;
  if ((!boots && !is_sdo) || frame.extended || frame.remote) return;
  const auto found = channels_.find(frame.id & node_id_bits);
  if (found == channels_.end()) return;
  Channel& channel = found->second;
  if (boots) return channel.values.forget();
  const bool is_request = kind == connection_set::sdo_request;
  const auto object = object_of(frame, is_request);
  if (is_request && sent) {
    if (sdo::specifier(frame.data[0]) == sdo::client::abort) return channel.own.reset();
    if (!object) return;
    channel.own = object;
    channel.own_is_first = !channel.foreign;
    channel.own_value.clear();
    if (is_request_to_write(frame)) {
      const auto value = expedited_value(frame);
      channel.own_value.assign(value.begin(), value.end());
      channel.values.note_request(*object);
    }
    return;
  }
  const auto now = Clock::now();
  if (now - channel.heard > longest_silence) {  // the other master has given its transfer up
    channel.foreign.reset();
    channel.in_block = false;
  }
  if (is_request) channel.heard = now;
  if (is_request && object && !channel.in_block) {
    channel.foreign = object;
    channel.own_is_first = channel.own.has_value();
    channel.in_block = sdo::specifier(frame.data[0]) == sdo::client::block_download;
    if (is_request_to_write(frame)) channel.values.note_request(*object);
  }
  if (!is_request && is_own(channel, frame)) return hear_own_answer(channel, frame);
  if (!channel.foreign) return;
  const auto heard = channel.conversation.hear(is_request, std::span(frame.data).first(frame.length),
                                               master::ObjectCatalogue::standard());
  if (!heard.abort && (is_request || !heard.complete)) return;
  channel.foreign.reset();
  channel.in_block = false;
  if (heard.abort) {
    if (!is_request) channel.values.note_refusal(*heard.object);
    return;
  }
  if (!heard.write) {
    if (const auto value = expedited_value(frame); !value.empty()) channel.values.note_read(*heard.object, value);
    return;
  }
  const api::KeptValue before = channel.values.note_write(*heard.object, heard.value);
  const std::lock_guard lock(mutex_);
  if (writes_.size() >= most_waiting) return;
  writes_.push_back({channel.drive, *heard.object, {before.bytes().begin(), before.bytes().end()}, heard.value});
}

std::vector<ForeignWrites::Write> ForeignWrites::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(writes_, {});
}

}  // namespace servodrome::studio
