#include "scenario/segment_stage.hpp"

#include <algorithm>

#include "scenario/director.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::size_t ethernet_header = 14;

bool is_logical(ethercat::Command command) {
  return command == ethercat::Command::lrd || command == ethercat::Command::lwr || command == ethercat::Command::lrw;
}

// Bytes of a frame before the EtherCAT header.
std::size_t bytes_before(std::span<const std::uint8_t> frame, links::EthercatBus::Encapsulation encapsulation) {
  const bool whole = encapsulation == links::EthercatBus::Encapsulation::ethernet;
  return whole ? std::min(ethernet_header, frame.size()) : 0;
}

Message message_of(const ethercat::Datagram& datagram, std::string_view bus, std::span<const std::uint8_t> bytes) {
  Message message;
  message.bus = bus;
  message.bytes = bytes;
  message.command = static_cast<std::uint8_t>(datagram.command);
  const bool logical = is_logical(datagram.command);
  message.address = logical ? static_cast<std::uint16_t>(datagram.logical()) : datagram.offset();
  message.add(MessageKind::frame);
  if (logical) message.add(MessageKind::cycle);
  return message;
}

template <typename Kind>
bool any_is(const std::vector<RuleRun*>& rules) {
  return std::any_of(rules.begin(), rules.end(),
                     [](const RuleRun* rule) { return std::holds_alternative<Kind>(rule->rule->action); });
}

}  // namespace

SegmentStage::SegmentStage(Director& director, line::NamedEthercatBus& bus) : director_(director), bus_(bus) {
  bus.bus.interpose(this);
}

SegmentStage::~SegmentStage() {
  connect_all();
  bus_.bus.interpose(nullptr);
}

void SegmentStage::connect_all() {
  for (ethercat::Esc* esc : deaf_) esc->set_without_process_data(false);
  deaf_.clear();
}

links::EthercatInterposer::Entry SegmentStage::enters(std::span<std::uint8_t> bytes, Encapsulation encapsulation,
                                                      Time) {
  connect_all();  // after a frame that did not come back
  acting_.clear();
  is_cycle_ = false;
  ethercat::Frame frame;
  if (ethercat::Segment::parse(bytes, encapsulation, frame) != ethercat::FrameKind::ethercat) return {};
  std::vector<Message> messages;
  for (const ethercat::Datagram& datagram : frame.datagrams()) {
    messages.push_back(message_of(datagram, bus_.settings.name, bytes.subspan(bytes_before(bytes, encapsulation))));
    is_cycle_ = is_cycle_ || is_logical(datagram.command);
  }
  director_.carry_out(messages, acting_);
  Entry entry;
  for (const RuleRun* rule : acting_) {
    if (std::holds_alternative<Twice>(rule->rule->action)) entry.passes = 2;
    if (!std::holds_alternative<Withhold>(rule->rule->action)) continue;
    if (rule->rule->axis.empty()) {
      entry.lost = true;
    } else {
      deaf_.push_back(rule->axis->device().ethercat_controller());
      deaf_.back()->set_without_process_data(true);
    }
  }
  return entry;
}

links::EthercatInterposer::Return SegmentStage::returns(std::span<std::uint8_t> frame, Encapsulation encapsulation,
                                                        Time) {
  connect_all();
  behind_.clear();
  Return result;
  if (any_is<WithholdAnswer>(acting_)) {
    result.lost = true;
    return result;
  }
  if (is_cycle_ && !any_is<Stale>(acting_)) before_.assign(frame.begin(), frame.end());
  if (!acting_.empty()) {
    ethercat::Frame parsed;
    ethercat::Segment::parse(frame, encapsulation, parsed);
    for (const RuleRun* rule : acting_) change_datagrams(*rule, frame, parsed);
    change_bytes(frame, encapsulation, result);
  }
  release_held();
  for (const RuleRun* rule : acting_) {
    const auto* delay = std::get_if<Delay>(&rule->rule->action);
    if (delay == nullptr) continue;
    if (delay->frames != 0) hold_back(*rule, frame, delay->frames, result);
    result.delay += rule->lateness(*delay, director_.seed());
  }
  result.behind = behind_;
  return result;
}

void SegmentStage::change_datagrams(const RuleRun& rule, std::span<std::uint8_t> frame, ethercat::Frame& parsed) const {
  MessagePattern place = *rule.rule->on;
  place.data.clear();  // the slaves have changed the data
  for (ethercat::Datagram& datagram : parsed.datagrams()) {
    if (!matches(place, message_of(datagram, bus_.settings.name, frame))) continue;
    if (const auto* counter = std::get_if<WorkingCounter>(&rule.rule->action)) {
      const int count = static_cast<int>(datagram.working_counter()) + counter->add;
      datagram.set_working_counter(static_cast<unsigned>(std::max(count, 0)));
    }
    if (std::holds_alternative<Stale>(rule.rule->action) && before_.size() == frame.size()) {
      std::copy_n(before_.begin() + (datagram.data() - frame.data()), datagram.length, datagram.data());
    }
  }
}

// Applies the rules to the bytes from the EtherCAT header on. Additional or longer packets come back after the frame or
// in its place.
void SegmentStage::change_bytes(std::span<std::uint8_t> frame, Encapsulation encapsulation, Return& result) {
  const std::size_t before = bytes_before(frame, encapsulation);
  Message message;
  message.bytes = frame.subspan(before);
  Packets packets(message, director_.seed());
  for (const RuleRun* rule : acting_) {
    if (changes_bytes(rule->rule->action)) packets.apply(*rule);
  }
  if (packets.unchanged()) return;
  result.lost = true;
  for (const Packet& packet : packets.all()) {
    const std::size_t length = before + packet.bytes.size();
    if (result.lost && length <= frame.size()) {
      std::copy(packet.bytes.begin(), packet.bytes.end(), frame.begin() + static_cast<std::ptrdiff_t>(before));
      result.length = length;
      result.lost = false;
      continue;
    }
    behind_.emplace_back(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(before));
    behind_.back().insert(behind_.back().end(), packet.bytes.begin(), packet.bytes.end());
  }
}

void SegmentStage::hold_back(const RuleRun& rule, std::span<const std::uint8_t> frame, unsigned frames,
                             Return& result) {
  const auto whole = frame.first(std::min(result.length.value_or(frame.size()), frame.size()));
  held_.push_back({&rule, bus_.bus.sender(), {whole.begin(), whole.end()}, frames});
  result.lost = true;
}

void SegmentStage::release_held() {
  for (HeldFrame& one : held_) {
    if (--one.later == 0) bus_.bus.bring_back(one.sender, std::move(one.bytes));
  }
  std::erase_if(held_, [](const HeldFrame& one) { return one.later == 0; });
}

void SegmentStage::let_go(const RuleRun* rule) {
  const auto goes = [rule](const HeldFrame& one) { return rule == nullptr || one.rule == rule; };
  for (HeldFrame& one : held_) {
    if (goes(one)) bus_.bus.bring_back(one.sender, std::move(one.bytes));
  }
  std::erase_if(held_, goes);
}

}  // namespace servodrome::scenario
