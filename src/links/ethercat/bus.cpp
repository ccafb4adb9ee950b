#include "links/ethercat/bus.hpp"

#include <algorithm>
#include <utility>

namespace servodrome::links {

std::size_t EthercatBus::attach(EthercatStation& station, Hop hop) {
  const bool ring = cable(size());
  stations_.push_back(&station);
  slaves_.push_back({.esc = &station.esc(), .forward = hop.forward, .backward = hop.backward});
  segment_ = ethercat::Segment(slaves_);
  segment_.set_cable(size(), ring);
  return size() - 1;
}

void EthercatBus::detach(std::size_t position) {
  stations_.at(position) = nullptr;
  slaves_[position].esc = &absent_;
  segment_.set_powered(position, false, Time{});
}

EthercatBus::Passage EthercatBus::pass(std::span<std::uint8_t> frame, Time at, Port entry, Encapsulation encapsulation,
                                       EthercatSender sender) {
  sender_ = sender;
  for (EthercatObserver* observer : observers_) {
    observer->on_frame(frame, encapsulation, EthercatObserver::Direction::in, at);
  }
  const bool usual = !disturbance_ && interposer_ == nullptr && kept_.empty();
  Passage passage = usual ? Passage{segment_.process(frame, at, entry, encapsulation), Time{}, frame.size()}
                          : pass_disturbed(frame, at, entry, encapsulation);
  count(passage);
  if (passage.exit != Exit::lost) {
    for (EthercatObserver* observer : observers_) {
      observer->on_frame(frame.first(passage.length), encapsulation, EthercatObserver::Direction::out, passage.leaves);
    }
  }
  for (const std::vector<std::uint8_t>& extra : passage.behind) {
    for (EthercatObserver* observer : observers_) {
      observer->on_frame(extra, encapsulation, EthercatObserver::Direction::out, passage.leaves);
    }
  }
  return passage;
}

// Passes a frame with the effects of a disturbance, an interposer, and frames that were kept.
EthercatBus::Passage EthercatBus::pass_disturbed(std::span<std::uint8_t> frame, Time at, Port entry,
                                                 Encapsulation encapsulation) {
  Blow blow = disturbance_ ? draw() : Blow{};
  if (interposer_ != nullptr) enter_interposed(blow, frame, encapsulation, at);
  Passage passage;
  if (!blow.drop) {
    if (blow.corrupts_at) slaves_[*blow.corrupts_at].corrupts_next = true;
    passage = {segment_.process(frame, at, entry, encapsulation), blow.delay};
    for (unsigned n = 1; n < blow.passes && passage.exit != Exit::lost; ++n) {
      passage = {segment_.process(frame, passage.leaves, entry, encapsulation), blow.delay};
    }
    passage.leaves += blow.delay;
    // If the frame did not reach the slave, for instance because a cable is cut, nothing was corrupted.
    if (blow.corrupts_at && !std::exchange(slaves_[*blow.corrupts_at].corrupts_next, false)) ++counters_.corrupted;
  }
  passage.length = frame.size();
  if (blow.drop_answer) passage.exit = Exit::lost;
  if (interposer_ != nullptr && passage.exit != Exit::lost) return_interposed(passage, frame, encapsulation);
  if (!kept_.empty()) return_kept(passage, at);
  return passage;
}

void EthercatBus::enter_interposed(Blow& blow, std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) {
  const EthercatInterposer::Entry entry = interposer_->enters(frame, encapsulation, at);
  if (entry.lost && !blow.drop && !blow.drop_answer) ++counters_.dropped;
  blow.drop = blow.drop || entry.lost;
  blow.passes = entry.passes;
}

void EthercatBus::return_interposed(Passage& passage, std::span<std::uint8_t> frame, Encapsulation encapsulation) {
  const EthercatInterposer::Return back = interposer_->returns(frame, encapsulation, passage.leaves);
  passage.length = std::min(back.length.value_or(frame.size()), frame.size());
  passage.behind = back.behind;
  if (back.lost) {
    passage.exit = Exit::lost;
    ++counters_.dropped;
  } else if (back.delay > Time{}) {
    if (passage.delay == Time{}) ++counters_.delayed;
    passage.delay += back.delay;
    passage.leaves += back.delay;
  }
}

void EthercatBus::return_kept(Passage& passage, Time at) {
  const auto returns = [this](const Kept& one) { return one.sender == sender_; };
  behind_.clear();
  for (Kept& one : kept_) {
    if (returns(one)) behind_.push_back(std::move(one.bytes));
  }
  if (behind_.empty()) return;
  std::erase_if(kept_, returns);
  behind_.insert(behind_.end(), passage.behind.begin(), passage.behind.end());
  passage.behind = behind_;
  passage.leaves = std::max(passage.leaves, at);  // a lost frame has no time
}

void EthercatBus::bring_back(EthercatSender sender, std::vector<std::uint8_t> frame) {
  if (kept_.size() == most_kept) {  // the oldest one: its sender may be gone
    kept_.erase(kept_.begin());
    ++counters_.dropped;
  }
  kept_.push_back({sender, std::move(frame)});
}

void EthercatBus::settle(Time at) {
  for (const ethercat::Segment::Slave& slave : slaves_) {
    if (slave.esc->quiet(at) || !slave.powered) continue;
    if (slave.esc->calls(at)) {
      const auto position = static_cast<std::size_t>(&slave - slaves_.data());
      next_event_ = std::min(next_event_, stations_[position]->frame_passed(at));
    } else {
      next_event_ = ethercat::Esc::unknown;
    }
  }
}

void EthercatBus::count(const ethercat::Segment::Passage& passage) {
  ++counters_.frames;
  if (passage.exit == Exit::lost) ++counters_.lost;
  if (passage.kind == ethercat::FrameKind::malformed) ++counters_.malformed;
  if (passage.kind == ethercat::FrameKind::foreign) ++counters_.foreign;
}

void EthercatBus::disturb(const EthercatDisturbance& disturbance) {
  disturbance_ = disturbance;
  disturbed_frames_ = 0;
  DisturbanceGenerator seeds(disturbance.seed);
  drop_draws_ = DisturbanceGenerator(seeds.next());
  drop_answer_draws_ = DisturbanceGenerator(seeds.next());
  corrupt_draws_ = DisturbanceGenerator(seeds.next());
  delay_draws_ = DisturbanceGenerator(seeds.next());
}

// Takes the same number of draws from each generator for every frame, whatever the results.
EthercatBus::Blow EthercatBus::draw() {
  const EthercatDisturbance& what = *disturbance_;
  Blow blow;
  blow.drop = drop_draws_.chance(what.drop);
  blow.drop_answer = drop_answer_draws_.chance(what.drop_answer);
  const bool corrupts = corrupt_draws_.chance(what.corrupt);
  const std::uint64_t place = corrupt_draws_.next();
  const bool delays = delay_draws_.chance(what.delay);
  if ((what.limit != 0 && disturbed_frames_ >= what.limit) || slaves_.empty()) return {};

  if (corrupts) blow.corrupts_at = std::min<std::size_t>(what.position.value_or(place % size()), size() - 1);
  if (delays) blow.delay = what.delay_time;
  if (blow.drop || blow.drop_answer) ++counters_.dropped;
  if (delays) ++counters_.delayed;
  if (blow.drop || blow.drop_answer || corrupts || delays) ++disturbed_frames_;
  return blow;
}

void EthercatBus::add_observer(EthercatObserver& observer) { observers_.push_back(&observer); }

void EthercatBus::remove_observer(EthercatObserver& observer) {
  observers_.erase(std::remove(observers_.begin(), observers_.end(), &observer), observers_.end());
}

}  // namespace servodrome::links
