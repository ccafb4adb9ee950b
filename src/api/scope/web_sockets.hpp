#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <set>

#include "api/http.hpp"

namespace servodrome::api {

class Scope;
struct Upgrade;

// The clients of /api/v1/stream, at most 32: each is a WebSocket (RFC 6455) with a StreamSession. A client that does
// not answer pings is closed.
class WebSockets {
 public:
  static constexpr std::size_t most_clients = 32;
  static constexpr const char* address = "/api/v1/stream";

  // The scope must outlive it. `on_failure` is called when an exception has ended a connection.
  explicit WebSockets(Scope& scope, std::function<void(const std::exception&)> on_failure = {});
  ~WebSockets();
  WebSockets(const WebSockets&) = delete;
  WebSockets& operator=(const WebSockets&) = delete;

  bool any() const { return !connections_.empty(); }
  // Returns an error response if there is no room for another client, otherwise nothing.
  std::optional<Response> refuse() const;
  void accept(Upgrade&& upgrade);

 private:
  class Connection;

  Scope& scope_;
  std::function<void(const std::exception&)> on_failure_;
  std::set<std::shared_ptr<Connection>> connections_;
};

}  // namespace servodrome::api
