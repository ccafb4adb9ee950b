#include "scenario/slave_stage.hpp"

#include <algorithm>

#include "ethercat/slave/slave.hpp"
#include "scenario/director.hpp"

namespace servodrome::scenario {

SlaveStage::SlaveStage(Director& director, line::Axis& axis) : director_(director), axis_(axis) {
  axis.device().ethercat_slave()->interpose(this);
}

std::optional<ethercat::AlStatusCode> SlaveStage::refuses(ethercat::AlState, ethercat::AlState to) {
  RuleRun* rule = director_.firing<RefuseState>(axis_, [to](const RefuseState& refuse) { return refuse.to == to; });
  if (rule == nullptr) return std::nullopt;
  return static_cast<ethercat::AlStatusCode>(std::get<RefuseState>(rule->rule->action).code);
}

bool SlaveStage::acknowledges() {
  const ethercat::AlState present = axis_.device().ethercat_slave()->state();
  const auto fits = [present](const RefuseState& refuse) { return refuse.to == present; };
  return director_.firing<RefuseState>(axis_, fits) == nullptr;
}

void SlaveStage::release_later(Time late) {
  release_at_ = director_.now() + late;
  director_.at(release_at_, [this] {
    // The master may have reset the mailbox, and another message may wait.
    if (director_.now() < release_at_ && !director_.finished()) return;
    release_at_ = {};
    axis_.device().ethercat_slave()->release_mail();
  });
}

// The delays of the copies of a repetition are ignored: the master reads the copies one after the other.
ethercat::SlaveInterposer::Dispatch SlaveStage::sends(Mail& mail) {
  const Message message = messages_.outgoing(mail.mailbox.first(mail.length));
  Packets packets(message, director_.seed());
  if (!director_.carry_out(&axis_, message, packets)) {
    director_.passed(&axis_, message);
    return {};
  }
  if (packets.all().empty()) return {Sending::withhold};
  const Packet& first = packets.all().front();
  const std::vector<std::uint8_t> bytes =
      packets.aborts() ? coe_abort(message.bytes, message.object.value_or(ObjectAddress{}), packets.abort_code())
                       : first.bytes;
  mail.length = std::min(bytes.size(), mail.mailbox.size());
  std::copy_n(bytes.begin(), mail.length, mail.mailbox.begin());
  const auto copies = static_cast<unsigned>(packets.all().size() - 1);
  if (first.late == Time{}) return {Sending::pass, copies};
  release_later(first.late);
  return {Sending::hold, copies};
}

ethercat::SlaveInterposer::Receipt SlaveStage::receives(std::span<std::uint8_t> mailbox) {
  const bool asked_again = !kept_.empty() && std::equal(kept_.begin(), kept_.end(), mailbox.begin(), mailbox.end());
  if (!asked_again) return receives_anew(mailbox);
  if (director_.now() < release_at_) return Receipt::keep;
  kept_.clear();
  return Receipt::serve;
}

ethercat::SlaveInterposer::Receipt SlaveStage::receives_anew(std::span<std::uint8_t> mailbox) {
  kept_.clear();
  const Message message = messages_.incoming(mailbox);
  Packets packets(message, director_.seed());
  if (!director_.carry_out(&axis_, message, packets)) {
    director_.passed(&axis_, message);
    return Receipt::serve;
  }
  if (packets.all().empty()) return Receipt::discard;
  if (packets.aborts()) {
    axis_.device().ethercat_slave()->post(
        coe_abort(message.bytes, message.object.value_or(ObjectAddress{}), packets.abort_code()));
    return Receipt::discard;
  }
  const Packet& first = packets.all().front();
  std::copy_n(first.bytes.begin(), std::min(first.bytes.size(), mailbox.size()), mailbox.begin());
  if (first.late == Time{}) return Receipt::serve;
  kept_.assign(mailbox.begin(), mailbox.end());
  release_later(first.late);
  return Receipt::keep;
}

ethercat::SlaveInterposer::Pulse SlaveStage::sync0(Time) {
  const RuleRun* rule = director_.firing<DisturbSync0>(axis_, [](const DisturbSync0&) { return true; });
  if (rule == nullptr) return {};
  const auto& sync0 = std::get<DisturbSync0>(rule->rule->action);
  switch (sync0.how) {
    case DisturbSync0::How::missing: return {0};
    case DisturbSync0::How::twice: return {2};
    case DisturbSync0::How::late: return {1, sync0.late};
  }
  return {};
}

bool SlaveStage::keeps_inputs(Time) {
  return director_.firing<StaleInputs>(axis_, [](const StaleInputs&) { return true; }) != nullptr;
}

}  // namespace servodrome::scenario
