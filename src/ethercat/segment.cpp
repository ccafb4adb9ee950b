#include "ethercat/segment.hpp"

namespace servodrome::ethercat {

struct Segment::Travel {
  Frame frame;
  FrameKind kind;
  Time time;
  Time back;         // through the slaves that were passed, from the last one's port 0
  std::size_t last;  // slave the processing ended at
  Way end;           // how it went on there
  bool executable;
  bool corrupted = false;
  bool destroyed = false;
  bool latches;
};

namespace {
constexpr std::uint8_t locally_administered = 0x02;  // of the first byte of the source address
}

// What a frame meets that leaves a slave by its port 1. `next` is nullptr behind the last one.
inline Segment::Way Segment::way_behind(const Esc& esc, const Esc* next) const {
  if (esc.loop_closed(1)) return Way::turns;
  const bool goes_on = next != nullptr ? next->takes_frames() : ring_cable_;
  return goes_on ? Way::open : Way::ends;
}

// What a frame meets that leaves `slave` by its port 0.
Segment::Way Segment::way_before(std::size_t slave) const {
  if (slaves_[slave].esc->loop_closed(0)) return Way::turns;
  if (!slaves_[slave].cable) return Way::ends;
  if (slave == 0) return Way::open;
  const Slave& previous = slaves_[slave - 1];
  return previous.powered && !previous.esc->loop_closed(1) ? Way::open : Way::ends;
}

// A frame that is not executed: of another protocol, malformed, or arriving with a wrong FCS. Returns effects.
unsigned Segment::pass_damaged(Slave& slave, Travel& travel) {
  Esc& esc = *slave.esc;
  if (travel.corrupted) {
    esc.count_forwarded_error(0);
  } else if (slave.corrupts_next) {
    slave.corrupts_next = false;
    travel.corrupted = true;
    travel.executable = false;
    esc.count_invalid_frame(0);
    esc.count_processing_unit_error();
  } else if (travel.kind == FrameKind::malformed) {
    esc.count_processing_unit_error();
  } else {
    travel.destroyed = esc.processes_only();
  }
  return esc.processes_only() ? Esc::effect_marks : 0U;
}

[[gnu::always_inline]] inline void Segment::run_forward(std::size_t first, Travel& travel) {
  Slave* at = &slaves_[first];
  Slave* const last = &slaves_.back();
  unsigned effects = 0;
  Time time = travel.time;
  Time back{0};
  Way way;
  for (;; ++at, time += at->forward) {
    Esc& esc = *at->esc;
    way = way_behind(esc, at == last ? nullptr : at[1].esc);  // before the frame itself changes it
    back += at->backward;
    if (travel.executable && !at->corrupts_next) [[likely]] {
      effects |= esc.process(travel.frame, time);
    } else {
      effects |= pass_damaged(*at, travel);
      if (travel.destroyed) break;
    }
    if (way != Way::open || at == last) break;
  }
  if (at != last && way == Way::ends && !travel.destroyed) at[1].esc->frame_at_closed_port(0);
  travel.time = time;
  travel.back = back;
  travel.end = way;
  travel.last = static_cast<std::size_t>(at - slaves_.data());
  travel.latches = (effects & Esc::effect_receive_times) != 0;
  if (travel.kind == FrameKind::foreign) return;
  if (travel.frame.udp_checksum != nullptr) store_u16(travel.frame.udp_checksum, 0);
  if ((effects & Esc::effect_marks) != 0 && travel.frame.source_address != nullptr) {
    *travel.frame.source_address |= locally_administered;
  }
}

// The frame turned at the last slave and comes back through port 1 of those before it.
void Segment::latch_returning(std::size_t first, const Travel& travel) {
  Time time = travel.time;
  for (std::size_t slave = travel.last; slave > first; --slave) {
    time += slaves_[slave].backward;
    slaves_[slave - 1].esc->latch_port_time(1, time);
  }
}

// A frame that was marked as damaged turned at the last slave.
void Segment::count_returning_error(const Travel& travel) {
  for (std::size_t slave = travel.last; slave > 0; --slave) slaves_[slave - 1].esc->count_forwarded_error(1);
}

Segment::Passage Segment::process(std::span<std::uint8_t> bytes, Time now, Port entry, Encapsulation encapsulation) {
  Travel travel;
  travel.time = now;
  const bool whole = encapsulation == Encapsulation::ethernet;
  travel.kind = whole ? parse_ethernet(bytes, travel.frame) : parse_payload(bytes, travel.frame);
  travel.executable = travel.kind == FrameKind::ethercat;
  Passage passage;
  if (!slaves_.empty()) passage = entry == Port::primary ? enter_front(travel) : enter_back(travel);
  passage.kind = travel.kind;
  return passage;
}

inline Segment::Passage Segment::enter_front(Travel& travel) {
  Slave& front = slaves_.front();
  if (!front.cable || !front.powered) return {};
  if (front.esc->loop_closed(0)) {
    front.esc->frame_at_closed_port(0);
    return {};
  }
  travel.time += front.forward;
  run_forward(0, travel);
  if (travel.corrupted && travel.end == Way::turns) count_returning_error(travel);
  if (travel.corrupted || travel.destroyed || travel.end == Way::ends) return {};
  if (travel.end == Way::open) return {travel.time, Exit::secondary};
  if (travel.latches) latch_returning(0, travel);
  return {travel.time + travel.back, Exit::primary};
}

Segment::Passage Segment::enter_back(Travel& travel) {
  // Into port 1 of the last slave, through to port 0 without processing, until a port 0 has its loop closed.
  std::size_t slave = slaves_.size() - 1;
  Slave& back = slaves_[slave];
  if (!ring_cable_ || !back.powered) return {};
  if (back.esc->loop_closed(1)) {
    back.esc->frame_at_closed_port(1);
    return {};
  }
  const Time entered = travel.time;
  for (Way way = way_before(slave); way != Way::turns; way = way_before(slave)) {
    if (way == Way::ends) return {};
    travel.time += slaves_[slave].backward;
    if (slave == 0) return {travel.time, Exit::primary};
    --slave;
  }
  // A frame that comes a second time to a port 0 without a link circulates and is taken off the line (ETG.1000.4 clause
  // 5.3.3).
  if (slaves_[slave].esc->closes_loops_itself(0)) {
    for (Datagram& datagram : travel.frame.datagrams()) {
      if (datagram.circulating()) return {};
      datagram.set_circulating();
    }
  }
  const std::size_t turning = slave;
  run_forward(turning, travel);
  if (travel.corrupted || travel.destroyed || travel.end != Way::open) return {};
  if (travel.latches) {
    Time time = entered;
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
