#include "ethercat/segment.hpp"

namespace servodrome::ethercat {

enum class Segment::Health : std::uint8_t {
  good,        // every slave executes it
  unreadable,  // another protocol, or malformed
  corrupted,   // arrives with a wrong FCS
  destroyed,
};

// State of a frame on its way through the processing units.
struct Segment::Travel {
  Slave* at;     // the slave that it reached last
  Time time;     // arrival time there
  Time back{0};  // delay of the way back from that slave's port 0, through the slaves that it passed
  Way end{};     // where it goes from there
  Health health;
  unsigned effects = 0;

  bool lost() const { return health >= Health::corrupted; }
};

namespace {
constexpr std::uint8_t locally_administered = 0x02;  // bit in the first byte of the source address
}

// Returns where a frame goes that leaves a slave by port 1. `next` is nullptr behind the last slave.
inline Segment::Way Segment::way_behind(const Esc& esc, const Esc* next) const {
  if (esc.loop_closed(1)) return Way::turns;
  const bool goes_on = next != nullptr ? next->takes_frames() : ring_cable_;
  return goes_on ? Way::open : Way::ends;
}

// Returns where a frame goes that leaves `slave` by port 0.
Segment::Way Segment::way_before(std::size_t slave) const {
  if (slaves_[slave].esc->loop_closed(0)) return Way::turns;
  if (!slaves_[slave].cable) return Way::ends;
  if (slave == 0) return Way::open;
  const Slave& previous = slaves_[slave - 1];
  return previous.powered && !previous.esc->loop_closed(1) ? Way::open : Way::ends;
}

// Runs the frame through the processing units from its position on, for as long as they execute it.
[[gnu::always_inline]] inline void Segment::run_executed(Frame& frame, Travel& travel) {
  Slave* const last = &slaves_.back();
  while (!travel.at->corrupts_next) {
    Esc& esc = *travel.at->esc;
    travel.end = way_behind(esc, travel.at == last ? nullptr : travel.at[1].esc);  // before the frame may change it
    travel.back += travel.at->backward;
    travel.effects |= esc.process(frame, travel.time);
    if (travel.end != Way::open || travel.at == last) return;
    ++travel.at;
    travel.time += travel.at->forward;
  }
  travel.health = Health::unreadable;
}

// Passes a frame that is not executed through a slave. Returns its state behind the slave.
Segment::Health Segment::pass_damaged(Slave& slave, FrameKind kind, Health health) {
  Esc& esc = *slave.esc;
  if (health == Health::corrupted) {
    esc.count_forwarded_error(0);
    return Health::corrupted;
  }
  if (slave.corrupts_next) {
    slave.corrupts_next = false;
    esc.count_invalid_frame(0);
    esc.count_processing_unit_error();
    return Health::corrupted;
  }
  if (kind == FrameKind::malformed) {
    esc.count_processing_unit_error();
    return Health::unreadable;
  }
  return esc.processes_only() ? Health::destroyed : Health::unreadable;
}

// Counterpart of run_executed for a frame that is not executed.
Segment::Travel Segment::run_damaged(FrameKind kind, Travel travel) {
  Slave* const last = &slaves_.back();
  for (;; ++travel.at, travel.time += travel.at->forward) {
    Esc& esc = *travel.at->esc;
    travel.end = way_behind(esc, travel.at == last ? nullptr : travel.at[1].esc);
    travel.back += travel.at->backward;
    travel.health = pass_damaged(*travel.at, kind, travel.health);
    travel.effects |= esc.processes_only() ? Esc::effect_marks : 0U;
    if (travel.health == Health::destroyed || travel.end != Way::open || travel.at == last) return travel;
  }
}

// Runs the frame through the segment from slave `first`, where it arrives at `time`.
[[gnu::always_inline]] inline Segment::Travel Segment::run_forward(Frame& frame, FrameKind kind, std::size_t first,
                                                                   Time time) {
  const bool executed = kind == FrameKind::ethercat;
  Travel travel{.at = &slaves_[first], .time = time, .health = executed ? Health::good : Health::unreadable};
  if (executed) run_executed(frame, travel);
  if (travel.health != Health::good) travel = run_damaged(kind, travel);
  if (travel.end == Way::ends && travel.at != &slaves_.back() && travel.health != Health::destroyed) {
    travel.at[1].esc->frame_at_closed_port(0);
  }
  if (kind == FrameKind::foreign) return travel;
  if (frame.udp_checksum != nullptr) store_u16(frame.udp_checksum, 0);
  if ((travel.effects & Esc::effect_marks) != 0 && frame.source_address != nullptr) {
    *frame.source_address |= locally_administered;
  }
  return travel;
}

// The frame turned back at `slave`, at `time`: latches the times at port 1 of all slaves before it.
void Segment::latch_returning(const Slave* slave, Time time) {
  for (; slave != slaves_.data(); --slave) {
    time += slave->backward;
    slave[-1].esc->latch_port_time(1, time);
  }
}

// A frame that is marked as damaged turned back at `slave`: counts it at port 1 of all slaves before it.
void Segment::count_returning_error(const Slave* slave) {
  for (; slave != slaves_.data(); --slave) slave[-1].esc->count_forwarded_error(1);
}

Segment::Passage Segment::process(std::span<std::uint8_t> bytes, Time now, Port entry, Encapsulation encapsulation) {
  Frame frame;
  const FrameKind kind = parse(bytes, encapsulation, frame);
  Passage passage;
  if (!slaves_.empty()) {
    passage = entry == Port::primary ? enter_front(frame, kind, now) : enter_back(frame, kind, now);
  }
  passage.kind = kind;
  return passage;
}

[[gnu::always_inline]] inline Segment::Passage Segment::enter_front(Frame& frame, FrameKind kind, Time now) {
  Slave& front = slaves_.front();
  if (!front.cable || !front.powered) return {};
  if (front.esc->loop_closed(0)) {
    front.esc->frame_at_closed_port(0);
    return {};
  }
  const Travel travel = run_forward(frame, kind, 0, now + front.forward);
  if (travel.health == Health::corrupted && travel.end == Way::turns) count_returning_error(travel.at);
  if (travel.lost() || travel.end == Way::ends) return {};
  if (travel.end == Way::open) return {travel.time, Exit::secondary};
  if ((travel.effects & Esc::effect_receive_times) != 0) latch_returning(travel.at, travel.time);
  return {travel.time + travel.back, Exit::primary};
}

Segment::Passage Segment::enter_back(Frame& frame, FrameKind kind, Time now) {
  // The frame enters port 1 of the last slave and leaves by port 0 without processing, until a port 0 has a closed
  // loop.
  std::size_t slave = slaves_.size() - 1;
  Slave& back = slaves_[slave];
  if (!ring_cable_ || !back.powered) return {};
  if (back.esc->loop_closed(1)) {
    back.esc->frame_at_closed_port(1);
    return {};
  }
  Time time = now;
  for (Way way = way_before(slave); way != Way::turns; way = way_before(slave)) {
    if (way == Way::ends) return {};
    time += slaves_[slave].backward;
    if (slave == 0) return {time, Exit::primary};
    --slave;
  }
  // A frame that reaches a port 0 without a link for the second time circulates, and is removed (ETG.1000.4 clause
  // 5.3.3).
  if (slaves_[slave].esc->closes_loops_itself(0)) {
    for (Datagram& datagram : frame.datagrams()) {
      if (datagram.circulating()) return {};
      datagram.set_circulating();
    }
  }
  const std::size_t turning = slave;
  const Travel travel = run_forward(frame, kind, turning, time);
  if (travel.lost() || travel.end != Way::open) return {};
  if ((travel.effects & Esc::effect_receive_times) != 0) {
    time = now;
    for (std::size_t i = slaves_.size(); i-- > turning;) {
      slaves_[i].esc->latch_port_time(1, time);
      time += slaves_[i].backward;
    }
  }
  return {travel.time, Exit::secondary};
}

void Segment::set_cable(std::size_t cable, bool connected) {
  if (cable < slaves_.size()) {
    slaves_[cable].cable = connected;
  } else {
    ring_cable_ = connected;
  }
  update_links();
}

void Segment::set_powered(std::size_t slave, bool powered, Time now) {
  slaves_[slave].powered = powered;
  update_links();
  if (powered) slaves_[slave].esc->power_on(now);
}

void Segment::update_links() {
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    Slave& slave = slaves_[i];
    const bool before = i == 0 || slaves_[i - 1].powered;
    const bool last = i + 1 == slaves_.size();
    const bool behind = last ? ring_cable_ : slaves_[i + 1].cable && slaves_[i + 1].powered;
    slave.esc->set_link(0, slave.powered && slave.cable && before);
    slave.esc->set_link(1, slave.powered && behind);
  }
}

}  // namespace servodrome::ethercat
