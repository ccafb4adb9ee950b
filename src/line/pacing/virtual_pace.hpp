#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>

#include "line/bus_logs.hpp"
#include "line/line.hpp"

namespace servodrome::line {

// Lets virtual time pass by itself, at the speed that Line::set_speed chose.
class VirtualPace {
 public:
  // All must outlive this object.
  VirtualPace(boost::asio::io_context& io, Line& line, BusLogs& logs) : line_(line), logs_(logs), timer_(io) {}

  // Adopts the speed of the line, which may have changed.
  void follow();

 private:
  void let_time_pass();

  Line& line_;
  BusLogs& logs_;
  boost::asio::steady_timer timer_;
  double speed_ = 0;
  std::chrono::steady_clock::time_point advanced_at_{};
};

}  // namespace servodrome::line
