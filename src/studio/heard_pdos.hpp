#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "canopen/frame.hpp"
#include "links/heard_clients.hpp"
#include "studio/bus_samples.hpp"
#include "tools/sampling/can_process_data.hpp"

namespace servodrome::studio {

// Observes the PDOs on a CAN bus: hands the TPDOs that the drives send to the samples that want them, and notices
// whether another master uses process data.
class HeardPdos {
 public:
  // `start`: time of tick 0.
  explicit HeardPdos(links::Time start) : start_(start) {}
  HeardPdos(const HeardPdos&) = delete;
  HeardPdos& operator=(const HeardPdos&) = delete;

  // Passes all messages on to `next` and observes them. Called in the thread of the bus; this object must outlive the
  // clients of the bus.
  links::Heard heard(links::Heard next);

  // --- Callable from any thread
  void add(const std::shared_ptr<BusSamples>& samples);
  struct Use {
    std::optional<master::sampling::UseOfPdos> by_others{};  // the latest sign of another master
    links::Time listened{};                                  // since forget()
    std::optional<links::Time> sync_period{};                // if SYNC is being sent
  };
  Use use(links::Time now) const;
  // True if the drives have sent this TPDO, or the node is known to be operational, a short time ago.
  bool is_sent(std::uint32_t can_id, links::Time now) const;
  bool is_operational(std::uint8_t node_id, links::Time now) const;
  // This program itself has used process data: only signs from now on count.
  void forget(links::Time now);

  // A frame at the time `now`.
  void hear(bool sent, const canopen::Frame& frame, links::Time now);

 private:
  static constexpr links::Time longest_memory = std::chrono::seconds(10);  // of a sign
  static constexpr links::Time longest_sync_period = std::chrono::seconds(1);

  void hear_sync(links::Time now);

  links::Time start_;
  mutable std::mutex mutex_;
  std::vector<std::weak_ptr<BusSamples>> samples_;
  std::optional<master::sampling::UseOfPdos> sign_;
  links::Time sign_at_{};
  links::Time forgot_{};
  std::array<links::Time, master::sampling::after_pdos - master::sampling::first_pdo> pdo_at_{};  // 0: not heard
  std::array<links::Time, 128> operational_at_{};                                                 // of each node
  std::optional<links::Time> last_sync_;
  links::Time sync_period_{};  // smoothed; 0: unknown
};

}  // namespace servodrome::studio
