#pragma once

#include <functional>
#include <memory>
#include <span>

#include "host/scope/channel.hpp"

namespace servodrome::host {
class Bus;
class SdoClient;
class EthercatMaster;
class EthercatSlave;
struct FoundSlave;
}  // namespace servodrome::host

namespace servodrome::host::scope {

// The channels' values, once.
struct Sample {
  std::span<const Time> times;     // of the bus's clock: one for each group of channels
  std::span<const double> values;  // one for each channel
};

// Brings the values of channels of one drive, again and again, whenever the caller waits with objects().
class Sampler {
 public:
  // Called with each sample. It does not wait.
  using Sink = std::function<void(const Sample&)>;

  virtual ~Sampler() = default;

  const std::vector<Channel>& channels() const { return channels_; }
  // Which of a sample's times is the channel's.
  const std::vector<std::size_t>& groups() const { return groups_; }
  std::size_t group_count() const { return group_count_; }

  // Replaces the one before; {}: none, nothing is sampled.
  void on_sample(Sink sink) {
    sink_ = std::move(sink);
    missed_ = 0;
    begin();
  }

  // The drive's objects, to wait with and to move the axis meanwhile.
  virtual ObjectClient& objects() = 0;
  // Throws HostError if the data have ceased to come.
  virtual void check() const {}
  // Puts back what was changed for the purpose. Throws HostError if the drive does not take it. The destructor does the
  // same and says nothing.
  virtual void close() {}

  // From sample to sample; 0: as fast as the drive answers.
  Time period() const { return period_; }
  // Samples that were due and did not come, since on_sample().
  std::uint64_t missed() const { return missed_; }
  // In words: "TPDOs on SYNC", "SDO".
  const std::string& way() const { return way_; }
  // What people should know: why it is not faster, what was left changed. Empty: nothing.
  const std::string& remark() const { return remark_; }
  void set_remark(std::string remark) { remark_ = std::move(remark); }

 protected:
  Sampler(std::vector<Channel> channels, Time period, std::string way)
      : channels_(std::move(channels)), period_(period), way_(std::move(way)) {}

  virtual void begin() {}
  bool is_wanted() const { return static_cast<bool>(sink_); }
  void deliver(const Sample& sample) const { sink_(sample); }

  std::vector<Channel> channels_;
  std::vector<std::size_t> groups_;
  std::size_t group_count_ = 0;
  Time period_;
  std::uint64_t missed_ = 0;

 private:
  Sink sink_;
  std::string way_;
  std::string remark_;
};

struct SamplerOptions {
  // Nothing: the bus's usual one, or as fast as the drive answers.
  std::optional<Time> period{};
  bool polls = false;  // objects are read, whatever else would be possible
  bool moves = false;  // the caller will move the axis by objects(): on EtherCAT it goes to OP
  bool distributed_clocks = false;
};

// The quickest way that disturbs no other master. All arguments but the channels, which are complete, outlive the
// sampler. They throw HostError if the drive does not answer, or the period is none that the bus can do.

// TPDOs on SYNC if they hold the channels and no other master is heard; else SDO.
std::unique_ptr<Sampler> open_can_sampler(Bus& bus, SdoClient& sdo, std::vector<Channel> channels,
                                          const SamplerOptions& options = {});
// Process data if they can hold the channels and the slave is not in another master's hands; else SDO. `line`: all
// slaves of the segment.
std::unique_ptr<Sampler> open_ethercat_sampler(EthercatMaster& master, std::span<const FoundSlave> line,
                                               EthercatSlave& slave, std::vector<Channel> channels,
                                               const SamplerOptions& options = {});
// By reading objects, on any bus. `way`: what that is called there.
std::unique_ptr<Sampler> open_polled_sampler(ObjectClient& objects, std::vector<Channel> channels,
                                             const SamplerOptions& options = {}, std::string way = "polled");

}  // namespace servodrome::host::scope
