#include "studio/jobs.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <system_error>

#include "api/author.hpp"
#include "api/version.hpp"
#include "catalogue/product.hpp"
#include "line/axis.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;

JobError error_of(const master::MasterError& error) { return {error.happened(), error.where(), error.remedy()}; }

}  // namespace

Jobs::~Jobs() { jobs_.clear(); }  // each job ends its task

Job* Jobs::find(std::uint64_t id) {
  const auto found = std::find_if(jobs_.begin(), jobs_.end(), [id](const Job& job) { return job.id == id; });
  return found == jobs_.end() ? nullptr : &*found;
}

Job* Jobs::running_job(const std::string& axis) {
  const auto found = std::find_if(jobs_.begin(), jobs_.end(), [&axis](const Job& job) {
    return job.state == JobState::running && job.axis == axis;
  });
  return found == jobs_.end() ? nullptr : &*found;
}

void Jobs::make_room(bool must) {
  if (jobs_.size() < most_remembered) return;
  const auto over =
      std::find_if(jobs_.begin(), jobs_.end(), [](const Job& job) { return job.state != JobState::running; });
  if (over == jobs_.end()) {
    if (must) return;
    throw ApiError{409, fmt::format("too many jobs: {} are running", jobs_.size()), "jobs",
                   "wait until one is done, or end one"};
  }
  jobs_.erase(over);
}

// A job that names another one as `after` may begin only if no other command came between the two.
const Job* Jobs::last_in_sequence(const std::string& axis, std::uint64_t id) const {
  const auto later =
      std::find_if(jobs_.begin(), jobs_.end(), [&](const Job& job) { return job.axis == axis && job.id > id; });
  const auto before =
      std::find_if(jobs_.begin(), jobs_.end(), [&](const Job& job) { return job.axis == axis && job.id == id; });
  const bool is_last = before != jobs_.end() && later == jobs_.end() && before->commands == drives_.commands(axis);
  return is_last && !before->breaks_sequence ? &*before : nullptr;
}

void Jobs::require_last(const std::string& axis, const Order::After& after) const {
  constexpr const char* remedy = "begin again if the axis shall move";
  if (after.start && *after.start != api::run_name()) {
    throw ApiError{409, fmt::format("job {} was a job of a server that has ended", after.job), axis, remedy};
  }
  const Job* const before = last_in_sequence(axis, after.job);
  if (before == nullptr || before->state != JobState::done) {
    throw ApiError{409, fmt::format("job {} is not the last command of the axis, or is not done", after.job), axis,
                   remedy};
  }
  const std::chrono::duration<double> since = wall_clock_() - before->ended;
  if (!after.within_s || since.count() <= *after.within_s) return;
  throw ApiError{409,
                 fmt::format("job {} ended {:.0f} s ago, more than {:g} s", after.job, since.count(), *after.within_s),
                 axis, remedy};
}

// A stop within a sequence is accepted also after an interruption. The jobs after it must then be refused: otherwise
// they would continue the sequence, because the stop is now the last command of the axis. A stop may replace the
// running job of its own sequence.
bool Jobs::breaks_sequence(const std::string& axis, const Order& order) const {
  if (!order.takes_over || !order.after) return false;
  const Job* const before = last_in_sequence(axis, order.after->job);
  if (before == nullptr || before->cancelled) return true;
  return before->state != JobState::done && before->state != JobState::running;
}

// What has been asked of an axis so far. Any other command changes it.
Jobs::Asked Jobs::asked(const std::string& axis) const {
  Asked asked{.commands = drives_.commands(axis)};
  for (const Job& job : jobs_) {
    if (job.axis == axis) asked.job = job.id;
  }
  return asked;
}

void Jobs::note_refused_stop(const std::string& axis, const std::string& body) {
  const auto no_units = []() -> std::optional<catalogue::AxisUnits> {
    throw master::MasterError("the units of a silent drive are unknown", "", "");
  };
  try {
    if (!read_order(body, no_units).takes_over) return;
  } catch (const ApiError&) {
    return;  // the request is invalid
  } catch (const master::MasterError&) {
    return;  // a stop has no numbers and reads no units
  }
  drives_.stop_when_back(axis);
  for (Job& job : jobs_) {
    if (job.axis == axis) cancel(job);
  }
}

const Job& Jobs::begin(const std::string& name, const std::string& body, std::string_view obsolete) {
  try {
    drives_.require_ready(name);
  } catch (const ApiError&) {
    note_refused_stop(name, body);
    throw;
  }
  const Asked before = asked(name);
  Job job;
  job.axis = name;
  try {
    job.order = read_order(body, [&] { return drives_.units(name); });
    if (job.order.target) require_within_travel(job.order, drives_.travel(name), name);
  } catch (const master::MasterError& error) {
    throw ApiError{409, error.happened(), error.where().empty() ? name : error.where(), error.remedy()};
  }
  // A stop is always accepted.
  const bool is_stop = job.order.takes_over;
  if (!is_stop) api::refuse_obsolete(obsolete);
  if (!is_stop && asked(name) != before) {  // objects of the drive were read meanwhile
    throw ApiError{409, "another command to the axis came first", name, "begin again if the axis shall move"};
  }
  if (!is_stop && job.order.after) require_last(name, *job.order.after);
  Job* const other = running_job(name);
  if (other != nullptr && !is_stop) {
    throw ApiError{409, fmt::format("the axis has a job: {}", other->order.what), name,
                   fmt::format("wait until it is done, or end it: DELETE /api/v1/jobs/{}", other->id)};
  }
  job.breaks_sequence = breaks_sequence(name, job.order);  // before `other` ends
  if (other != nullptr) abandon(*other, fmt::format("replaced by the job {}", job.order.what));
  make_room(is_stop);
  job.id = ++last_id_;
  job.commands = before.commands;
  job.began_tick = drives_.now() / line::tick_length;
  job.sign_of_life = wall_clock_();
  job.due = drives_.now();
  next_deadline_ = std::min(next_deadline_, job.due);
  if (is_stop) {
    drives_.note_stop(name);
  } else {
    drives_.note_motion(name);
  }
  Job& kept = jobs_.emplace_back(std::move(job));
  kept.task = std::make_unique<Task>([this, &kept] { carry_out(kept); });
  tell(kept);
  return kept;
}

void Jobs::tell(const Job& job) const {
  if (!publish_) return;
  publish_({{"kind", "job"}, {"axis", job.axis}, {"tick", drives_.now() / line::tick_length}, {"job", view_of(job)}});
}

// The body of a job's task.
void Jobs::carry_out(Job& job) {
  const api::Author author(fmt::format("job {} ({})", job.id, job.order.what));
  const auto wait = [this, &job](master::Time until) {
    // A cancelled job must halt the axis at once: until its task has noticed the cancellation, it waits for one tick at
    // most.
    const auto hurries = [&job] { return job.cancelled && !job.has_noticed; };
    job.due = hurries() ? std::min(until, drives_.now() + line::tick_length) : until;
    do {
      job.task->pause();
    } while (drives_.now() < until && !hurries());
  };
  const std::unique_ptr<master::ObjectClient> objects = drives_.open(job.axis, wait);
  master::AxisOptions options = drives_.options(job.axis);
  // A stop always runs to its end, whatever command follows, because it has already ended the job of the motion.
  const bool is_stop = job.order.takes_over;
  const auto is_to_end = [this, &job, is_stop] {
    const bool other_command = drives_.commands(job.axis) != job.commands;
    return job.has_noticed = !is_stop && (job.cancelled || other_command);
  };
  options.cancelled = is_to_end;
  options.longest_halt = longest_halt;
  master::Axis402 master_axis(*objects, options);
  const auto fail = [this, &job, &master_axis](JobError error) {
    // The motion of an earlier command may still go on, and this job, the last command, does not ask for it.
    if (job.order.moves) master_axis.try_to_stop();
    job.error = std::move(error);
    job.state = JobState::failed;
    note_failed_stop(job);
  };
  const master::Time began = drives_.now();
  try {
    if (is_to_end()) {
      if (job.order.moves) master_axis.try_to_stop();  // ends the motion of an earlier command
      throw master::Cancelled("the job was ended before it began", job.axis, "start it anew");
    }
    Conduct conduct;
    conduct.released = [this, &job, &is_to_end] {
      if (is_to_end()) return true;
      note_silence(job);
      return job.fell_silent;
    };
    conduct.progress = [this, &job](const char* doing, double share) { note_progress(job, doing, share); };
    conduct.product = drives_.product(job.axis);
    conduct.in_cycles = [&](const master::CanDrive& exchanged, const Drives::Work& work) {
      return drives_.in_cycles(job.axis, *objects, exchanged, conduct.released, conduct.progress, work);
    };
    job.order.carry_out(master_axis, conduct);
    job.found = std::move(conduct.found);
    const std::chrono::duration<double> took = drives_.now() - began;
    job.result = JobResult{master_axis.position() / job.order.scale.units().position, took.count()};
    job.state = JobState::done;
  } catch (const master::Cancelled& cancelled) {
    job.error = error_of(cancelled);
    job.state = JobState::cancelled;
  } catch (const master::MasterError& error) {
    fail(error_of(error));
    if (job.order.what == "reset_fault") explain_by_injection(job);
  } catch (const std::exception& error) {
    fail(JobError{error.what(), job.axis, "start the job again"});
  }
  if (master_axis.became_quick_stop()) {
    job.note += fmt::format("{}the axis was not at rest {} ms after the halt, which became a quick stop",
                            job.note.empty() ? "" : "; ", longest_halt / std::chrono::milliseconds(1));
  }
}

// Explains a failed fault reset: a fault that the bench injects stays until the bench removes it.
void Jobs::explain_by_injection(Job& job) const {
  const std::vector<std::string> injected = drives_.injected(job.axis);
  if (injected.empty()) return;
  job.error->what =
      fmt::format("the fault cannot be reset, because an injected fault holds: {}", fmt::join(injected, ", "));
  job.error->hint = fmt::format("remove it: DELETE /api/v1/axes/{}/faults", job.axis);
}

// Ends the job if its keepalive (signs of life) has timed out. A later sign of life does not continue the motion.
void Jobs::note_silence(Job& job) {
  if (!job.order.lives_on_signs || job.fell_silent || wall_clock_() - job.sign_of_life <= longest_silence) return;
  job.fell_silent = true;
  job.note = fmt::format("the axis was halted, because nothing was heard from its client for {} ms",
                         longest_silence / std::chrono::milliseconds(1));
  tell(job);
}

// Publishes progress when `doing` changes, and at every step of 5 %.
void Jobs::note_progress(Job& job, const char* doing, double share) const {
  const bool other = !job.progress || job.progress->doing != doing;
  if (!other && std::abs(share - job.progress->share) < 0.05) return;
  job.progress = Job::Progress{doing, share};
  tell(job);
}

// The axis may still move, for example if it fell silent during the stop.
void Jobs::note_failed_stop(const Job& job) {
  if (!job.order.takes_over) return;
  drives_.note_motion(job.axis);
  drives_.stop_when_back(job.axis);
}

void Jobs::resume(Job& job) {
  try {
    job.task->resume();
  } catch (const std::system_error& error) {
    job.error = JobError{fmt::format("no thread could be created: {}", error.what()), job.axis,
                         "stop other programs, or raise the limit of threads"};
    job.state = JobState::failed;
    note_failed_stop(job);
  }
  if (job.state == JobState::running) return;
  job.task.reset();
  job.ended = wall_clock_();
  tell(job);
}

void Jobs::cancel(Job& job) {
  for (Job& next : jobs_) {
    if (next.id > job.id && next.axis == job.axis && next.order.after && next.order.after->job == job.id) cancel(next);
  }
  // The request may arrive when the job has just ended, or after the stop of a sequence has begun: the sequence must
  // end in these cases, too. `cancelled` is not set for this, because it would make a stop poll its drive with shorter
  // waits.
  job.breaks_sequence = true;
  if (job.state != JobState::running || job.cancelled || job.order.takes_over) return;
  job.cancelled = true;
  job.due = std::min(job.due, drives_.now() + line::tick_length);
  next_deadline_ = std::min(next_deadline_, job.due);
  tell(job);
}

void Jobs::abandon(Job& job, std::string reason) {
  if (job.state != JobState::running) return;
  // Code that cleans up during unwinding (a jog halts) still uses the task, so it is ended before it is destroyed.
  if (job.task) job.task->end();
  job.task.reset();
  job.state = JobState::cancelled;
  job.error = JobError{std::move(reason), job.axis, ""};
  tell(job);
}

void Jobs::sign_of_life(Job& job) {
  if (!job.order.lives_on_signs) {
    throw ApiError{409, fmt::format("a job \"{}\" needs no keep-alive requests", job.order.what), job.axis,
                   "it runs until it is done; DELETE ends it"};
  }
  job.sign_of_life = wall_clock_();
}

std::vector<Jobs::Stopped> Jobs::stop_all() {
  const std::vector<std::string> names = drives_.names();
  for (const std::string& name : names) {
    if (Job* job = running_job(name)) abandon(*job, "all axes were stopped");
  }
  const std::vector<std::optional<JobError>> errors = drives_.stop_all();
  std::vector<Stopped> stopped;
  for (std::size_t i = 0; i < names.size(); ++i) stopped.push_back({names[i], errors[i]});
  return stopped;
}

void Jobs::reached(master::Time now) {
  next_deadline_ = links::never;
  for (Job& job : jobs_) {
    if (job.state == JobState::running && job.due <= now) resume(job);
    if (job.state == JobState::running) next_deadline_ = std::min(next_deadline_, job.due);
  }
}

}  // namespace servodrome::studio
