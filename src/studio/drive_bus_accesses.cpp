#include <algorithm>

#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"
#include "studio/drive_bus.hpp"

// The accesses of a bus to its drives: those of callers, the samples and the polls of the states.
namespace servodrome::studio {
namespace {

using namespace std::chrono_literals;

constexpr auto usual_answer = 20ms;  // a drive that takes longer lets the bus access others meanwhile
constexpr std::uint16_t fault_or_warning = 1U << 3 | master::status_bit::warning;
constexpr DriveBus::Clock::time_point poll_at_once{};

// Communication and mapping of PDOs.
bool is_pdo(master::ObjectAddress object) { return object.index >= 0x1400 && object.index < 0x1C00; }

bool is_store_command(master::ObjectAddress object, std::string_view product) {
  constexpr std::uint16_t store_parameters = 0x1010;
  const auto commands = catalogue::product_of(product).rules.store;
  return object.index == store_parameters ||
         std::any_of(commands.begin(), commands.end(), [&](const auto& command) { return command.object == object; });
}

}  // namespace

JobError DriveBus::error_of(const std::exception& error, const std::string& where) {
  if (const auto* known = dynamic_cast<const master::MasterError*>(&error)) {
    return {known->happened(), known->where(), known->remedy()};
  }
  return {error.what(), where, "check that the bus and its drives have power and are connected"};
}

// While it lives, an access to `drive` is under way. If the drive does not answer at once, a CAN bus carries out the
// accesses to its other drives meanwhile: a drive that has no power delays no stop of its neighbours. If `aborted` is
// not nullptr, an urgent access to the drive itself ends the wait with a MasterError and sets `*aborted`.
class DriveBus::Asking {
 public:
  Asking(DriveBus& bus, std::size_t drive, bool* aborted = nullptr)
      : bus_(bus), drive_(drive), aborted_(aborted), outer_(std::exchange(bus.asking_, this)) {}
  ~Asking() { bus_.asking_ = outer_; }
  Asking(const Asking&) = delete;
  Asking& operator=(const Asking&) = delete;

  bool is_about(std::size_t drive) const { return drive == drive_ || (outer_ != nullptr && outer_->is_about(drive)); }
  bool is_slow() const { return Clock::now() - began_ > usual_answer; }
  bool gives_way() {
    if (aborted_ == nullptr) return false;
    return *aborted_ = *aborted_ || bus_.has_urgent(drive_);
  }

 private:
  DriveBus& bus_;
  std::size_t drive_;
  bool* aborted_;
  Asking* outer_;  // the access during whose wait this one is carried out
  Clock::time_point began_ = Clock::now();
};

std::shared_ptr<Access> DriveBus::next_access() {
  const std::lock_guard lock(mutex_);
  std::erase_if(waiting_, [](const auto& access) { return access->given_up.load(); });
  const auto next = std::find_if(waiting_.begin(), waiting_.end(), [this](const auto& access) {
    const auto& [beside, urgent_only] = choice_;
    if (urgent_only && !access->urgent) return false;
    if (asking_ != nullptr && (asking_->is_about(access->drive) || silent_[access->drive])) return false;
    return beside == nullptr || access->drive != beside->drive || !beside->cancelled;
  });
  if (next == waiting_.end()) return nullptr;
  auto access = std::move(*next);
  waiting_.erase(next);
  // After a controlword the last poll no longer shows the state of the drive.
  if (access->writes && access->object.index == 0x6040) state_.drives[access->drive].at = {};
  return access;
}

void DriveBus::note_access(bool answered, Clock::duration took) {
  const std::lock_guard lock(mutex_);
  ++state_.accesses;
  if (!answered) {
    ++state_.failed;
    return;
  }
  constexpr double weight = 0.05;
  state_.access_s += weight * (links::to_seconds(took) - state_.access_s);
}

// The drive has not answered an access. Each access to a silent drive takes its whole timeout, so the waiting reads get
// the same error without an attempt. Writes, among them stops, are attempted: an answer may be lost although the drive
// has received the command.
void DriveBus::note_silence(std::size_t drive, const JobError& problem, const std::exception_ptr& error) {
  if (!silent_[drive]) next_poll_[drive] = poll_at_once;  // it finds the reason, or shows that only one answer was lost
  silent_[drive] = true;
  const std::lock_guard lock(mutex_);
  state_.drives[drive].problem = problem;
  std::erase_if(waiting_, [&](const auto& access) {
    if (access->drive != drive || access->writes) return false;
    access->error = error;
    access->done = true;
    return true;
  });
}

// Called while the bus waits for an answer; returns true if the wait must end. Carries out one access at a time, so
// that the answer is not delayed by many.
bool DriveBus::look_around(OpenBus& open) {
  Asking* const asking = asking_;
  if (asking == nullptr) return false;  // a work item waits: it serves others at times of its own
  if (asking->gives_way()) return true;
  if (!asking->is_slow()) return false;
  if (const auto access = next_access()) carry_out(open, access);
  return false;
}

// An error of the object goes to the caller; an error of the bus is thrown, because it concerns all callers.
void DriveBus::carry_out(OpenBus& open, const std::shared_ptr<Access>& access) {
  const auto began = Clock::now();
  master::ObjectClient& objects = *open.drives()[access->drive];
  bool aborted = false;
  const Asking asking(*this, access->drive, access->writes ? nullptr : &aborted);
  std::optional<master::LimitedWait> limited;
  if (access->longest_wait) limited.emplace(objects, *access->longest_wait);
  try {
    if (access->writes && is_pdo(access->object) && recorder_.has(access->drive)) {
      throw master::ObjectError("a recording has set up the PDOs of the drive", objects.where(),
                                "wait for its end, stop it or delete it", false, true);
    }
    if (access->writes && is_store_command(access->object, plan_.drives[access->drive].product)) {
      store(open, *access);
    } else if (access->writes) {
      objects.download(access->object, access->bytes);
    } else {
      access->bytes = objects.upload(access->object);
      access->size_is_known = objects.size_is_known();
    }
    note_access(true, Clock::now() - began);
    access->done = true;
  } catch (const master::ObjectError& error) {
    note_access(error.answered(), Clock::now() - began);
    if (!error.answered()) note_silence(access->drive, error_of(error, plan_.link), std::current_exception());
    access->error = std::current_exception();
    access->done = true;
  } catch (const std::exception&) {
    if (aborted) {  // it is read again after the urgent ones
      const std::lock_guard lock(mutex_);
      waiting_.insert(first_ordinary(), access);
      return;
    }
    access->error = std::current_exception();
    access->done = true;
    throw;
  }
}

// Lets the drive store its own values. For that the values of the supervision and of a recording are removed first. The
// supervision begins again afterwards; the recording gets no more samples.
void DriveBus::store(OpenBus& open, const Access& access) {
  if (recorder_.has(access.drive)) recorder_.end();
  open.release(access.drive);
  std::exception_ptr refusal;
  try {
    open.drives()[access.drive]->download(access.object, access.bytes);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) throw;  // the supervision begins again when the drive answers
    refusal = std::current_exception();
  }
  open.back(access.drive);
  if (refusal) std::rethrow_exception(refusal);
}

bool DriveBus::sample_one(OpenBus& open) {
  std::shared_ptr<BusSamples> most_due;
  const auto began = Clock::now();
  const std::int64_t now = tick_of(began);
  {
    const std::lock_guard lock(mutex_);
    for (const auto& weak : sampled_) {
      auto samples = weak.lock();
      if (!samples || samples->wanted() > now || state_.drives[samples->drive()].problem) continue;
      if (!most_due || samples->wanted() < most_due->wanted()) most_due = std::move(samples);
    }
  }
  if (!most_due) return false;
  bool aborted = false;
  const Asking asking(*this, most_due->drive(), &aborted);
  try {
    const std::vector<std::byte> bytes = open.drives()[most_due->drive()]->upload(most_due->object());
    const auto ended = Clock::now();
    most_due->note(tick_of(began + (ended - began) / 2), bytes);
    note_access(true, ended - began);
  } catch (const master::ObjectError& error) {
    note_access(error.answered(), Clock::now() - began);
    if (!error.answered()) next_poll_[most_due->drive()] = {};
    most_due->skip(tick_of(Clock::now()));
  } catch (const master::MasterError&) {
    if (!aborted) throw;
    most_due->skip(tick_of(Clock::now()));
  }
  return true;
}

// The quick stop that `stop_when_back` asked for. It stays due until the drive has answered.
void DriveBus::stop_now(std::size_t drive, master::ObjectClient& objects) {
  try {
    objects.write<std::uint16_t>(0x6040, 0, master::command_word::quick_stop);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) throw;
  }
  const std::lock_guard lock(mutex_);
  stop_when_back_[drive] = false;
}

bool DriveBus::has_urgent(std::size_t drive) const {
  const std::lock_guard lock(mutex_);
  return std::any_of(waiting_.begin(), waiting_.end(),
                     [drive](const auto& access) { return access->urgent && access->drive == drive; });
}

// Reads the state of one drive; returns false if none is due.
bool DriveBus::poll_one(OpenBus& open, bool silent_too) {
  const auto began = Clock::now();
  std::size_t i = next_poll_.size();
  for (std::size_t k = 0; k < next_poll_.size(); ++k) {
    if (next_poll_[k] > began || (silent_[k] && !silent_too && next_poll_[k] != poll_at_once)) continue;
    if (i == next_poll_.size() || next_poll_[k] < next_poll_[i]) i = k;
  }
  if (i == next_poll_.size()) return false;
  master::ObjectClient& objects = *open.drives()[i];
  DriveState seen;
  bool stop = false;
  {
    const std::lock_guard lock(mutex_);
    seen = state_.drives[i];
    stop = stop_when_back_[i];
  }
  bool aborted = false;
  try {
    {
      const Asking asking(*this, i, &aborted);
      if (stop) stop_now(i, objects);
      if (silent_[i] || open.has_restarted(i)) open.back(i);
      silent_[i] = false;
      seen.status = axes_[i].status();
      seen.controlword = objects.read_if_present<std::uint16_t>(0x6040).value_or(0);
      const bool asks_why = (seen.status.statusword & fault_or_warning) != 0;
      seen.error_code = asks_why ? objects.read_if_present<std::uint16_t>(0x603F).value_or(0) : std::uint16_t{0};
      seen.watch = open.watch_of(i);
    }
    if (recorder_.must_restore(i)) recorder_.restore(open, i, [&] { serve_urgent(open); });
    seen.problem.reset();
  } catch (const master::ObjectError& error) {
    seen.problem = error_of(error, plan_.link);
    silent_[i] = silent_[i] || !error.answered();
  } catch (const master::MasterError&) {
    if (!aborted) throw;
    return true;  // it is due again at once
  }
  const auto ended = Clock::now();
  seen.at = ended;
  // Polling uses at most a third of the time of the bus.
  const Clock::duration usual = std::max<Clock::duration>(usual_poll, 2 * (ended - began));
  next_poll_[i] = ended + (seen.problem ? Clock::duration(silent_poll) : usual);
  const std::lock_guard lock(mutex_);
  state_.drives[i] = seen;
  return true;
}

}  // namespace servodrome::studio
