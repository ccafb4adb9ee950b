#include "tools/sampling/process_data_sampler.hpp"

namespace servodrome::master::sampling {

namespace {

class ProcessDataSampler final : public Sampler {
 public:
  ProcessDataSampler(std::unique_ptr<ProcessDataSession> session, std::vector<Channel> channels, unsigned cycles,
                     std::string way)
      : Sampler(std::move(channels), session->bus().period() * cycles, std::move(way)),
        session_(std::move(session)),
        cycles_(cycles),
        values_(channels_.size()) {
    groups_.assign(channels_.size(), 0);
    group_count_ = 1;
    for (const Channel& channel : channels_) {
      const auto place = session_->bus().image(0).input(channel.object);
      if (!place) {
        throw MasterError(fmt_of(channel) + " is not among the process data", session_->objects().where(),
                          "record it by reading objects");
      }
      places_.push_back(*place);
    }
  }
  ~ProcessDataSampler() override { stop(); }

  ObjectClient& objects() override { return session_->objects(); }
  void check() const override { session_->bus().check(); }
  void close() override {
    stop();
    session_->close();
  }

 private:
  static std::string fmt_of(const Channel& channel) { return text_of(channel.object) + " " + channel.name; }

  void stop() { session_->bus().on_cycle({}); }

  void begin() override {
    if (!is_wanted()) return stop();
    last_ = position();
    first_ = true;
    session_->bus().on_cycle([this] { cycle(); });
  }

  // Number of cycles so far, including skipped ones.
  std::uint64_t position() const {
    const CycleCounters counters = session_->bus().counters();
    return counters.cycles + counters.skipped;
  }

  void cycle() {
    const std::uint64_t now = position();
    const std::uint64_t passed = now - last_;
    if (!first_ && passed < cycles_) return;
    const bool fresh = session_->bus().is_fresh(0);
    if (!first_) {
      missed_ += passed / cycles_ - (fresh ? 1 : 0);
      last_ += passed / cycles_ * cycles_;
    } else if (fresh) {
      first_ = false;
      last_ = now;
    }
    if (!fresh) return;
    const Time time = session_->bus().inputs_taken();
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      values_[i] = number_of(*channels_[i].type, places_[i].raw(), places_[i].bits());
    }
    deliver(std::span(&time, 1), values_);
  }

  std::unique_ptr<ProcessDataSession> session_;
  unsigned cycles_;
  std::vector<ProcessObject> places_;
  std::vector<double> values_;
  std::uint64_t last_ = 0;  // position() of the last sample that was due
  bool first_ = true;       // no sample yet
};

}  // namespace

CyclePeriod cycles_of(Time period, Time longest) {
  const auto cycles = static_cast<unsigned>((period + longest - Time{1}) / longest);
  return {.cycle = period / cycles, .cycles = cycles};
}

std::unique_ptr<Sampler> make_process_data_sampler(std::unique_ptr<ProcessDataSession> session,
                                                   std::vector<Channel> channels, unsigned cycles, std::string way) {
  return std::make_unique<ProcessDataSampler>(std::move(session), std::move(channels), cycles, std::move(way));
}

}  // namespace servodrome::master::sampling
