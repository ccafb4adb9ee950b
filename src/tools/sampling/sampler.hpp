#pragma once

#include <functional>
#include <memory>
#include <span>

#include "scope/recorder.hpp"
#include "tools/sampling/channel.hpp"

namespace servodrome::master {
class Bus;
class SdoClient;
class EthercatMaster;
class EthercatSlave;
struct FoundSlave;
}  // namespace servodrome::master

namespace servodrome::master::sampling {

// Samples channels of one drive repeatedly, whenever the caller waits with objects().
class Sampler {
 public:
  // Called with each sample, whose times are bus time. It must not block.
  using Sink = std::function<void(const scope::Sample&)>;

  virtual ~Sampler() = default;

  const std::vector<Channel>& channels() const { return channels_; }
  // For each channel the number of its group, which selects the time in a sample.
  const std::vector<std::size_t>& groups() const { return groups_; }
  std::size_t group_count() const { return group_count_; }

  // Sets the receiver of samples, in place of the previous one; {}: sampling stops.
  void on_sample(Sink sink) {
    sink_ = std::move(sink);
    missed_ = 0;
    begin();
  }

  // The drive's objects: the caller waits with them, and may move the axis meanwhile.
  virtual ObjectClient& objects() = 0;
  // Throws MasterError if no data arrive any more.
  virtual void check() const {}
  // Restores what was changed for the sampling. Throws MasterError if the drive refuses. The destructor does the same,
  // but ignores errors.
  virtual void close() {}

  // Time between two samples; 0: as fast as the drive answers.
  Time period() const { return period_; }
  // Samples that were due and not received since on_sample().
  std::uint64_t missed() const { return missed_; }
  // Name of the sampling method: "TPDOs on SYNC", "SDO".
  const std::string& way() const { return way_; }
  // A remark for the user: the reason why sampling is not faster, or the objects that could not be restored. Empty:
  // none.
  const std::string& remark() const { return remark_; }
  void set_remark(std::string remark) { remark_ = std::move(remark); }

 protected:
  Sampler(std::vector<Channel> channels, Time period, std::string way)
      : channels_(std::move(channels)), period_(period), way_(std::move(way)) {}

  virtual void begin() {}
  bool is_wanted() const { return static_cast<bool>(sink_); }
  void deliver(std::span<const Time> times, std::span<const double> values) const { sink_({times, values, missed_}); }

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
  // nullopt: the bus's default, or as fast as the drive answers.
  std::optional<Time> period{};
  bool polls = false;  // reads objects, even if process data are possible
  bool moves = false;  // the caller will move the axis through objects(): on EtherCAT the slave goes to OP
  bool distributed_clocks = false;
};

// Each function chooses the fastest method that does not disturb another master. The channels must be complete; all
// other arguments must outlive the sampler. Throws MasterError if the drive does not answer, or if the bus does not
// support the period.

// TPDOs on SYNC if they can hold the channels and there is no sign of another master; otherwise SDO.
std::unique_ptr<Sampler> open_can_sampler(Bus& bus, SdoClient& sdo, std::vector<Channel> channels,
                                          const SamplerOptions& options = {});
// Process data if they can hold the channels and no other master uses the slave; otherwise SDO. `line`: all slaves of
// the segment.
std::unique_ptr<Sampler> open_ethercat_sampler(EthercatMaster& master, std::span<const FoundSlave> line,
                                               EthercatSlave& slave, std::vector<Channel> channels,
                                               const SamplerOptions& options = {});
// Reads objects, on any bus. `way`: name of the method.
std::unique_ptr<Sampler> open_polled_sampler(ObjectClient& objects, std::vector<Channel> channels,
                                             const SamplerOptions& options = {}, std::string way = "polled");

}  // namespace servodrome::master::sampling
