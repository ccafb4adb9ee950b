#pragma once

#include "scenario/rule_run.hpp"

namespace servodrome::scenario {

// A message that leaves an interposer.
struct Packet {
  std::vector<std::uint8_t> bytes;
  std::uint32_t id = 0;  // CAN identifier
  Time late{};           // delay of the packet
};

// How a protocol of a serial line frames its messages.
struct Framing {
  std::size_t checksum_bytes = 0;                  // at the end of a message
  void (*seal)(std::vector<std::uint8_t>& bytes);  // appends the checksum, or corrects a length in the header
  // Returns a refusal with this code in place of a message. The message and the refusal have no checksum.
  std::vector<std::uint8_t> (*refusal)(std::span<const std::uint8_t> message, std::uint32_t code);
};

// The packets that replace a message, any number of them. Each act changes them in place.
class Packets {
 public:
  // Without `framing` an abort is an SDO abort for the message's object. `framing` must outlive this object.
  Packets(const Message& message, std::uint64_t seed, const Framing* framing = nullptr);

  void apply(const RuleRun& rule);

  const std::vector<Packet>& all() const { return packets_; }
  // The message passes unchanged and without delay.
  bool unchanged() const { return !acted_; }
  // The packets are aborts: of an SDO transfer, or refusals of a serial protocol.
  bool aborts() const { return aborts_; }
  std::uint32_t abort_code() const { return abort_code_; }

 private:
  void change(const Withhold&, const RuleRun&) { packets_.clear(); }
  void change(const Delay& delay, const RuleRun& rule);
  void change(const Repeat& repeat, const RuleRun&);
  void change(const Alter& alter, const RuleRun&) {
    for (Packet& packet : packets_) change(alter, packet);
  }
  static void change(const Alter& alter, Packet& packet);
  void change(const Replace& replace, const RuleRun&);
  void change(const Truncate& truncate, const RuleRun&);
  void change(const Extend& extend, const RuleRun&);
  void change(const Abort& abort, const RuleRun&);
  template <typename Other>
  void change(const Other&, const RuleRun&) {}  // does not act on packets

  std::vector<Packet> packets_;
  ObjectAddress object_;
  std::uint64_t seed_;
  const Framing* framing_;
  bool acted_ = false;
  bool aborts_ = false;
  std::uint32_t abort_code_ = 0;
};

}  // namespace servodrome::scenario
