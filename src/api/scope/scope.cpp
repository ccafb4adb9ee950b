#include "api/scope/scope.hpp"

#include <algorithm>

#include "api/version.hpp"

namespace servodrome::api {
namespace {

constexpr auto views_live = std::chrono::milliseconds(15);

}  // namespace

Scope::Scope(Source& source)
    : source_(source), recordings_([this](const Recording& recording) {
        Json event{{"kind", "recording"}, {"axis", nullptr}, {"tick", source_.tick()}};
        event["recording"] = recording.view();
        publish(event);
      }) {}

Json Scope::greeting() const { return {{"version", version()}, {"start", run_name()}, {"tick", source_.tick()}}; }

void Scope::publish(const Json& event) {
  if (sessions_.empty()) return;
  const std::string message = to_text({{"event", event}});
  for (StreamSession* session : sessions_) session->send_event(message);
}

void Scope::remove(StreamSession& session) { std::erase(sessions_, &session); }

void Scope::advance(std::int64_t end) {
  recordings_.take(end);
  if (sessions_.empty()) return;
  const WallTime wall = std::chrono::steady_clock::now();
  for (StreamSession* session : sessions_) session->send_samples(end, wall);
}

bool Scope::waits_for_readers(WallTime now) {
  return std::any_of(sessions_.begin(), sessions_.end(),
                     [now](StreamSession* session) { return session->is_waited_for(now); });
}

void Scope::attend(WallTime now) {
  for (StreamSession* session : sessions_) session->attend(now);
}

const Scope::Views& Scope::views(WallTime now) {
  if (now - views_made_ < views_live && !views_.clock.empty()) return views_;
  views_made_ = now;
  views_.axes.clear();
  for (const Json& view : source_.views()) views_.axes.push_back(to_text(view));
  views_.clock = to_text(source_.clock());
  return views_;
}

}  // namespace servodrome::api
