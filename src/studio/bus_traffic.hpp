#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "line/traffic.hpp"
#include "links/heard_clients.hpp"

namespace servodrome::studio {

// Records the traffic of a bus that another thread uses, while a reader wants it, and keeps it until it is fetched.
class BusTraffic {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t most_bytes = std::size_t{1} << 20U;  // capacity; the oldest frames are dropped

  // `type`: "can", "ethercat" or "rs485". `link`: as in --bus. `start`: origin of the frames' times.
  BusTraffic(const std::string& type, const std::string& link, Clock::time_point start);
  BusTraffic(const BusTraffic&) = delete;
  BusTraffic& operator=(const BusTraffic&) = delete;

  // Callback for the clients of the bus, called in the thread of the bus. This object must outlive them.
  links::Heard heard();

  // ---- Callable from any thread ----
  void want(bool on);
  // Moves all waiting frames into `ring`. On CAN, `sender` is 0 for frames of this program, else 100h | the node-ID in
  // the identifier.
  void fetch(line::TrafficRing& ring);

 private:
  void hear(bool sent, std::span<const std::uint8_t> bytes);
  void add(line::Time at, bool sent, std::uint32_t sender, std::span<const std::uint8_t> head,
           std::span<const std::uint8_t> rest);
  void end_answer();

  line::TrafficKind kind_;
  Clock::time_point start_;
  std::atomic<int> wanted_{0};  // number of readers that want the traffic
  std::mutex mutex_;
  line::TrafficRing waiting_{most_bytes};
  line::TrafficRing::Cursor cursor_{1, 0};
  // An answer on a serial line or over TCP arrives in pieces, collected here.
  std::vector<std::uint8_t> answer_;
  line::Time answer_began_{};
  line::Time answer_went_on_{};
};

}  // namespace servodrome::studio
