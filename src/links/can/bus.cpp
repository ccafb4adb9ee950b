#include "links/can/bus.hpp"

#include <algorithm>
#include <stdexcept>

#include "links/can/bus_port.hpp"

namespace servodrome::links {
namespace {

// Error flag (6), the other ports' error flags (6), error delimiter (8): ISO 11898-1, 10.4.4.
constexpr unsigned error_frame_bits = 20;
// An error passive sender waits this number of bits before it sends again (ISO 11898-1, 10.4.6.4).
constexpr unsigned suspend_transmission_bits = 8;

bool is_valid(const canopen::Frame& frame) {
  return frame.length <= 8 && frame.id <= (frame.extended ? 0x1FFFFFFFU : 0x7FFU);
}

// Sets bytes that are not sent to zero, so that equal frames compare equal.
canopen::Frame normalized(const canopen::Frame& frame) {
  canopen::Frame result = frame;
  const auto used = static_cast<std::ptrdiff_t>(frame.remote ? 0 : frame.length);
  std::fill(result.data.begin() + used, result.data.end(), std::uint8_t{0});
  return result;
}

// The number of bits until two senders detect that their frames differ: the first different bit is a bit error for one
// of them.
unsigned bits_until_difference(const canopen::Frame& one, const canopen::Frame& other) {
  const WireBits a = encode_frame(one);
  const WireBits b = encode_frame(other);
  const unsigned common = std::min(a.count, b.count);
  unsigned position = 0;
  while (position < common && a.levels[position] == b.levels[position]) ++position;
  return position + 1;
}

void check_bit_rate(std::uint32_t bit_rate) {
  if (bit_rate < 10'000 || bit_rate > 1'000'000) {
    throw std::invalid_argument("CAN bit rate " + std::to_string(bit_rate) + " bit/s is outside 10000 .. 1000000");
  }
}

}  // namespace

CanBus::CanBus(const BusConfig& config) : config_(config) { check_bit_rate(config.bit_rate); }
CanBus::~CanBus() = default;

PortId CanBus::attach(Receiver& receiver, std::size_t queue_depth) {
  const auto id = static_cast<PortId>(ports_.size());
  ports_.push_back(std::make_unique<Port>(id, receiver, std::max<std::size_t>(queue_depth, 1)));
  review_private_attempts();
  return id;
}

void CanBus::detach(PortId port) {
  set_participation(port, Participation::off);
  at(port).receiver = nullptr;
}

CanBus::Port& CanBus::at(PortId port) const { return *ports_.at(static_cast<std::size_t>(port)); }

bool CanBus::transmit(PortId port, const canopen::Frame& frame, Time now, std::uint32_t tag) {
  Port& sender = at(port);
  if (!sender.can_send() || sender.count == sender.queue.size() || !is_valid(frame)) {
    ++sender.counters.refused;
    return false;
  }
  Port::Queued& entry = sender.queue[(sender.first + sender.count) % sender.queue.size()];
  entry.frame = normalized(frame);
  entry.ready = now;
  entry.delay = Time{};
  entry.tag = tag;
  entry.key = arbitration_key(frame);
  entry.bits = frame_length_bits(entry.frame);
  if (disturbance_ && delay_draws_.chance(disturbance_->delay) && matches(sender, entry.frame)) {
    entry.delay = disturbance_->delay_time;
    ++disturbed_frames_;
    ++counters_.delayed;
  }
  ++sender.count;
  review_private_attempts();
  return true;
}

void CanBus::offer(PortId port, const canopen::Frame* frame, Time since) {
  Port& sender = at(port);
  if ((frame == nullptr && sender.count == 0) || sender.sending || !sender.can_send()) return;
  if (frame == nullptr) {
    sender.count = 0;
    review_private_attempts();
  } else if (sender.count == 0) {
    transmit(port, *frame, since);
  } else if (Port::Queued& entry = sender.queue[sender.first]; entry.frame != *frame) {
    entry.frame = normalized(*frame);
    entry.ready = since;
    entry.key = arbitration_key(*frame);
    entry.bits = frame_length_bits(entry.frame);
  }
}

std::size_t CanBus::pending(PortId port) const { return at(port).count; }
bool CanBus::sending(PortId port) const { return at(port).sending; }
std::size_t CanBus::queue_space(PortId port) const { return at(port).queue.size() - at(port).count; }

Time CanBus::next_event() const {
  Time next = transmission_ ? transmission_->end : next_start();
  for (const auto& port : ports_) next = std::min({next, port->recovers_at, port->private_attempt_at});
  return next;
}

void CanBus::advance(Time now) {
  if (advancing_) throw std::logic_error("CanBus::advance() called by a receiver");
  // Resets `advancing_` even if a receiver or an observer throws, so that the bus stays usable.
  struct Guard {
    bool& flag;
    ~Guard() { flag = false; }
  } guard{advancing_ = true};
  for (Time next = next_event(); next <= now; next = next_event()) {
    now_ = std::max(now_, next);
    recover_ports(now_);
    run_private_attempts(now_);
    if (transmission_) {
      if (transmission_->end <= now_) end_transmission();
    } else if (next_start() <= now_) {
      start_transmission();
    }
  }
  now_ = std::max(now_, now);
}

Time CanBus::duration(std::uint64_t bits) const {
  if (config_.ideal) return Time{};
  return Time(static_cast<std::int64_t>(bits * 1'000'000'000U / config_.bit_rate));
}

bool CanBus::rate_matches(const Port& port) const { return port.bit_rate == 0 || port.bit_rate == config_.bit_rate; }

bool CanBus::on_wire(const Port& port) const {
  return port.attached() && port.participation != Participation::off && !port.cut && !bus_cut_ &&
         port.error_state != ErrorState::bus_off && rate_matches(port);
}

// Returns true if there is another port on the wire that can acknowledge a frame.
bool CanBus::acknowledged() const {
  if (config_.ideal) return true;
  unsigned participants = 0;
  for (const auto& port : ports_) {
    if (on_wire(*port) && port->participation == Participation::normal && ++participants == 2) return true;
  }
  return false;
}

bool CanBus::may_send(const Port& port) const { return port.count > 0 && on_wire(port); }

Time CanBus::earliest_start(const Port& port) const {
  return std::max({idle_at_, port.head().ready + port.head().delay, port.suspended_until, now_});
}

Time CanBus::next_start() const {
  Time start = never;
  for (const auto& port : ports_) {
    if (may_send(*port)) start = std::min(start, earliest_start(*port));
  }
  return start == never || acknowledged() ? start : never;
}

void CanBus::start_transmission() {
  Port* winner = nullptr;
  for (const auto& port : ports_) {
    if (!may_send(*port) || earliest_start(*port) > now_) continue;
    if (winner == nullptr || port->head().key < winner->head().key) winner = port.get();
  }
  const Port::Queued& head = winner->head();
  winner->sending = true;
  Transmission next;
  next.frame = head.frame;
  next.sender = winner->id;
  next.start = now_;
  next.bits = head.bits;

  // Another port with the same arbitration field sends too. If its frame differs, it breaks this one.
  if (!config_.ideal) {
    for (const auto& port : ports_) {
      if (port.get() == winner || !may_send(*port) || earliest_start(*port) > now_) continue;
      if (port->head().key != head.key) continue;
      port->sending = true;
      if (port->head().frame == head.frame || next.outcome == Transmission::Outcome::broken) continue;
      next.outcome = Transmission::Outcome::broken;
      next.bits = bits_until_difference(head.frame, port->head().frame);
      ++counters_.collisions;
    }
  }

  if (disturbance_) {
    const unsigned good_bits = draw_corruption(*winner, head.frame, next.bits);
    const bool drop = drop_draws_.chance(disturbance_->drop) && matches(*winner, head.frame);
    if (next.outcome == Transmission::Outcome::complete && good_bits < next.bits) {
      next.outcome = Transmission::Outcome::broken;
      next.bits = good_bits;
      ++counters_.corrupted;
      ++disturbed_frames_;
    } else if (next.outcome == Transmission::Outcome::complete && drop) {
      next.outcome = Transmission::Outcome::withheld;
      ++counters_.dropped;
      ++disturbed_frames_;
    }
  }
  if (next.outcome == Transmission::Outcome::broken) next.bits += error_frame_bits;
  next.end = next.start + duration(next.bits);
  transmission_ = next;
  load_.add_busy(next.start, next.end + duration(interframe_space_bits));
}

// Returns how many bits of the frame stay good; all of them if it is not corrupted. Always draws twice.
unsigned CanBus::draw_corruption(const Port& sender, const canopen::Frame& frame, unsigned bits) {
  const bool hit = corrupt_draws_.chance(disturbance_->corrupt) && matches(sender, frame);
  const auto position = static_cast<unsigned>(corrupt_draws_.next() % bits);
  // On an ideal bus a frame that is corrupted each time would be repeated endlessly without any time passing.
  return hit && !config_.ideal ? position : bits;
}

bool CanBus::matches(const Port& sender, const canopen::Frame& frame) const {
  const Disturbance& what = *disturbance_;
  return (frame.id & what.id_mask) == (what.id & what.id_mask) &&
         (!what.port || *what.port == static_cast<std::uint16_t>(sender.id)) &&
         (what.limit == 0 || disturbed_frames_ < what.limit);
}

void CanBus::end_transmission() {
  Transmission done = *transmission_;
  transmission_.reset();
  idle_at_ = done.end + duration(interframe_space_bits);
  counters_.bits += done.bits + interframe_space_bits;

  // If the sender was switched off or cut off in the middle, its frame is broken.
  bool has_sender = false;
  for (const auto& port : ports_) {
    port->sending = port->sending && on_wire(*port);
    has_sender = has_sender || port->sending;
  }
  if (!has_sender || !acknowledged()) done.outcome = Transmission::Outcome::broken;

  const bool broken = done.outcome == Transmission::Outcome::broken;
  BusEvent event{BusEvent::Kind::frame, done.sender, done.start, done.end, done.frame};
  if (broken) event.kind = BusEvent::Kind::error;
  if (done.outcome == Transmission::Outcome::withheld) event.kind = BusEvent::Kind::dropped;
  for (BusObserver* observer : observers_) observer->on_bus_event(event);
  if (broken) {
    break_off(done);
  } else {
    deliver(done);
  }
  review_private_attempts();
}

void CanBus::deliver(const Transmission& done) {
  ++counters_.frames;
  // All ports are counted before the first receiver is called: a receiver may connect or disconnect ports and send.
  for (const auto& port : ports_) {
    if (on_wire(*port)) count_success(*port, port->sending, done.end);
  }
  for (std::size_t i = 0; i < ports_.size(); ++i) {
    Port& port = *ports_[i];
    if (!on_wire(port)) {
      port.sending = false;
    } else if (port.sending) {
      const std::uint32_t tag = port.head().tag;
      port.pop();
      port.sending = false;
      if (port.error_state == ErrorState::passive) {
        port.suspended_until = idle_at_ + duration(suspend_transmission_bits);
      }
      port.receiver->on_sent(done.frame, tag, done.end);
    } else if (done.outcome != Transmission::Outcome::withheld) {
      ++port.counters.received;
      port.receiver->on_frame(done.frame, done.end);
    }
  }
}

void CanBus::break_off(const Transmission& done) {
  ++counters_.errors;
  for (const auto& port : ports_) {
    if (!on_wire(*port)) continue;
    if (port->sending) {
      port->sending = false;
      ++port->counters.errors;
      count_transmit_error(*port, done.end);
      if (port->error_state == ErrorState::passive) {
        port->suspended_until = idle_at_ + duration(suspend_transmission_bits);
      }
    } else {
      count_receive_error(*port, done.end);
    }
  }
}

void CanBus::set_bit_rate(std::uint32_t bit_rate) {
  check_bit_rate(bit_rate);
  config_.bit_rate = bit_rate;
  review_private_attempts();
}

void CanBus::set_port_bit_rate(PortId port, std::uint32_t bit_rate) {
  at(port).bit_rate = bit_rate;
  review_private_attempts();
}

void CanBus::set_participation(PortId port, Participation participation) {
  Port& node = at(port);
  node.participation = participation;
  if (participation == Participation::off) {
    discard_queue(node);
    node.counters.transmit_errors = 0;
    node.counters.receive_errors = 0;
    node.error_state = node.least_state;
    node.recovers_at = never;
    node.suspended_until = Time{};
  } else if (participation == Participation::listen_only) {
    discard_queue(node);
  }
  review_private_attempts();
}

Participation CanBus::participation(PortId port) const { return at(port).participation; }
ErrorState CanBus::error_state(PortId port) const { return at(port).error_state; }
ErrorState CanBus::forced_error_state(PortId port) const { return at(port).least_state; }
const PortCounters& CanBus::counters(PortId port) const { return at(port).counters; }
double CanBus::load_percent(Time now) const { return load_.percent(now); }

void CanBus::disturb(const Disturbance& disturbance) {
  clear_disturbance();
  disturbance_ = disturbance;
  disturbed_frames_ = 0;
  DisturbanceGenerator seeds(disturbance.seed);
  drop_draws_ = DisturbanceGenerator(seeds.next());
  delay_draws_ = DisturbanceGenerator(seeds.next());
  corrupt_draws_ = DisturbanceGenerator(seeds.next());
}

void CanBus::clear_disturbance() {
  disturbance_.reset();
  for (const auto& port : ports_) {
    for (Port::Queued& entry : port->queue) entry.delay = Time{};
  }
  review_private_attempts();
}

void CanBus::cut(PortId port, bool is_cut) {
  at(port).cut = is_cut;
  review_private_attempts();
}

void CanBus::cut_bus(bool is_cut) {
  bus_cut_ = is_cut;
  review_private_attempts();
}

bool CanBus::is_cut(PortId port) const { return at(port).cut; }

void CanBus::add_observer(BusObserver& observer) { observers_.push_back(&observer); }

void CanBus::remove_observer(BusObserver& observer) {
  observers_.erase(std::remove(observers_.begin(), observers_.end(), &observer), observers_.end());
}

}  // namespace servodrome::links
