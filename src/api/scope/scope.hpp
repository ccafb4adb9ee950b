#pragma once

#include <memory>
#include <string>
#include <vector>

#include "api/routes.hpp"
#include "api/scope/recordings.hpp"
#include "api/scope/stream_session.hpp"

namespace servodrome::api {

// Streams and recordings of axes. The owner calls advance() when the source's time has advanced.
class Scope {
 public:
  // The source must outlive it.
  explicit Scope(Source& source);
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;

  Source& source() { return source_; }
  Recordings& recordings() { return recordings_; }

  // The first message to a client: the program's version, an identifier of this run, the present tick.
  Json greeting() const;
  // Sends {"event": event} to all clients.
  void publish(const Json& event);

  // Processes all values before tick `end`, which must be available.
  void advance(std::int64_t end);

  void add(StreamSession& session) { sessions_.push_back(&session); }
  void remove(StreamSession& session);
  bool anyone() const { return !sessions_.empty(); }
  // Returns true if a client is still receiving the samples sent to it.
  bool waits_for_readers(WallTime now);
  // Must be called periodically while there are sessions, about 50 times per second of wall-clock time.
  void attend(WallTime now);

  // The axes and the clock as the API shows them, cached for requests at about the same time.
  struct Views {
    std::vector<std::string> axes;
    std::string clock;
  };
  const Views& views(WallTime now);

 private:
  Source& source_;
  Recordings recordings_;
  std::vector<StreamSession*> sessions_;
  Views views_;
  WallTime views_made_{};
};

// Routes of recordings; the context is the Scope.
std::span<const Route> recording_routes();

}  // namespace servodrome::api
