#pragma once

#include <memory>
#include <string>
#include <vector>

#include "line/bench/routes.hpp"
#include "line/bench/scope/recordings.hpp"
#include "line/bench/scope/stream_session.hpp"

namespace servodrome::line::bench {

// Streams and recordings of axes. The owner tells it by advance() how far the source's time has come.
class Scope {
 public:
  // The source outlives it.
  explicit Scope(Source& source);
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;

  Source& source() { return source_; }
  Recordings& recordings() { return recordings_; }

  // What a client is told first: the program's version, an identifier of this run, the present tick.
  Json greeting() const;
  // Tells all clients: {"event": event}.
  void publish(const Json& event);

  // All values before tick `end` are there.
  void advance(std::int64_t end);

  void add(StreamSession& session) { sessions_.push_back(&session); }
  void remove(StreamSession& session);
  bool anyone() const { return !sessions_.empty(); }
  // Some client is still busy reading what it was sent.
  bool waits_for_readers(WallTime now);
  // To be called now and then, some 50 times a second of the clock on the wall, as long as there are sessions.
  void attend(WallTime now);

  // Axes and clock as the API shows them, made once for all who ask at about the same time.
  struct Views {
    std::vector<std::string> axes;
    std::string clock;
  };
  const Views& views(WallTime now);

 private:
  Source& source_;
  std::string start_;
  Recordings recordings_;
  std::vector<StreamSession*> sessions_;
  Views views_;
  WallTime views_made_{};
};

// Routes of recordings; the context is the Scope.
std::span<const Route> recording_routes();

}  // namespace servodrome::line::bench
