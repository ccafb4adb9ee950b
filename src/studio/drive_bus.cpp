#include "studio/drive_bus.hpp"

#include <algorithm>

#include "api/change_log.hpp"
#include "catalogue/product.hpp"
#include "line/axis.hpp"
#include "master/restored.hpp"

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

// Answers an access or work item with the error of the bus.
template <typename Waiting>
void refuse(Waiting& waiting, const JobError& problem) {
  waiting.error = std::make_exception_ptr(master::MasterError(problem.what, problem.where, problem.hint));
  waiting.done = true;
}

}  // namespace

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

void DriveBus::sample(const std::vector<std::shared_ptr<BusSamples>>& samples) {
  std::vector<std::shared_ptr<BusSamples>> in_cycles;
  const std::lock_guard lock(mutex_);
  std::erase_if(sampled_, [](const auto& its) { return its.expired(); });
  for (const auto& its : samples) {
    switch (its->sampling().by) {
      case Sampling::By::cycle: in_cycles.push_back(its); break;
      case Sampling::By::pdo: pdos_.add(its); break;
      case Sampling::By::reading: sampled_.push_back(its); break;
    }
  }
  cycle_.add(in_cycles);
}

std::unique_ptr<master::CanCyclicBus> OpenBus::record(const std::vector<master::CanDrive>&, master::Time,
                                                      const std::function<void()>&) {
  throw master::MasterError("there are no TPDOs", "this bus", "use the drive's CAN port");
}

void DriveBus::record(OpenBus& open, const TpdoRecorder::Wish& wish) {
  recorder_.begin(open, wish, [this, &open] { serve_urgent(open); });
}

void DriveBus::serve_urgent(OpenBus& open) {
  const master::Restored choice(choice_, {.urgent_only = true});
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
  const master::Restored choice(choice_, choice_);
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

}  // namespace servodrome::studio
