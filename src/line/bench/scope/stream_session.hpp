#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "line/bench/scope/outbox.hpp"
#include "line/bench/scope/subscription.hpp"

namespace servodrome::line::bench {

class Scope;
class BodyReader;

// The conversation with one client of /api/v1/stream: its messages in, and out what it asked for. docs/bench-api.md has
// the messages.
class StreamSession {
 public:
  static constexpr std::size_t most_subscriptions = 8;
  static constexpr std::size_t largest_message = 16 * 1024;       // of a client, in bytes
  static constexpr unsigned most_messages = 200;                  // of a client, in a second
  static constexpr std::size_t most_queued = 4 * 1024 * 1024;     // bytes that wait for a client
  static constexpr auto longest_full = std::chrono::seconds(10);  // that so many wait, before it is given up
  static constexpr auto patience = std::chrono::seconds(1);       // with one that reads nothing, in is_waited_for
  static constexpr double most_watches = 50;                      // views a second

  // Says hello. Both outlive it.
  StreamSession(Scope& scope, Outbox& outbox);
  ~StreamSession();
  StreamSession(const StreamSession&) = delete;
  StreamSession& operator=(const StreamSession&) = delete;

  // More waits for the client than what costs no resolution, and it reads: virtual time can wait for it.
  bool is_waited_for(WallTime now);

  // A message of the client. Never throws for what is in it.
  void receive(std::string_view message, WallTime now);

  // By the scope: the samples before tick `end`, an event, and what is due by the clock on the wall.
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
  std::optional<std::uint64_t> refers_to_;  // id of the message that is being carried out
  WallTime counting_since_{};
  unsigned messages_ = 0;
  std::optional<WallTime> full_since_;
  std::chrono::nanoseconds watch_period_{};  // 0: does not
  WallTime next_watch_{};
  std::vector<std::string> sent_views_;
  std::string sent_clock_;
  std::optional<WallTime> reads_since_;  // when less waited for it than ever since more than a little does
  std::size_t least_queued_ = 0;
  bool given_up_ = false;
};

}  // namespace servodrome::line::bench
