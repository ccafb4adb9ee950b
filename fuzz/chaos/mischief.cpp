#include "mischief.hpp"

#include <cmath>

namespace servodrome::chaos {
namespace {

using namespace std::chrono_literals;

constexpr Time can_delay = 3ms;
constexpr Time shortest_segment_delay = 1ms;
constexpr std::int64_t segment_delay_range_us = 8000;
constexpr double off_mean_s = 2.0;  // mean duration of a power cut or a pulled cable

}  // namespace

void Mischief::CanDoubler::sent(const canopen::Frame& frame, Time at) {
  if (!mischief_.draws()) return;
  ++mischief_.doubled_;
  mischief_.ports_[subject_.bus].send(frame, at);
}

bool Mischief::CanDoubler::lets_in(canopen::Frame& frame, Time) {
  constexpr std::uint32_t sync = 0x080;
  const bool own = (frame.id & 0x7F) == subject_.axis->device().node_id();
  const bool asks = frame.id == 0 || (own && (frame.id & 0x780) == 0x600);
  if (asks) subject_.around.commanded = mischief_.world_.tick() + 1;
  if ((asks || own || frame.id == sync) && mischief_.draws()) {
    ++mischief_.doubled_;
    again_.push_back(frame);
  }
  return true;
}

void Mischief::CanDoubler::deliver(Time now) {
  while (!again_.empty()) {
    subject_.around.commanded = mischief_.world_.tick() + 1;
    subject_.axis->deliver(again_.front(), now);
    again_.pop_front();
  }
}

links::EthercatInterposer::Entry Mischief::SegmentInterposer::enters(std::span<std::uint8_t>, Encapsulation, Time) {
  Entry entry;
  entry.lost = mischief_.draws();
  if (mischief_.draws()) {
    ++mischief_.doubled_;
    entry.passes = 2;
  }
  return entry;
}

links::EthercatInterposer::Return Mischief::SegmentInterposer::returns(std::span<std::uint8_t>, Encapsulation, Time) {
  Return back;
  back.lost = mischief_.draws();
  if (mischief_.draws()) {
    back.delay = shortest_segment_delay + std::chrono::microseconds(mischief_.random_.below(segment_delay_range_us));
  }
  return back;
}

Mischief::Mischief(World& world) : world_(world), random_(world.options().seed, 1) {
  const double share = world.options().share;
  std::uint64_t seed = world.options().seed;
  for (const auto& bus : world.line().buses()) {
    ports_.emplace_back(bus->bus);
    bus->bus.disturb({.drop = share, .delay = share, .corrupt = share, .delay_time = can_delay, .seed = seed++});
  }
  for (const auto& bus : world.line().ethercat_buses()) {
    bus->bus.interpose(&at_segment_);
    bus->bus.disturb({.corrupt = share, .seed = seed++});
  }
  for (Subject& subject : world.subjects()) {
    power_.push_back({.next = draw_ticks(world.options().power_cut_every_s)});
    cable_.push_back({.next = draw_ticks(world.options().cable_every_s)});
    CanDoubler& doubler = doublers_.emplace_back(*this, subject);
    if (subject.bus != segment) subject.axis->interpose(&doubler);
  }
}

Mischief::~Mischief() {
  for (const auto& axis : world_.line().axes()) axis->interpose(nullptr);
  for (const auto& bus : world_.line().ethercat_buses()) bus->bus.interpose(nullptr);
}

// Exponentially distributed, because the events are independent.
std::int64_t Mischief::draw_ticks(double mean_s) {
  const double seconds = -mean_s * std::log(1.0 - random_.unit());
  return world_.tick() + 1 + std::llround(seconds * ticks_per_s);
}

void Mischief::tick() {
  for (std::size_t i = 0; i < power_.size(); ++i) {
    Subject& subject = world_.subjects()[i];
    if (subject.bus != segment) doublers_[i].deliver(world_.line().now());
    if (world_.quiet) continue;
    if (power_[i].next <= world_.tick()) {
      power_[i].off = !power_[i].off;
      set_power(subject, !power_[i].off);
      power_[i].next = draw_ticks(power_[i].off ? off_mean_s : world_.options().power_cut_every_s);
    }
    if (cable_[i].next <= world_.tick()) {
      cable_[i].off = !cable_[i].off;
      set_cable(subject, !cable_[i].off);
      cable_[i].next = draw_ticks(cable_[i].off ? off_mean_s : world_.options().cable_every_s);
    }
  }
}

// A slave without power, or a cable that is pulled, also disconnects the slaves behind it, and our master then starts
// the whole segment again.
template <typename Action>
void Mischief::for_all_struck(const Subject& subject, Action action) {
  for (std::size_t i = 0; i < world_.subjects().size(); ++i) {
    Subject& other = world_.subjects()[i];
    if (&other == &subject || (subject.bus == segment && other.bus == segment)) action(other, i);
  }
}

void Mischief::set_power(Subject& subject, bool on) {
  if (on) {
    subject.axis->power_on(world_.line().now());
  } else {
    subject.axis->power_off(world_.line().now());
    ++subject.record.power_cuts;
  }
  subject.around.powered = on;
  subject.around.disturbed = world_.tick();
  for_all_struck(subject, [&](Subject& other, std::size_t) { on ? world_.over(other) : World::struck(other); });
}

void Mischief::set_cable(Subject& subject, bool connected) {
  if (subject.bus == segment) {
    world_.line().ethercat_buses().front()->bus.set_cable(subject.place, connected);
  } else {
    world_.line().buses()[subject.bus]->bus.cut(subject.axis->port(), !connected);
  }
  if (!connected) ++subject.record.cable_pulls;
  for_all_struck(subject, [&](Subject& other, std::size_t) {
    other.around.cut = !connected;
    if (connected) other.around.joined = world_.tick();
    other.around.commanded = world_.tick();
    connected ? world_.over(other) : World::struck(other);
  });
}

void Mischief::end() {
  world_.quiet = true;
  for (const auto& bus : world_.line().buses()) bus->bus.clear_disturbance();
  for (const auto& bus : world_.line().ethercat_buses()) bus->bus.clear_disturbance();
  for (std::size_t i = 0; i < power_.size(); ++i) {
    Subject& subject = world_.subjects()[i];
    if (power_[i].off) set_power(subject, true);
    if (cable_[i].off) set_cable(subject, true);
    power_[i].off = cable_[i].off = false;
  }
}

Mischief::Counts Mischief::counts() const {
  Counts counts;
  for (const auto& bus : world_.line().buses()) {
    counts.frames += bus->bus.counters().frames;
    counts.dropped += bus->bus.counters().dropped;
    counts.corrupted += bus->bus.counters().corrupted;
    counts.delayed += bus->bus.counters().delayed;
  }
  for (const auto& bus : world_.line().ethercat_buses()) {
    counts.frames += bus->bus.counters().frames;
    counts.dropped += bus->bus.counters().dropped;
    counts.corrupted += bus->bus.counters().corrupted;
    counts.delayed += bus->bus.counters().delayed;
  }
  counts.doubled = doubled_;
  return counts;
}

}  // namespace servodrome::chaos
