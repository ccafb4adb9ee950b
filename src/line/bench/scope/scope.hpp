#pragma once

#include <memory>
#include <string>
#include <vector>

#include "line/bench/routes.hpp"
#include "line/bench/scope/axis_monitor.hpp"
#include "line/bench/scope/recordings.hpp"
#include "line/bench/scope/stream_session.hpp"
#include "line/bench/scope/tap_table.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// Who looks at a line while it runs: streams, recordings, and what the line tells by itself. It goes along with the
// line's time and fetches what the taps of the axes have gathered.
class Scope final : private Follower {
 public:
  static constexpr Time period = std::chrono::milliseconds(10);  // of line time between two looks

  // The line outlives it.
  explicit Scope(Line& line);
  ~Scope();
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;

  Line& line() { return line_; }
  TapTable& taps() { return taps_; }
  Recordings& recordings() { return recordings_; }

  // What a client is told first: the program's version, an identifier of this run, the present tick.
  Json greeting() const;
  // Tells all clients: {"event": event}.
  void publish(const Json& event);

  void add(StreamSession& session) { sessions_.push_back(&session); }
  void remove(StreamSession& session);
  bool anyone() const { return !sessions_.empty(); }
  // To be called now and then, some 50 times a second of the clock on the wall, as long as there is anyone.
  void attend(WallTime now);

  // Axes and clock as the API shows them, made once for all who ask at about the same time.
  struct Views {
    std::vector<std::string> axes;
    std::string clock;
  };
  const Views& views(WallTime now);

 private:
  // Follower
  Time next_deadline() const override { return next_look_; }
  void reached(Time now) override;

  Line& line_;
  std::string start_;
  TapTable taps_;
  Recordings recordings_;
  std::vector<std::unique_ptr<AxisMonitor>> monitors_;
  std::vector<StreamSession*> sessions_;
  Time next_look_;
  Views views_;
  WallTime views_made_{};
};

// Routes of recordings; the context is the Scope.
std::span<const Route> recording_routes();

}  // namespace servodrome::line::bench
