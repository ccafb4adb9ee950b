#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "line/line.hpp"

namespace servodrome::line {

// The files that log the buses of a line.
class BusLogs {
 public:
  BusLogs() = default;
  ~BusLogs();
  BusLogs(const BusLogs&) = delete;
  BusLogs& operator=(const BusLogs&) = delete;

  // Logs a bus to a file. The format of a CAN bus is candump, or pcap if the name ends in ".pcap". An EtherCAT segment
  // is always logged as pcap. An RS485 line is logged as text in candump's style, or as pcapng if the name ends in
  // ".pcap" or ".pcapng". "-" is standard output. `epoch` is the wall-clock time of the line's time 0. Throws
  // links::LinkError. If the log fails before the line ends, for example on a full disk, `on_failure` is called once.
  // The bus must outlive this object.
  void add(NamedBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure = {});
  void add(NamedEthercatBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure = {});
  void add(NamedSerialBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure = {});

  void set_epoch(Time epoch);
  void flush();
  // The same, at most ten times per second. `present` never goes back.
  void flush_in_time(std::chrono::steady_clock::time_point present);

 private:
  // The calls that maintain a log and end it.
  struct Log {
    std::function<void(Time)> set_epoch;
    std::function<void()> flush;
    std::function<bool()> failed;
    std::function<void()> detach;
    std::function<void()> on_failure;
  };

  std::vector<Log> logs_;
  std::chrono::steady_clock::time_point next_flush_{};
};

}  // namespace servodrome::line
