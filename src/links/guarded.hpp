#pragma once

#include <exception>
#include <memory>
#include <utility>

namespace servodrome::links {

// Wraps a callback of a connection. If `handler` throws, only this connection ends, by fail(error). If the connection
// is no longer is_open(), `handler` is not called.
template <typename Connection, typename Handler>
auto guarded(std::shared_ptr<Connection> connection, Handler handler) {
  return [connection = std::move(connection), handler = std::move(handler)](const auto&... results) {
    if (!connection->is_open()) return;
    try {
      handler(results...);
    } catch (const std::exception& error) {
      if (connection->is_open()) connection->fail(error);
    }
  };
}

}  // namespace servodrome::links
