#include "scenario/act_log.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "scenario/parse_parts.hpp"

namespace servodrome::scenario {
namespace {

std::string result_of(const Message& message, const Packets& packets) {
  const auto& all = packets.all();
  if (all.empty()) return "nothing passes";
  std::string text;
  for (const Packet& packet : all) {
    if (!text.empty()) text += ", ";
    const bool same = std::equal(packet.bytes.begin(), packet.bytes.end(), message.bytes.begin(), message.bytes.end());
    text += same && packet.id == message.id ? "the same" : fmt::format("{:02X}", fmt::join(packet.bytes, " "));
    if (packet.id != message.id) text += fmt::format(" with the identifier {:03X}h", packet.id);
    if (packet.late > Time{}) {
      text += fmt::format(" {:.1f} ms later", std::chrono::duration<double, std::milli>(packet.late).count());
    }
  }
  return "passes: " + text;
}

}  // namespace

void ActLog::add(const RuleRun& run, Time at, const Message* message, const Packets* packets) {
  const Rule& rule = *run.rule;
  ActRecord record;
  record.at = at;
  record.rule = rule.name;
  if (run.axis != nullptr) record.axis = run.axis->settings().name;
  record.what = rule.word;
  if (rule.on) record.what += fmt::format(" {}", name_of(rule.on->kind));
  const ObjectAddress* object = object_of(rule.action);
  if (message != nullptr && message->object) object = &*message->object;
  if (object != nullptr) record.what += fmt::format(" {:04X}h:{:02X}", object->index, object->sub.value_or(0));
  if (message != nullptr) {
    record.bus = message->bus;
    record.raw = fmt::format("{:02X}", fmt::join(message->bytes, " "));
    if (packets != nullptr) record.result = result_of(*message, *packets);
    if (message->id != 0 && message->bytes.size() <= 8) {
      canopen::Frame& frame = record.frame.emplace();
      frame.id = message->id;
      frame.length = static_cast<std::uint8_t>(message->bytes.size());
      std::copy(message->bytes.begin(), message->bytes.end(), frame.data.begin());
    }
  }
  if (counts_[run.number]++ < first_of_each) {
    first_.push_back(std::move(record));
    return;
  }
  latest_.push_back(std::move(record));
  if (latest_.size() > latest) latest_.pop_front();
}

std::vector<ActRecord> ActLog::records() const {
  std::vector<ActRecord> all = first_;
  all.insert(all.end(), latest_.begin(), latest_.end());
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
  return all;
}

}  // namespace servodrome::scenario
