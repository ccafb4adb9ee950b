#pragma once

#include <exception>
#include <memory>
#include <utility>

namespace servodrome::links {

// What one connection waits for: an exception that leaves `handler` ends that connection, by its fail(error), and no
// other. A connection that is not is_open() any more is not called.
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
