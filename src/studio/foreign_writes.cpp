#include "studio/foreign_writes.hpp"

#include <cstring>
#include <utility>

namespace servodrome::studio {
namespace {

constexpr std::uint32_t node_id_bits = 0x7F;
constexpr std::uint32_t sdo_request = 0x600;   // CAN-ID of the client's messages, without the node-ID
constexpr std::uint32_t sdo_response = 0x580;  // of the drive's messages
constexpr std::size_t most_waiting = 1000;     // more writes between two calls of take() are not kept

}  // namespace

ForeignWrites::ForeignWrites(std::span<const unsigned> node_ids) {
  for (std::size_t i = 0; i < node_ids.size(); ++i) channels_.try_emplace(node_ids[i], Channel{i});
}

links::Heard ForeignWrites::heard(links::Heard next) {
  return [this, next = std::move(next)](bool sent, std::span<const std::uint8_t> bytes) {
    canopen::Frame frame;
    std::memcpy(&frame, bytes.data(), sizeof frame);
    hear(sent, frame);
    next(sent, bytes);
  };
}

void ForeignWrites::hear(bool sent, const canopen::Frame& frame) {
  const std::uint32_t kind = frame.id & ~node_id_bits;
  if ((kind != sdo_request && kind != sdo_response) || frame.extended || frame.remote) return;
  const auto found = channels_.find(frame.id & node_id_bits);
  if (found == channels_.end()) return;
  Channel& channel = found->second;
  if (kind == sdo_request) channel.foreign = !sent;
  const auto heard = channel.conversation.hear(kind == sdo_request, std::span(frame.data).first(frame.length),
                                               master::ObjectCatalogue::standard());
  if (!channel.foreign || !heard.write || !heard.complete || !heard.object) return;
  const std::lock_guard lock(mutex_);
  if (writes_.size() < most_waiting) writes_.push_back({channel.drive, *heard.object, heard.value});
}

std::vector<ForeignWrites::Write> ForeignWrites::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(writes_, {});
}

}  // namespace servodrome::studio
