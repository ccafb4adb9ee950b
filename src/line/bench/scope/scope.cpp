#include "line/bench/scope/scope.hpp"

#include <fmt/format.h>
#include <random>

#include "line/bench/axis_view.hpp"

namespace servodrome::line::bench {
namespace {

constexpr auto views_live = std::chrono::milliseconds(15);

std::string random_name() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

Scope::Scope(Line& line)
    : line_(line),
      start_(random_name()),
      recordings_([this](const Recording& recording) {
        Json event{{"kind", "recording"}, {"axis", nullptr}, {"tick", line_.now() / tick_length}};
        event["recording"] = recording.view();
        publish(event);
      }),
      next_look_(line.now() + period) {
  for (const auto& axis : line_.axes()) {
    monitors_.push_back(std::make_unique<AxisMonitor>(*axis, taps_, [this](const Json& event) { publish(event); }));
  }
  line_.add_follower(*this);
}

Scope::~Scope() { line_.remove_follower(*this); }

Json Scope::greeting() const {
  return {{"version", SERVODROME_VERSION}, {"start", start_}, {"tick", line_.now() / tick_length}};
}

void Scope::publish(const Json& event) {
  if (sessions_.empty()) return;
  const std::string message = to_text({{"event", event}});
  for (StreamSession* session : sessions_) session->send_event(message);
}

void Scope::remove(StreamSession& session) { std::erase(sessions_, &session); }

void Scope::reached(Time now) {
  next_look_ = now + period;
  const std::int64_t end = now / tick_length + 1;
  for (const auto& monitor : monitors_) monitor->take(end, recordings_);
  recordings_.take(end);
  if (sessions_.empty()) return;
  const WallTime wall = std::chrono::steady_clock::now();
  for (StreamSession* session : sessions_) session->send_samples(end, wall);
}

void Scope::attend(WallTime now) {
  for (StreamSession* session : sessions_) session->attend(now);
}

const Scope::Views& Scope::views(WallTime now) {
  if (now - views_made_ < views_live && !views_.clock.empty()) return views_;
  views_made_ = now;
  views_.axes.clear();
  for (const auto& axis : line_.axes()) views_.axes.push_back(to_text(view_of(line_, *axis)));
  views_.clock = to_text(clock_view(line_));
  return views_;
}

}  // namespace servodrome::line::bench
