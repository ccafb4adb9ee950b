#include "scenario/segment_stage.hpp"

#include <algorithm>

#include "scenario/director.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::size_t ethernet_header = 14;
constexpr std::size_t datagram_end = 2;  // the working counter behind the data

bool is_logical(ethercat::Command command) {
  return command == ethercat::Command::lrd || command == ethercat::Command::lwr || command == ethercat::Command::lrw;
}

// The part of a frame that begins with the EtherCAT header.
std::span<std::uint8_t> ethercat_part(std::span<std::uint8_t> frame, links::EthercatBus::Encapsulation encapsulation) {
  const bool whole = encapsulation == links::EthercatBus::Encapsulation::ethernet;
  return frame.subspan(whole ? std::min(ethernet_header, frame.size()) : 0);
}

}  // namespace

SegmentStage::SegmentStage(Director& director, line::NamedEthercatBus& bus) : director_(director), bus_(bus) {
  bus.bus.interpose(this);
}

links::EthercatInterposer::Entry SegmentStage::enters(std::span<std::uint8_t> bytes, Encapsulation encapsulation,
                                                      Time at) {
  acting_.clear();
  is_cycle_ = false;
  period_ = at - last_entry_;
  last_entry_ = at;
  ethercat::Frame frame;
  if (ethercat::Segment::parse(bytes, encapsulation, frame) != ethercat::FrameKind::ethercat) return {};
  std::vector<Message> messages;
  for (const ethercat::Datagram& datagram : frame.datagrams()) {
    Message message;
    message.bus = bus_.settings.name;
    message.bytes = ethercat_part(bytes, encapsulation);
    message.command = static_cast<std::uint8_t>(datagram.command);
    const bool logical = is_logical(datagram.command);
    message.address = logical ? static_cast<std::uint16_t>(datagram.logical()) : datagram.offset();
    message.add(MessageKind::frame);
    if (logical) message.add(MessageKind::cycle);
    is_cycle_ = is_cycle_ || logical;
    messages.push_back(message);
  }
  director_.carry_out(messages, acting_);
  Entry entry;
  for (const RuleRun* rule : acting_) {
    entry.lost = entry.lost || std::holds_alternative<Withhold>(rule->rule->action);
    if (std::holds_alternative<Twice>(rule->rule->action)) entry.passes = 2;
  }
  return entry;
}

links::EthercatInterposer::Return SegmentStage::returns(std::span<std::uint8_t> frame, Encapsulation encapsulation,
                                                        Time) {
  Return result;
  const bool stale = std::any_of(acting_.begin(), acting_.end(),
                                 [](const RuleRun* rule) { return std::holds_alternative<Stale>(rule->rule->action); });
  if (is_cycle_ && !stale) keep(frame);
  if (!acting_.empty()) change(frame, encapsulation, result);
  return result;
}

void SegmentStage::change(std::span<std::uint8_t> frame, Encapsulation encapsulation, Return& result) {
  ethercat::Frame parsed;
  ethercat::Segment::parse(frame, encapsulation, parsed);
  for (const RuleRun* rule : acting_) {
    const Action& action = rule->rule->action;
    if (std::holds_alternative<WithholdAnswer>(action)) result.lost = true;
    if (const auto* delay = std::get_if<Delay>(&action)) {
      // Behind `frames` later ones: half a period after the last of them.
      result.delay += delay->frames != 0 ? period_ * delay->frames + period_ / 2 : delay->time;
    }
    if (const auto* counter = std::get_if<WorkingCounter>(&action)) {
      for (ethercat::Datagram& datagram : parsed.datagrams()) {
        if (!rule->rule->on->command && rule->rule->on->kind == MessageKind::cycle && !is_logical(datagram.command))
          continue;
        const int count = static_cast<int>(datagram.working_counter()) + counter->add;
        datagram.set_working_counter(static_cast<unsigned>(std::max(count, 0)));
      }
    }
    if (std::holds_alternative<Stale>(action) && before_.size() == frame.size()) {
      for (ethercat::Datagram& datagram : parsed.datagrams()) {
        if (!is_logical(datagram.command)) continue;
        const auto place = datagram.data() - frame.data();
        std::copy_n(before_.begin() + place, datagram.length, datagram.data());
      }
    }
    if (std::holds_alternative<Alter>(action)) {
      const std::span<std::uint8_t> part = ethercat_part(frame, encapsulation);
      Message message;
      message.bytes = part;
      Packets packets(message, director_.seed());
      packets.apply(*rule);
      std::copy_n(packets.all().front().bytes.begin(), part.size(), part.begin());
    }
  }
}

}  // namespace servodrome::scenario
