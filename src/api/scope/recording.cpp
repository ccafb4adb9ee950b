#include "api/scope/recording.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <limits>

#include "drive/hardware.hpp"

namespace servodrome::api {
namespace {

constexpr std::int64_t never_ends = std::numeric_limits<std::int64_t>::max();

const char* word(RecordingState state) {
  constexpr std::array words{"armed", "running", "done", "stopped"};
  return words[static_cast<std::size_t>(state)];
}

}  // namespace

Recording::Recording(Plan plan, ArmedTrigger trigger)
    : plan_(std::move(plan)),
      trigger_(std::move(trigger)),
      values_(static_cast<std::size_t>(plan_.samples) * plan_.channels.size()),
      begin_(0),
      end_(never_ends) {
  for (const NamedChannel& channel : plan_.channels) taps_.push_back(channel.open(plan_.stride));
  // A tap that other readers have opened before may be behind the new ones.
  first_ = taps_.front()->due();
  for (const auto& tap : taps_) first_ = std::max(first_, tap->due());
  next_ = first_;
  if (std::any_of(taps_.begin(), taps_.end(), [](const auto& tap) { return tap->counts(); })) {
    taken_.resize(values_.size());
  }
}

Recording::Recording(Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first, std::int64_t trigger,
                     Fault fault)
    : plan_(std::move(plan)),
      taps_(std::move(taps)),
      values_(static_cast<std::size_t>(plan_.samples) * plan_.channels.size()),
      fault_(std::move(fault)),
      first_(first),
      next_(first),
      begin_(0),
      end_(never_ends) {
  trigger_at(trigger);
}

Recording::Recording(Plan plan, Kept kept)
    : plan_(std::move(plan)),
      values_(kept.values.size()),
      state_(kept.is_stopped ? RecordingState::stopped : RecordingState::done),
      trigger_tick_(kept.trigger_tick),
      fault_(std::move(kept.fault)),
      first_(kept.first_tick),
      next_(kept.first_tick + plan_.samples * plan_.stride),
      begin_(kept.first_tick),
      end_(next_) {
  const auto size = static_cast<std::size_t>(plan_.samples);
  for (std::size_t i = 0; i < values_.size(); ++i) {
    values_[i / size * size + slot(tick(static_cast<std::int64_t>(i % size)))] = kept.values[i];
  }
}

void Recording::trigger_at(std::int64_t tick) {
  trigger_tick_ = tick;
  state_ = RecordingState::running;
  const std::int64_t at = (tick + plan_.stride - 1) / plan_.stride * plan_.stride;
  begin_ = std::max(first_, at - plan_.before * plan_.stride);  // an early trigger does not shorten the recording
  end_ = begin_ + plan_.samples * plan_.stride;
}

bool Recording::take(std::int64_t end) {
  if (ended()) return false;
  const RecordingState before = state_;
  if (state_ == RecordingState::armed) {
    if (const auto hit = trigger_->find(end)) {
      trigger_at(hit->tick);
      if (trigger_->is_fault()) fault_ = Fault{hit->axis, static_cast<unsigned>(hit->value)};
      trigger_.reset();
    }
  }
  const auto size = static_cast<std::size_t>(plan_.samples);
  for (; next_ < std::min(end, end_); next_ += plan_.stride) {
    const std::size_t at = slot(next_);
    for (std::size_t i = 0; i < taps_.size(); ++i) values_[i * size + at] = taps_[i]->at(next_);
    for (std::size_t i = 0; !taken_.empty() && i < taps_.size(); ++i) taken_[i * size + at] = taps_[i]->taken(next_);
  }
  if (next_ >= end_) finish(RecordingState::done);
  return state_ != before;
}

void Recording::stop() {
  if (!ended()) finish(RecordingState::stopped);
}

void Recording::finish(RecordingState state) {
  state_ = state;
  for (std::size_t i = 0; i < taps_.size(); ++i) {
    if (taps_[i]->counts()) plan_.channels[i].view["sampled"].update(count(i));
  }
  trigger_.reset();
  taps_.clear();
  taken_ = {};
  plan_.held.reset();
}

// The real rate of a channel, and how many of its samples are missing.
Json Recording::count(std::size_t channel) const {
  std::int64_t sampled = 0;
  std::int64_t missed = 0;
  std::int64_t first = 0;  // rows
  std::int64_t last = 0;
  for (std::int64_t row = 0; row < samples(); ++row) {
    const Taken taken = taken_[channel * static_cast<std::size_t>(plan_.samples) + slot(tick(row))];
    if (taken == Taken::missed) ++missed;
    if (taken != Taken::sampled) continue;
    if (sampled++ == 0) first = row;
    last = row;
  }
  const double rows_per_second = static_cast<double>(drive::ticks_per_second) / static_cast<double>(plan_.stride);
  const double rate_hz =
      sampled > 1 ? static_cast<double>(sampled - 1) / static_cast<double>(last - first) * rows_per_second : 0.0;
  return {{"rate_hz", rate_hz}, {"samples", sampled}, {"missed", missed}};
}

std::int64_t Recording::first_shown() const {
  const std::int64_t kept = next_ - plan_.samples * plan_.stride;
  return std::max({first_, trigger_tick_ ? begin_ : kept, kept});
}

std::int64_t Recording::samples() const { return std::max<std::int64_t>(0, (next_ - first_shown()) / plan_.stride); }

double Recording::value(std::size_t channel, std::int64_t sample) const {
  return values_[channel * static_cast<std::size_t>(plan_.samples) + slot(tick(sample))];
}

Json Recording::view() const {
  Json view{{"id", plan_.id},
            {"name", plan_.name},
            {"note", plan_.note},
            {"state", word(state_)},
            {"rate_hz", static_cast<double>(drive::ticks_per_second) / static_cast<double>(plan_.stride)},
            {"stride", plan_.stride},
            {"trigger_tick", trigger_tick_ ? Json(*trigger_tick_) : Json(nullptr)},
            {"first_tick", first_shown()},
            {"samples", samples()},
            {"samples_wanted", plan_.samples},
            {"bytes", bytes()},
            {"channels", views_of(plan_.channels)}};
  if (fault_) view["fault"] = {{"axis", fault_->axis}, {"code", fmt::format("0x{:04X}", fault_->code)}};
  return view;
}

}  // namespace servodrome::api
