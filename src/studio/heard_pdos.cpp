#include "studio/heard_pdos.hpp"

#include <algorithm>
#include <cstring>

#include "line/axis.hpp"

namespace servodrome::studio {
namespace {

using master::sampling::sync_id;

}  // namespace

links::Heard HeardPdos::heard(links::Heard next) {
  return [this, next = std::move(next)](bool sent, std::span<const std::uint8_t> bytes) {
    canopen::Frame frame;
    std::memcpy(&frame, bytes.data(), sizeof frame);
    hear(sent, frame, links::steady_now());
    next(sent, bytes);
  };
}

void HeardPdos::add(const std::shared_ptr<BusSamples>& samples) {
  const std::lock_guard lock(mutex_);
  std::erase_if(samples_, [](const auto& its) { return its.expired(); });
  samples_.push_back(samples);
}

HeardPdos::Use HeardPdos::use(links::Time now) const {
  const std::lock_guard lock(mutex_);
  Use use;
  if (sign_ && now - sign_at_ < longest_memory) use.by_others = sign_;
  use.listened = now - forgot_;
  if (last_sync_ && sync_period_.count() != 0 && now - *last_sync_ < 2 * longest_sync_period) {
    use.sync_period = sync_period_;
  }
  return use;
}

bool HeardPdos::is_sent(std::uint32_t can_id, links::Time now) const {
  const std::lock_guard lock(mutex_);
  const std::size_t place = can_id - master::sampling::first_pdo;
  return place < pdo_at_.size() && pdo_at_[place].count() != 0 && now - pdo_at_[place] < longest_memory;
}

bool HeardPdos::is_operational(std::uint8_t node_id, links::Time now) const {
  const std::lock_guard lock(mutex_);
  const links::Time at = operational_at_[node_id & 0x7FU];
  return at.count() != 0 && now - at < longest_memory;
}

void HeardPdos::forget(links::Time now) {
  const std::lock_guard lock(mutex_);
  sign_.reset();
  pdo_at_.fill({});
  operational_at_.fill({});
  last_sync_.reset();
  sync_period_ = {};
  forgot_ = now;
}

void HeardPdos::hear_sync(links::Time now) {
  constexpr int weight = 8;
  const links::Time period = now - last_sync_.value_or(now);
  last_sync_ = now;
  if (period.count() == 0 || period > longest_sync_period) {
    sync_period_ = {};
  } else if (sync_period_.count() == 0) {
    sync_period_ = period;
  } else {
    sync_period_ += (period - sync_period_) / weight;
  }
}

void HeardPdos::hear(bool sent, const canopen::Frame& frame, links::Time now) {
  if (frame.extended || frame.remote) return;
  const std::lock_guard lock(mutex_);
  if (frame.id == sync_id) hear_sync(now);
  if (sent) return;
  if (const auto sign = master::sampling::use_of_pdos(frame)) {
    sign_ = sign;
    sign_at_ = now;
    if (sign->by == master::sampling::UseOfPdos::By::pdo) pdo_at_[frame.id - master::sampling::first_pdo] = now;
    if (sign->by == master::sampling::UseOfPdos::By::operational) operational_at_[sign->node_id] = now;
  }
  for (const auto& its : samples_) {
    const auto samples = its.lock();
    if (!samples || samples->sampling().can_id != frame.id) continue;
    const Sampling& sampling = samples->sampling();
    if (8U * frame.length < sampling.bits.first + sampling.bits.count) continue;
    auto data = frame.data;
    const std::uint64_t raw = master::ProcessObject(data.data(), sampling.bits).raw();
    // A synchronous TPDO has the values of the SYNC before it.
    const links::Time at = sampling.on_sync && last_sync_ ? *last_sync_ : now;
    samples->note((at - start_) / line::tick_length,
                  std::as_bytes(std::span(&raw, 1)).first((sampling.bits.count + 7) / 8));
  }
}

}  // namespace servodrome::studio
