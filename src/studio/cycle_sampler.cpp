#include "studio/cycle_sampler.hpp"

#include <algorithm>

#include "line/axis.hpp"

namespace servodrome::studio {

std::optional<std::int64_t> CycleSampler::period_of(std::size_t drive, master::ObjectAddress object) const {
  const std::lock_guard lock(mutex_);
  const auto member = member_of(drive);
  if (!member || !bus_->image(*member).input(object)) return std::nullopt;
  return std::max<std::int64_t>(1, (bus_->period() + line::tick_length / 2) / line::tick_length);
}

void CycleSampler::add(std::span<const std::shared_ptr<BusSamples>> samples) {
  const std::lock_guard lock(mutex_);
  std::erase_if(channels_, [](const Channel& channel) { return channel.samples.expired(); });
  for (const auto& its : samples) find(channels_.emplace_back(Channel{its}));
}

// The mapping may have changed with the bus.
void CycleSampler::attach(master::CyclicBus* bus, std::vector<std::size_t> members) {
  if (bus_ != nullptr) bus_->on_cycle({});
  {
    const std::lock_guard lock(mutex_);
    bus_ = bus;
    members_ = std::move(members);
    for (Channel& channel : channels_) find(channel);
  }
  if (bus_ != nullptr) bus_->on_cycle([this] { take(); });
}

std::optional<std::size_t> CycleSampler::member_of(std::size_t drive) const {
  if (bus_ == nullptr) return std::nullopt;
  if (members_.empty()) return drive;
  const auto found = std::find(members_.begin(), members_.end(), drive);
  if (found == members_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - members_.begin());
}

void CycleSampler::find(Channel& channel) {
  channel.place.reset();
  const auto samples = channel.samples.lock();
  const auto member = samples ? member_of(samples->drive()) : std::nullopt;
  if (!member) return;
  channel.member = *member;
  channel.place = bus_->image(*member).input(samples->object());
}

void CycleSampler::take() {
  const std::int64_t tick = (bus_->inputs_taken() - start_) / line::tick_length;
  if (bus_->is_fresh(0)) ++count_;
  const std::lock_guard lock(mutex_);
  for (const Channel& channel : channels_) {
    if (!channel.place) continue;
    const auto samples = channel.samples.lock();
    if (!samples || !bus_->is_fresh(channel.member)) continue;
    const std::uint64_t raw = channel.place->raw();
    samples->note(tick, std::as_bytes(std::span(&raw, 1)).first((channel.place->bits() + 7) / 8));
  }
}

}  // namespace servodrome::studio
