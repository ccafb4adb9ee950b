#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "axis/cyclic/cyclic_bus.hpp"
#include "studio/bus_samples.hpp"

namespace servodrome::studio {

// Hands the inputs of each cycle of a bus to the samples that want them. All drives of a cycle have the same time. A
// cycle without the inputs of a drive is a missed sample.
class CycleSampler {
 public:
  // `start`: time of tick 0, in the time of the cycles.
  explicit CycleSampler(master::Time start) : start_(start) {}
  CycleSampler(const CycleSampler&) = delete;
  CycleSampler& operator=(const CycleSampler&) = delete;

  // --- Callable from any thread
  // Ticks between two cycles that have this object among the inputs of the drive; nullopt: it is not there, or there is
  // no cycle.
  std::optional<std::int64_t> period_of(std::size_t drive, master::ObjectAddress object) const;
  // All of them get the values of the same cycles, from the next one on.
  void add(std::span<const std::shared_ptr<BusSamples>> samples);
  // Number of cycles so far that have brought the inputs of the first drive of the bus.
  std::uint64_t count() const { return count_; }
  // No cycle brings values while the result lives, so that the rows of all samples end with the same cycle.
  std::unique_lock<std::mutex> between_cycles() const { return std::unique_lock(mutex_); }

  // --- In the thread of the bus
  // Samples from the cycles of `bus` (nullptr: from none) as long as this object exists.
  class Attachment {
   public:
    Attachment(CycleSampler& sampler, master::CyclicBus* bus) : sampler_(sampler) { sampler_.attach(bus); }
    ~Attachment() { sampler_.attach(nullptr); }
    Attachment(const Attachment&) = delete;
    Attachment& operator=(const Attachment&) = delete;

   private:
    CycleSampler& sampler_;
  };

  // `members`: the drive behind each image of the bus; empty: the drives in their order.
  void attach(master::CyclicBus* bus, std::vector<std::size_t> members = {});

 private:
  struct Channel {
    std::weak_ptr<BusSamples> samples;
    std::size_t member = 0;                        // of the present bus
    std::optional<master::ProcessObject> place{};  // among its inputs
  };

  std::optional<std::size_t> member_of(std::size_t drive) const;
  void find(Channel& channel);
  void take();

  master::Time start_;
  mutable std::mutex mutex_;
  master::CyclicBus* bus_ = nullptr;
  std::vector<std::size_t> members_;
  std::vector<Channel> channels_;
  std::atomic<std::uint64_t> count_{0};
};

}  // namespace servodrome::studio
