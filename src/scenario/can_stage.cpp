#include "scenario/can_stage.hpp"

#include <algorithm>
#include <utility>

#include "canopen/connection_set.hpp"
#include "scenario/director.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {
namespace {

canopen::Frame frame_of(const Packet& packet) {
  canopen::Frame frame;
  frame.id = packet.id;
  frame.extended = packet.id > 0x7FF;
  frame.length = static_cast<std::uint8_t>(std::min<std::size_t>(packet.bytes.size(), frame.data.size()));
  std::copy_n(packet.bytes.begin(), frame.length, frame.data.begin());
  return frame;
}

}  // namespace

RulePort::RulePort(links::CanBus& bus) : bus_(bus), port_(bus.attach(*this, 1)) {
  bus_.set_participation(port_, links::Participation::listen_only);
}

RulePort::~RulePort() { bus_.detach(port_); }

void RulePort::send(const canopen::Frame& frame, Time now, const RuleRun* rule) {
  if (waiting_.size() == depth) return;
  waiting_.push_back({frame, now, rule});
  offer();
}

void RulePort::on_sent(const canopen::Frame&, std::uint32_t, Time) {
  waiting_.pop_front();
  offer();
}

void RulePort::on_error_state(links::ErrorState state, Time) {
  if (state == links::ErrorState::bus_off) waiting_.clear();
  offer();
}

std::size_t RulePort::waiting(const RuleRun& rule) const {
  return static_cast<std::size_t>(
      std::count_if(waiting_.begin(), waiting_.end(), [&rule](const Waiting& one) { return one.rule == &rule; }));
}

void RulePort::leave(const RuleRun& rule, bool completes) {
  bool is_on_wire = bus_.sending(port_);  // the first one
  std::erase_if(waiting_, [&](const Waiting& one) {
    const bool stays = std::exchange(is_on_wire, false) || completes;
    return one.rule == &rule && !stays;
  });
  for (Waiting& one : waiting_) {
    if (one.rule == &rule) one.rule = nullptr;
  }
  offer();
}

// The port listens only while no frame waits.
void RulePort::offer() {
  if (waiting_.empty()) {
    bus_.set_participation(port_, links::Participation::listen_only);
  } else {
    bus_.set_participation(port_, links::Participation::normal);
    bus_.offer(port_, &waiting_.front().frame, waiting_.front().since);
  }
}

CanStage::CanStage(Director& director, line::Axis& axis, RulePort& port, links::CanBus& bus)
    : director_(director), axis_(axis), port_(port), bus_(bus), messages_(axis.device()) {
  axis.interpose(this);
}

bool CanStage::lets_out(const canopen::Frame& frame, Time now) {
  if (frame.remote || frame.extended) return true;
  const Message message = messages_.outgoing(frame);
  Packets packets(message, director_.seed());
  if (!director_.carry_out(&axis_, message, packets)) return true;
  for (const Packet& packet : packets.all()) {
    const canopen::Frame made = frame_of(packet);
    if (packet.late == Time{}) {
      speak(made, now);
    } else {
      director_.at(now + packet.late, axis_, [this, made] { speak(made, director_.now()); });
    }
  }
  return false;
}

void CanStage::sent(const canopen::Frame& frame, Time) {
  if (!frame.remote && !frame.extended) director_.passed(&axis_, messages_.outgoing(frame));
}

bool CanStage::lets_in(canopen::Frame& frame, Time at) {
  if (frame.remote || frame.extended) return true;
  const Message message = messages_.incoming(frame);
  Packets packets(message, director_.seed());
  if (!director_.carry_out(&axis_, message, packets)) {
    director_.passed(&axis_, message);
    return true;
  }
  if (packets.aborts()) {  // the drive does not get the request, and the client gets an abort
    for (Packet answer : packets.all()) {
      answer.id = canopen::connection_set::sdo_response + axis_.device().node_id();
      const canopen::Frame made = frame_of(answer);
      director_.at(at + answer.late, axis_, [this, made] { speak(made, director_.now()); });
    }
    return false;
  }
  bool passes = false;
  for (const Packet& packet : packets.all()) {
    const canopen::Frame made = frame_of(packet);
    if (packet.late == Time{} && !passes) {
      frame = made;
      passes = true;
    } else {
      director_.at(at + packet.late, axis_, [this, made] { axis_.deliver(made, director_.now()); });
    }
  }
  return passes;
}

void CanStage::speak(const canopen::Frame& frame, Time now) {
  if (!axis_.powered() || bus_.is_cut(axis_.port()) || bus_.error_state(axis_.port()) == links::ErrorState::bus_off) {
    return;
  }
  port_.send(frame, now);
}

}  // namespace servodrome::scenario
