#include "api/scope/stream_session.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "api/body_reader.hpp"
#include "api/scope/scope.hpp"
#include "drive/hardware.hpp"

namespace servodrome::api {

StreamSession::StreamSession(Scope& scope, Outbox& outbox) : scope_(scope), outbox_(outbox) {
  outbox_.text(to_text({{"hello", scope_.greeting()}}));
  scope_.add(*this);
}

StreamSession::~StreamSession() { scope_.remove(*this); }

void StreamSession::give_up(const std::string& reason) {
  given_up_ = true;
  subscriptions_.clear();
  watch_period_ = {};
  outbox_.close(reason);
}

void StreamSession::receive(std::string_view message, WallTime now) {
  if (given_up_) return;
  if (now - counting_since_ > std::chrono::seconds(1)) {
    counting_since_ = now;
    messages_ = 0;
  }
  if (++messages_ > most_messages) {
    give_up(fmt::format("more than {} messages in a second", most_messages));
    return;
  }
  refers_to_.reset();
  try {
    obey(std::string(message));
  } catch (const ApiError& error) {
    Json answer = Json::parse(error_response(error).body);
    if (refers_to_) answer["id"] = *refers_to_;
    outbox_.text(to_text(answer));
  }
}

void StreamSession::obey(const std::string& message) {
  BodyReader reader(message);
  if (reader.object().size() != 1) {
    throw ApiError{400, "a message must have one key", "message",
                   R"(send {"subscribe": ...}, {"unsubscribe": ...} or )"
                   R"({"watch": ...})"};
  }
  constexpr std::uint64_t largest_id = UINT32_MAX;
  if (reader.has("subscribe")) {
    BodyReader part("subscribe", reader.required("subscribe"));
    part.required("id");
    refers_to_ = part.integer("id", largest_id);
    subscribe(part);
  } else if (reader.has("unsubscribe")) {
    BodyReader part("unsubscribe", reader.required("unsubscribe"));
    part.required("id");
    refers_to_ = part.integer("id", largest_id);
    part.finish();
    std::erase_if(subscriptions_, [this](const Subscription& its) { return its.id() == *refers_to_; });
    outbox_.text(to_text({{"unsubscribed", {{"id", *refers_to_}}}}));
  } else if (reader.has("watch")) {
    BodyReader part("watch", reader.required("watch"));
    watch(part);
  }
  reader.finish();
}

void StreamSession::subscribe(BodyReader& reader) {
  const auto id = static_cast<std::uint32_t>(*refers_to_);
  const std::vector<NamedChannel> channels = read_channels(scope_.source(), reader.required("channels"));
  constexpr auto most = static_cast<double>(drive::ticks_per_second);
  const std::int64_t stride = scope_.source().stride_of(reader.number("rate_hz", 1, most).value_or(1000), channels);
  reader.finish();
  const auto same = std::find_if(subscriptions_.begin(), subscriptions_.end(),
                                 [id](const Subscription& its) { return its.id() == id; });
  if (same == subscriptions_.end() && subscriptions_.size() == most_subscriptions) {
    throw ApiError{409, fmt::format("a connection has at most {} subscriptions", most_subscriptions), "subscribe",
                   "unsubscribe one, or subscribe with its id to replace it"};
  }
  std::vector<std::shared_ptr<Samples>> taps;
  for (const NamedChannel& channel : channels) taps.push_back(channel.open(stride));
  Subscription subscription(id, std::move(taps));
  const Json answer{{"id", id},
                    {"rate_hz", most / static_cast<double>(stride)},
                    {"tick", subscription.first_tick()},
                    {"channels", views_of(channels)}};
  if (same != subscriptions_.end()) {
    *same = std::move(subscription);
  } else {
    subscriptions_.push_back(std::move(subscription));
  }
  outbox_.text(to_text({{"subscribed", answer}}));
}

void StreamSession::watch(BodyReader& reader) {
  reader.required("axes");
  const double rate_hz = reader.number("axes", 0, most_watches).value_or(0);
  reader.finish();
  constexpr double longest_period_s = 3600;
  watch_period_ = rate_hz > 0 ? std::chrono::nanoseconds(std::llround(1e9 * std::min(1 / rate_hz, longest_period_s)))
                              : std::chrono::nanoseconds();
  next_watch_ = {};
  sent_views_.clear();
  sent_clock_.clear();
}

// Returns true if so many bytes wait for the client that no more samples and views are sent to it.
bool StreamSession::overloaded(WallTime now) {
  if (outbox_.queued() < most_queued) {
    full_since_.reset();
    return false;
  }
  if (!full_since_) full_since_ = now;
  if (now - *full_since_ > longest_full) give_up("the client is too slow");
  return true;
}

bool StreamSession::is_waited_for(WallTime now) {
  const std::size_t queued = outbox_.queued();
  if (given_up_ || queued <= Subscription::easy) {
    reads_since_.reset();
    return false;
  }
  if (!reads_since_ || queued < least_queued_) {
    reads_since_ = now;
    least_queued_ = queued;
  }
  return now - *reads_since_ < patience;
}

void StreamSession::send_samples(std::int64_t end, WallTime now) {
  if (given_up_) return;
  const bool leave_out = overloaded(now);
  for (Subscription& subscription : subscriptions_) {
    if (leave_out) {
      subscription.skip(end);
      continue;
    }
    if (auto frame = subscription.take(end)) outbox_.binary(std::move(*frame));
    subscription.adapt(outbox_.queued(), now);
  }
}

// A client must not miss an event. If the client cannot receive it, the session ends, and the client can connect again.
void StreamSession::send_event(const std::string& message) {
  if (given_up_) return;
  if (outbox_.queued() >= 2 * most_queued) {
    give_up("the client is too slow");
  } else {
    outbox_.text(message);
  }
}

void StreamSession::attend(WallTime now) {
  if (given_up_ || overloaded(now)) return;
  if (watch_period_.count() != 0 && now >= next_watch_) {
    next_watch_ = std::max(next_watch_ + watch_period_, now);
    if (outbox_.queued() <= Subscription::easy) send_views(now);
  }
}

void StreamSession::send_views(WallTime now) {
  const Scope::Views& views = scope_.views(now);
  std::string changed;
  sent_views_.resize(views.axes.size());
  for (std::size_t i = 0; i < views.axes.size(); ++i) {
    if (views.axes[i] == sent_views_[i]) continue;
    sent_views_[i] = views.axes[i];
    changed += (changed.empty() ? "" : ",") + views.axes[i];
  }
  if (changed.empty() && views.clock == sent_clock_) return;
  sent_clock_ = views.clock;
  outbox_.text(fmt::format(R"({{"axes":[{}],"clock":{}}})", changed, views.clock));
}

}  // namespace servodrome::api
