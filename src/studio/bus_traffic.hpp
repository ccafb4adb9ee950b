#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "line/traffic.hpp"
#include "links/heard_clients.hpp"

namespace servodrome::studio {

// What passes on a bus that another thread uses, while it is wanted: kept until it is fetched.
class BusTraffic {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t most_bytes = std::size_t{1} << 20U;  // that wait to be fetched; the oldest go

  // `type`: "can", "ethercat" or "rs485"; `link` as --bus has it. `start`: of the frames' time.
  BusTraffic(const std::string& type, const std::string& link, Clock::time_point start);
  BusTraffic(const BusTraffic&) = delete;
  BusTraffic& operator=(const BusTraffic&) = delete;

  // For the clients of the bus; of its thread. This outlives them.
  links::Heard heard();

  // ---- Any thread ----
  void want(bool on);
  // All that has come, into `ring`. Of CAN, `sender` is 0 for what this program sent, else 100h and the node-ID in the
  // identifier.
  void fetch(line::TrafficRing& ring);

 private:
  void hear(bool sent, std::span<const std::uint8_t> bytes);
  void add(line::Time at, bool sent, std::uint32_t sender, std::span<const std::uint8_t> head,
           std::span<const std::uint8_t> rest);
  void end_answer();

  line::TrafficKind kind_;
  Clock::time_point start_;
  std::atomic<int> wanted_{0};  // by so many
  std::mutex mutex_;
  line::TrafficRing waiting_{most_bytes};
  line::TrafficRing::Cursor cursor_{1, 0};
  // An answer on a serial line or over TCP comes in pieces.
  std::vector<std::uint8_t> answer_;
  line::Time answer_began_{};
  line::Time answer_went_on_{};
};

}  // namespace servodrome::studio
