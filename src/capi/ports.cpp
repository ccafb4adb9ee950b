#include "capi/ports.hpp"

#include <algorithm>

namespace servodrome::capi {

Recorder::Recorder(line::Line& line, const std::vector<const api::NamedChannel*>& channels, std::int64_t stride)
    : line_(line), stride_(stride) {
  for (const api::NamedChannel* channel : channels) samples_.push_back(channel->open(stride));
  for (const auto& samples : samples_) first_ = std::max(first_, samples->due());
  next_ = first_;
  fetch(line_.now());
  line_.add_follower(*this);
}

Recorder::~Recorder() { line_.remove_follower(*this); }

std::size_t Recorder::rows() {
  fetch(line_.now());
  return values_.size() / columns();
}

void Recorder::reached(Time now) { fetch(now); }

// The samples keep a limited number of rows, so they are fetched when half of them are new.
void Recorder::fetch(Time now) {
  const std::int64_t end = now / line::tick_length;
  for (; next_ <= end; next_ += stride_) {
    for (const auto& samples : samples_) values_.push_back(samples->at(next_));
  }
  const auto ticks = static_cast<std::int64_t>(api::SampleRows::kept / 2) * stride_;
  next_fetch_ = (end + ticks) * line::tick_length;
}

links::TimedFrame CanPort::take(bool& lost) {
  const links::TimedFrame frame = *port_.receive();
  lost = port_.dropped() != lost_;
  lost_ = port_.dropped();
  return frame;
}

std::size_t BytePort::take_into(std::span<std::uint8_t> into) {
  const std::size_t size = std::min(into.size(), received_.size());
  const auto end = received_.begin() + static_cast<std::ptrdiff_t>(size);
  std::copy(received_.begin(), end, into.begin());
  received_.erase(received_.begin(), end);
  return size;
}

void BytePort::receive(std::uint8_t character, bool /*intact*/, Time /*at*/) { received_.push_back(character); }

EthernetPort::EthernetPort(links::EthercatBus& bus, links::EthercatBus::Port side) : bus_(bus), side_(side) {
  if (side_ == links::EthercatBus::Port::secondary) bus_.set_cable(bus_.size(), true);
}

EthernetPort::~EthernetPort() {
  if (side_ == links::EthercatBus::Port::secondary) bus_.set_cable(bus_.size(), false);
}

void EthernetPort::send(std::span<const std::uint8_t> frame, Time now, EthernetPort* other) {
  std::vector<std::uint8_t> bytes(frame.begin(), frame.end());
  const links::EthercatBus::Passage passage =
      bus_.exchange(bytes, now, side_, links::EthercatBus::Encapsulation::ethernet, {this});
  const bool is_lost = passage.exit == links::EthercatBus::Exit::lost;
  const bool leaves_second = passage.exit == links::EthercatBus::Exit::secondary;
  const bool here = is_lost || other == nullptr || leaves_second == (side_ == links::EthercatBus::Port::secondary);
  EthernetPort& end = here ? *this : *other;
  bytes.resize(passage.length);
  if (!is_lost) end.keep(passage.leaves, std::move(bytes));
  for (const std::vector<std::uint8_t>& extra : passage.behind) end.keep(passage.leaves, extra);
}

void EthernetPort::keep(Time at, std::vector<std::uint8_t> bytes) {
  const auto later = std::upper_bound(returning_.begin(), returning_.end(), at,
                                      [](Time time, const Returning& one) { return time < one.at; });
  returning_.insert(later, {at, std::move(bytes)});
}

}  // namespace servodrome::capi
