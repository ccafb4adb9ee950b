#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/scope/outbox.hpp"
#include "api/scope/subscription.hpp"

namespace servodrome::api {

class Scope;
class BodyReader;

// A session with one client of /api/v1/stream: receives its messages and sends what they request. docs/bench-api.md
// describes the messages.
class StreamSession {
 public:
  static constexpr std::size_t most_subscriptions = 8;
  static constexpr std::size_t largest_message = 16 * 1024;       // of a client, in bytes
  static constexpr unsigned most_messages = 200;                  // of a client, per second
  static constexpr std::size_t most_queued = 4 * 1024 * 1024;     // limit of bytes that wait for a client
  static constexpr auto longest_full = std::chrono::seconds(10);  // at that limit, before the session ends
  static constexpr auto patience = std::chrono::seconds(1);       // for a client that reads nothing (is_waited_for)
  static constexpr double most_watches = 50;                      // views per second

  // Sends the greeting. Both arguments must outlive the session.
  StreamSession(Scope& scope, Outbox& outbox);
  ~StreamSession();
  StreamSession(const StreamSession&) = delete;
  StreamSession& operator=(const StreamSession&) = delete;

  // Returns true if more bytes wait for the client than Subscription::easy and the client is reading them. Virtual time
  // then waits for the client (backpressure).
  bool is_waited_for(WallTime now);

  // Handles a message of the client. Errors in the message do not throw.
  void receive(std::string_view message, WallTime now);

  // Called by the scope: for the samples before tick `end`, for an event, and periodically by wall-clock time.
  void send_samples(std::int64_t end, WallTime now);
  void send_event(const std::string& message);
  void attend(WallTime now);

 private:
  void obey(const std::string& message);
  void subscribe(BodyReader& reader);
  void watch(BodyReader& reader);
  void send_views(WallTime now);
  bool overloaded(WallTime now);
  void give_up(const std::string& reason);

  Scope& scope_;
  Outbox& outbox_;
  std::vector<Subscription> subscriptions_;
  std::optional<std::uint64_t> refers_to_;  // id in the message that is being carried out
  WallTime counting_since_{};
  unsigned messages_ = 0;
  std::optional<WallTime> full_since_;
  std::chrono::nanoseconds watch_period_{};  // 0: the client watches no axes
  WallTime next_watch_{};
  std::vector<std::string> sent_views_;
  std::string sent_clock_;
  std::optional<WallTime> reads_since_;  // when the queue last reached a new minimum while above `easy`
  std::size_t least_queued_ = 0;
  bool given_up_ = false;
};

}  // namespace servodrome::api
