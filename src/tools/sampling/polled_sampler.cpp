// Sampling by reading objects one request after another, while the caller waits.
#include <algorithm>
#include <exception>

#include "master/forwarded_objects.hpp"
#include "tools/sampling/process_data_sampler.hpp"

namespace servodrome::master::sampling {

namespace {

class PolledSampler final : public Sampler {
 public:
  PolledSampler(std::unique_ptr<Session> session, std::vector<Channel> channels, Time period, std::string way)
      : Sampler(std::move(channels), period, std::move(way)),
        session_(std::move(session)),
        drive_(session_->objects()),
        objects_(*this) {
    std::vector<ObjectAddress> addresses;
    for (const Channel& channel : channels_) addresses.push_back(channel.object);
    groups_.resize(channels_.size());
    for (std::vector<std::size_t>& members : drive_.read_together(addresses)) {
      Request request{.members = std::move(members)};
      for (const std::size_t member : request.members) {
        request.objects.push_back(addresses[member]);
        groups_[member] = requests_.size();
      }
      requests_.push_back(std::move(request));
    }
    group_count_ = requests_.size();
    times_.resize(group_count_);
    values_.resize(channels_.size());
  }

  ObjectClient& objects() override { return objects_; }
  void check() const override {
    if (problem_) std::rethrow_exception(problem_);
  }
  void close() override { session_->close(); }

 private:
  struct Request {
    std::vector<std::size_t> members;  // channel numbers
    std::vector<ObjectAddress> objects{};
  };

  // The drive's objects for the caller; takes samples after accesses and during waits.
  class Objects final : public ForwardedObjects {
   public:
    explicit Objects(PolledSampler& sampler) : ForwardedObjects(sampler.drive_), sampler_(sampler) {}
    std::vector<std::byte> upload(ObjectAddress object) override {
      std::vector<std::byte> bytes = target().upload(object);
      sampler_.poll_if_due();
      return bytes;
    }
    void download(ObjectAddress object, std::span<const std::byte> data) override {
      target().download(object, data);
      sampler_.poll_if_due();
    }
    void wait(Time span) override {
      const Time end = now() + span;
      do {
        if (!sampler_.poll_if_due()) target().wait(std::max(Time{0}, std::min(end, sampler_.next_due()) - now()));
      } while (now() < end);
    }

   private:
    PolledSampler& sampler_;
  };

  void begin() override {
    due_ = drive_.now();
    problem_ = nullptr;
  }
  bool polls() const { return is_wanted() && !problem_; }
  Time next_due() const { return polls() ? due_ : Time::max(); }

  // Returns true if it took a sample. An error ends the sampling, and check() throws it later. It does not end the
  // access of the caller, which may be a stop of the axis.
  bool poll_if_due() {
    if (!polls() || drive_.now() < due_) return false;
    try {
      poll();
      return true;
    } catch (const MasterError&) {
      problem_ = std::current_exception();
      return false;
    }
  }

  void poll() {
    for (std::size_t i = 0; i < requests_.size(); ++i) {
      const Time asked = drive_.now();
      const auto answers = drive_.upload_together(requests_[i].objects);
      times_[i] = asked + (drive_.now() - asked) / 2;
      for (std::size_t k = 0; k < answers.size(); ++k) {
        const std::size_t member = requests_[i].members[k];
        values_[member] = number_of(*channels_[member].type, answers[k]);
      }
    }
    deliver(times_, values_);
    if (period_ <= Time{0}) return;
    // Samples stay due at multiples of the period after the first one. Those that became due during this one are
    // missed.
    due_ += period_;
    const Time late = drive_.now() - due_;
    if (late < period_) return;
    missed_ += static_cast<std::uint64_t>(late / period_);
    due_ += late / period_ * period_;
  }

  std::unique_ptr<Session> session_;
  ObjectClient& drive_;
  Objects objects_;
  std::vector<Request> requests_;
  Time due_{};
  std::exception_ptr problem_;  // of the last sample
  std::vector<Time> times_;
  std::vector<double> values_;
};

// A session with nothing to restore; the caller owns the objects.
class BorrowedObjects final : public Session {
 public:
  explicit BorrowedObjects(ObjectClient& objects) : objects_(objects) {}
  ObjectClient& objects() override { return objects_; }

 private:
  ObjectClient& objects_;
};

}  // namespace

std::unique_ptr<Sampler> make_polled_sampler(std::unique_ptr<Session> session, std::vector<Channel> channels,
                                             Time period, std::string way) {
  return std::make_unique<PolledSampler>(std::move(session), std::move(channels), period, std::move(way));
}

std::unique_ptr<Sampler> open_polled_sampler(ObjectClient& objects, std::vector<Channel> channels,
                                             const SamplerOptions& options, std::string way) {
  return make_polled_sampler(std::make_unique<BorrowedObjects>(objects), std::move(channels),
                             options.period.value_or(Time{0}), std::move(way));
}

}  // namespace servodrome::master::sampling
