#include "line/bench/scope/axis_monitor.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>

#include "drive/drive.hpp"

namespace servodrome::line::bench {
namespace {

static_assert(AxisMonitor::samples_before + 1 <= static_cast<std::int64_t>(api::SampleRows::kept));

// The drive's position demand and actual position, if it has these objects.
constexpr std::array<std::uint16_t, 2> positions{0x6062, 0x6064};
constexpr std::array moment_signals{"position_counts", "velocity_rpm",    "torque_nm", "current_a",
                                    "supply_v",        "following_error", "statusword"};

}  // namespace

AxisMonitor::AxisMonitor(Axis& axis, LineSource& source, Publish publish)
    : axis_(axis), publish_(std::move(publish)), known_power_(axis.powered()) {
  std::vector<Channel> looked_at;
  for (const std::uint16_t index : positions) {
    const dictionary::Entry* entry = axis.device().dictionary().find(index, 0);
    const Channel channel = entry != nullptr ? object_channel(axis, *entry) : Channel{};
    if (channel.read == nullptr) continue;
    looked_at.push_back(channel);
    channels_.push_back(source.object(axis, index, 0));
  }
  for (const char* name : moment_signals) {
    looked_at.push_back(signal_channel(axis, name));
    channels_.push_back(source.signal(axis, name));
  }
  for (const char* name : {"state", "fault_code"}) looked_at.push_back(signal_channel(axis, name));
  taps_ = source.taps().open(std::move(looked_at), stride);
  fault_code_ = std::move(taps_.back());
  taps_.pop_back();
  state_ = std::move(taps_.back());
  taps_.pop_back();
  first_ = next_ = state_->due();
  if (known_power_) known_state_ = static_cast<int>(axis.device().drive().state());
}

void AxisMonitor::take(std::int64_t end, api::Recordings& recordings) {
  for (; next_ < end; next_ += stride) look(next_, recordings);
}

void AxisMonitor::look(std::int64_t tick, api::Recordings& recordings) {
  const double state = state_->at(tick);
  const bool power = !std::isnan(state);
  if (power != known_power_) {
    known_power_ = power;
    known_state_.reset();
    known_fault_ = 0;
    tell("power", tick, {{"powered", power}});
  }
  if (!power) return;
  if (const int present = static_cast<int>(state); present != known_state_) {
    known_state_ = present;
    tell("state", tick, {{"state", drive::name(static_cast<drive::PowerState>(present))}});
  }
  const auto code = static_cast<unsigned>(fault_code_->at(tick));
  if (code == known_fault_) return;
  if (code == 0) {
    tell("fault_gone", tick, {{"code", fmt::format("0x{:04X}", known_fault_)}});
  } else {
    tell("fault", tick, {{"code", fmt::format("0x{:04X}", code)}});
    if (known_fault_ == 0) keep_moment(tick, code, recordings);
  }
  known_fault_ = code;
}

void AxisMonitor::keep_moment(std::int64_t tick, unsigned code, api::Recordings& recordings) {
  api::Recording::Plan plan;
  plan.name = fmt::format("fault 0x{:04X} of {}", code, axis_.settings().name);
  plan.channels = channels_;
  plan.stride = stride;
  plan.samples = moment_samples;
  plan.before = samples_before;
  // The taps may keep more of the past than `samples_before`; the recording leaves out older samples.
  const std::int64_t oldest = tick - samples_before * stride;
  recordings.add_moment(std::move(plan), taps_, std::max(first_, oldest), tick, {axis_.settings().name, code});
}

void AxisMonitor::tell(const char* kind, std::int64_t tick, Json details) {
  Json event{{"kind", kind}, {"axis", axis_.settings().name}, {"tick", tick}};
  event.update(details);
  publish_(std::move(event));
}

}  // namespace servodrome::line::bench
