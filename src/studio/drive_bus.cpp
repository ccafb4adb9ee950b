#include "studio/drive_bus.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "api/change_log.hpp"
#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "line/axis.hpp"

namespace servodrome::studio {
namespace {

std::vector<ForeignWrites::Node> nodes_of(const BusPlan& plan) {
  std::vector<ForeignWrites::Node> nodes;
  for (const DrivePlan& drive : plan.drives) nodes.push_back({drive.address, drive.product});
  return nodes;
}

using namespace std::chrono_literals;

constexpr auto idle_time = 1ms;        // sleep when nothing is to be done
constexpr auto time_for_others = 8ms;  // longest time that a work item gives to other accesses at once
constexpr auto usual_answer = 20ms;    // a drive that takes longer lets the bus access others meanwhile
constexpr std::uint16_t fault_or_warning = 1U << 3 | master::status_bit::warning;
constexpr DriveBus::Clock::time_point poll_at_once{};

JobError error_of(const std::exception& error, const std::string& where) {
  if (const auto* known = dynamic_cast<const master::MasterError*>(&error)) {
    return {known->happened(), known->where(), known->remedy()};
  }
  return {error.what(), where, "check that the bus and its drives have power and are connected"};
}

// Restores a value at the end of a block.
template <typename Value>
class Restored {
 public:
  explicit Restored(Value& value) : value_(value), before_(value) {}
  ~Restored() { value_ = before_; }
  Restored(const Restored&) = delete;
  Restored& operator=(const Restored&) = delete;

 private:
  Value& value_;
  Value before_;
};

// Answers an access or work item with the error of the bus.
template <typename Waiting>
void refuse(Waiting& waiting, const JobError& problem) {
  waiting.error = std::make_exception_ptr(master::MasterError(problem.what, problem.where, problem.hint));
  waiting.done = true;
}

// Communication and mapping of PDOs.
bool is_pdo(master::ObjectAddress object) { return object.index >= 0x1400 && object.index < 0x1C00; }

bool is_store_command(master::ObjectAddress object, std::string_view product) {
  constexpr std::uint16_t store_parameters = 0x1010;
  const auto commands = catalogue::product_of(product).rules.store;
  return object.index == store_parameters ||
         std::any_of(commands.begin(), commands.end(), [&](const auto& command) { return command.object == object; });
}

}  // namespace

// While it lives, an access to `drive` is under way. If the drive does not answer at once, a CAN bus carries out the
// accesses to its other drives meanwhile: a drive that has no power delays no stop of its neighbours. With `aborted`,
// an urgent access to the drive itself ends the wait with a MasterError and sets it.
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

DriveBus::DriveBus(BusPlan plan, Clock::time_point start)
    : plan_(std::move(plan)),
      start_(start),
      traffic_(plan_.type, plan_.link, start),
      foreign_(nodes_of(plan_)),
      cycle_(start.time_since_epoch()),
      pdos_(start.time_since_epoch()),
      next_poll_(plan_.drives.size()),
      silent_(plan_.drives.size(), false),
      stop_when_back_(plan_.drives.size(), false) {
  state_.drives.resize(plan_.drives.size());
  for (DriveState& drive : state_.drives) drive.problem = JobError{"the drive has not been read yet", plan_.link, ""};
  thread_ = std::thread(
      [this, opened = std::make_shared<std::unique_ptr<OpenBus>>(plan_.open(heard()))] { run(std::move(*opened)); });
}

links::Heard DriveBus::heard() {
  if (plan_.type != "can") return traffic_.heard();
  pdos_.forget(links::steady_now());
  return foreign_.heard(pdos_.heard(traffic_.heard()));
}

DriveBus::~DriveBus() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  woken_.notify_all();
  thread_.join();
}

bool DriveBus::is_worked_with(std::size_t drive) const {
  const std::lock_guard lock(mutex_);
  const auto is_with = [drive](const auto& work) { return work->drive == drive && !work->beside; };
  return (running_work_ && is_with(running_work_)) || std::any_of(waiting_work_.begin(), waiting_work_.end(), is_with);
}

DriveBus::State DriveBus::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

void DriveBus::submit(std::shared_ptr<Access> access) {
  const std::lock_guard lock(mutex_);
  if (state_.problem) {
    refuse(*access, *state_.problem);
    return;
  }
  if (access->urgent) {
    if (running_work_ && running_work_->drive == access->drive) running_work_->cancelled = true;
    refuse_motion(access->drive);
  }
  const auto place = access->urgent ? first_ordinary() : waiting_.end();
  waiting_.insert(place, std::move(access));
  woken_.notify_all();
}

std::deque<std::shared_ptr<Access>>::iterator DriveBus::first_ordinary() {
  return std::find_if(waiting_.begin(), waiting_.end(), [](const auto& access) { return !access->urgent; });
}

void DriveBus::cancel_motion(std::size_t drive) {
  const std::lock_guard lock(mutex_);
  refuse_motion(drive);
}

// Answers the waiting writes that command a motion of the drive with an error: a stop comes before them.
void DriveBus::refuse_motion(std::size_t drive) {
  const JobError stopped{"a stop of the axis came first", plan_.drives[drive].name,
                         "begin again if the axis shall move"};
  std::erase_if(waiting_, [&](const auto& access) {
    const bool commands = access->writes && !access->urgent && api::ChangeLog::is_motion(access->object.index);
    if (access->drive != drive || !commands) return false;
    refuse(*access, stopped);
    return true;
  });
}

void DriveBus::submit(std::shared_ptr<Work> work) {
  const std::lock_guard lock(mutex_);
  if (state_.problem) {
    refuse(*work, *state_.problem);
    return;
  }
  waiting_work_.push_back(std::move(work));
  woken_.notify_all();
}

void DriveBus::sample(const std::shared_ptr<BusSamples>& samples) {
  if (samples->sampling().by == Sampling::By::cycle) return cycle_.add(samples);
  if (samples->sampling().by == Sampling::By::pdo) return pdos_.add(samples);
  const std::lock_guard lock(mutex_);
  std::erase_if(sampled_, [](const auto& its) { return its.expired(); });
  sampled_.push_back(samples);
}

std::unique_ptr<master::CanCyclicBus> OpenBus::record(const std::vector<master::CanDrive>&, master::Time,
                                                      const std::function<void()>&) {
  throw master::MasterError("there are no TPDOs", "this bus", "use the drive's CAN port");
}

void DriveBus::record(OpenBus& open, const TpdoRecorder::Wish& wish) {
  recorder_.begin(open, wish, [this, &open] { serve_urgent(open); });
}

void DriveBus::serve_urgent(OpenBus& open) {
  const Restored restored(choice_);
  choice_ = {.urgent_only = true};
  while (const auto access = next_access()) carry_out(open, access);
}

void DriveBus::stop_when_back(std::size_t drive) {
  const std::lock_guard lock(mutex_);
  stop_when_back_[drive] = true;
}

std::int64_t DriveBus::tick_of(Clock::time_point time) const { return (time - start_) / line::tick_length; }

void DriveBus::run(std::unique_ptr<OpenBus> open) {
  while (true) {
    try {
      if (open == nullptr) open = plan_.open(heard());
      if (!serve(*open)) return;
      axes_.clear();
      open.reset();
      continue;
    } catch (const std::exception& error) {
      lose(error);
    }
    axes_.clear();
    open.reset();
    std::unique_lock lock(mutex_);
    if (woken_.wait_for(lock, reopen_period, [this] { return ending_; })) return;
  }
}

// Answers all waiting accesses and work items with the error, and marks the state of all drives as unknown.
void DriveBus::lose(const std::exception& error) {
  const std::lock_guard lock(mutex_);
  const JobError problem = error_of(error, plan_.link);
  if (!state_.problem) ++state_.losses;
  state_.problem = problem;
  for (DriveState& drive : state_.drives) drive.problem = problem;
  for (const auto& access : waiting_) refuse(*access, problem);
  waiting_.clear();
  for (const auto& work : waiting_work_) refuse(*work, problem);
  waiting_work_.clear();
}

// Serves the open bus until the end. Accesses and work items of callers come first; samples and drive states alternate.
bool DriveBus::serve(OpenBus& open) {
  axes_.clear();
  for (std::size_t i = 0; i < plan_.drives.size(); ++i) {
    master::AxisOptions options;
    options.product = &catalogue::product_of(plan_.drives[i].product);
    axes_.emplace_back(*open.drives()[i], options);
    next_poll_[i] = {};
    silent_[i] = false;
  }
  open.while_waiting([this, &open] { return look_around(open); });
  auto attached = std::make_unique<CycleSampler::Attachment>(cycle_, open.cycle());
  // However serving ends, the drives get their TPDOs back.
  const auto recording_end = std::unique_ptr<TpdoRecorder, std::function<void(TpdoRecorder*)>>(
      &recorder_, [](TpdoRecorder* recorder) { recorder->end(); });
  {
    const std::lock_guard lock(mutex_);
    state_.problem.reset();
  }
  for (bool states_first = false;; states_first = !states_first) {
    {
      const std::lock_guard lock(mutex_);
      if (ending_) return false;
    }
    if (const auto access = next_access()) {
      carry_out(open, access);
      continue;
    }
    if (recorder_.is_over()) recorder_.end();
    if (const auto work = next_work()) {
      if (work->reopens) attached.reset();
      carry_out(open, work);
      if (work->reopens) return true;
      continue;
    }
    const bool done = states_first ? poll_one(open) || sample_one(open) : sample_one(open) || poll_one(open);
    if (!done) open.wait(idle_time);
  }
}

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

// With `beside`, takes only a work item that may run during the current one.
std::shared_ptr<Work> DriveBus::next_work(bool beside) {
  const std::lock_guard lock(mutex_);
  const auto next = std::find_if(waiting_work_.begin(), waiting_work_.end(),
                                 [beside](const auto& work) { return !beside || work->beside; });
  if (next == waiting_work_.end()) return nullptr;
  auto work = std::move(*next);
  waiting_work_.erase(next);
  if (!beside) running_work_ = work;
  return work;
}

// An error goes to the caller of the work item. An error of the bus itself shows at the next access.
void DriveBus::carry_out(OpenBus& open, const std::shared_ptr<Work>& work) {
  const auto is_to_end = [&] {
    if (!work->beside) serve_beside(open, *work);
    const std::lock_guard lock(mutex_);
    return work->cancelled || ending_;
  };
  work->begun = true;
  try {
    if (work->cancelled) throw master::Cancelled("interrupted", plan_.link, "nothing was done");
    work->carry_out(open, is_to_end);
  } catch (const std::exception&) {
    work->error = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  if (running_work_ == work) running_work_.reset();
  work->done = true;
}

// Carries out urgent accesses, and others for a limited time. Skips silent drives, because the work item would wait for
// them, except for the first poll after an access without an answer.
void DriveBus::serve_beside(OpenBus& open, const Work& work) {
  const Restored restored(choice_);
  const auto end = Clock::now() + time_for_others;
  while (true) {
    const bool has_time = Clock::now() < end;
    choice_ = {.beside = &work, .urgent_only = !has_time};
    if (const auto access = next_access()) {
      carry_out(open, access);
    } else if (!has_time) {
      return;
    } else if (const auto little = next_work(true)) {
      carry_out(open, little);
    } else if (!sample_one(open) && !poll_one(open, false)) {
      return;
    }
  }
}

void DriveBus::note_access(bool answered, Clock::duration took) {
  const std::lock_guard lock(mutex_);
  ++state_.accesses;
  if (!answered) {
    ++state_.failed;
    return;
  }
  constexpr double weight = 0.05;
  state_.access_s += weight * (std::chrono::duration<double>(took).count() - state_.access_s);
}

// The drive has not answered an access. Each access to a silent drive takes its whole timeout, so the waiting reads get
// the same error without an attempt. Writes, among them stops, are attempted: an answer may be lost although the drive
// has received the command.
void DriveBus::note_silence(std::size_t drive, const JobError& problem, const std::exception_ptr& error) {
  if (!silent_[drive]) next_poll_[drive] = poll_at_once;  // to find the reason, or that only one answer was lost
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

// The drive stores its own values, not those of the supervision, which begins again afterwards, or of a recording,
// which then has no more samples.
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
