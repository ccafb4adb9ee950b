#include "scenario/packets.hpp"

#include <algorithm>
#include <utility>

#include "canopen/301/sdo_wire.hpp"

namespace servodrome::scenario {

Packets::Packets(const Message& message, std::uint64_t seed, const Framing* framing)
    : packets_{{{message.bytes.begin(), message.bytes.end()}, message.id, Time{}}},
      object_(message.object.value_or(ObjectAddress{})),
      seed_(seed),
      framing_(framing) {}

void Packets::apply(const RuleRun& rule) {
  acted_ = true;
  const bool seals = framing_ != nullptr && (rule.rule->checksum || std::holds_alternative<Abort>(rule.rule->action));
  for (Packet& packet : packets_) {
    if (!seals) continue;
    const auto checksum = static_cast<std::ptrdiff_t>(std::min(packet.bytes.size(), framing_->checksum_bytes));
    packet.bytes.erase(packet.bytes.end() - checksum, packet.bytes.end());
  }
  std::visit([&](const auto& action) { change(action, rule); }, rule.rule->action);
  for (Packet& packet : packets_) {
    if (seals) framing_->seal(packet.bytes);
  }
}

void Packets::change(const Delay& delay, const RuleRun& rule) {
  const Time time = rule.lateness(delay, seed_);
  for (Packet& packet : packets_) packet.late += time;
}

void Packets::change(const Repeat& repeat, const RuleRun&) {
  const std::vector<Packet> originals = packets_;
  for (unsigned n = 1; n <= repeat.copies; ++n) {
    for (Packet copy : originals) {
      copy.late += repeat.gap * n;
      change(repeat.alter, copy);
      packets_.push_back(std::move(copy));
    }
  }
}

void Packets::change(const Alter& alter, Packet& packet) {
  if (alter.id) packet.id = *alter.id;
  for (std::size_t i = 0; i < std::min(alter.bytes.size(), packet.bytes.size()); ++i) {
    packet.bytes[i] = alter.bytes[i].value_or(packet.bytes[i]);
  }
  if (!alter.byte) return;
  const int size = static_cast<int>(packet.bytes.size());
  const int place = *alter.byte < 0 ? size + *alter.byte : *alter.byte;
  if (place < 0 || place >= size) return;
  std::uint8_t& byte = packet.bytes[static_cast<std::size_t>(place)];
  switch (alter.how) {
    case Alter::How::set: byte = static_cast<std::uint8_t>(alter.value); break;
    case Alter::How::flip: byte = static_cast<std::uint8_t>(byte ^ alter.value); break;
    case Alter::How::add: byte = static_cast<std::uint8_t>(byte + alter.value); break;
    case Alter::How::swap:
      if (alter.value < size) std::swap(byte, packet.bytes[alter.value]);
      break;
  }
}

void Packets::change(const Replace& replace, const RuleRun&) {
  for (Packet& packet : packets_) packet.bytes = replace.data;
}

void Packets::change(const Truncate& truncate, const RuleRun&) {
  for (Packet& packet : packets_) packet.bytes.resize(std::min<std::size_t>(truncate.length, packet.bytes.size()));
}

void Packets::change(const Extend& extend, const RuleRun&) {
  std::vector<Packet> parts;
  for (Packet& packet : std::exchange(packets_, {})) {
    if (extend.before && extend.gap > Time{}) {
      parts.push_back({extend.data, packet.id, packet.late});
      packet.late += extend.gap;
    } else {
      packet.bytes.insert(extend.before ? packet.bytes.begin() : packet.bytes.end(), extend.data.begin(),
                          extend.data.end());
    }
    parts.push_back(std::move(packet));
  }
  packets_ = std::move(parts);
}

// SDO abort transfer (CiA 301 7.2.4.3.17).
void Packets::change(const Abort& abort, const RuleRun&) {
  const auto byte = [](std::uint32_t value, unsigned n) { return static_cast<std::uint8_t>(value >> 8 * n); };
  aborts_ = true;
  abort_code_ = abort.code;
  for (Packet& packet : packets_) {
    if (framing_ != nullptr) {
      packet.bytes = framing_->refusal(packet.bytes, abort.code);
      continue;
    }
    packet.bytes = {canopen::sdo::abort_transfer, byte(object_.index, 0), byte(object_.index, 1),
                    object_.sub.value_or(0)};
    for (unsigned n = 0; n < 4; ++n) packet.bytes.push_back(byte(abort.code, n));
  }
}

}  // namespace servodrome::scenario
