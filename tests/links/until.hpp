#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>

namespace servodrome::links::test {

// Runs the io_context, and `step` after each handler, until the condition holds. Returns false after a minute: the test
// has failed.
inline bool run_until(
    boost::asio::io_context& io, const std::function<bool()>& condition, const std::function<void()>& step = [] {}) {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > give_up) return false;
    io.restart();
    io.run_one_for(std::chrono::milliseconds(5));
    step();
  }
  return true;
}

}  // namespace servodrome::links::test
