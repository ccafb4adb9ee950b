#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "line/bench/routes.hpp"
#include "studio/drives.hpp"
#include "studio/line_drives.hpp"
#include "studio/order.hpp"
#include "studio/task.hpp"

namespace servodrome::studio {

enum class JobState : std::uint8_t { running, done, failed, cancelled };

struct JobResult {
  double position = 0.0;  // in the units of the order
  double seconds = 0.0;   // of the drives' time
};

struct Job {
  std::uint64_t id = 0;
  std::string axis;
  Order order;
  JobState state = JobState::running;
  bool cancelled = false;  // was asked to end; the axis comes to rest
  std::int64_t began_tick = 0;
  std::chrono::steady_clock::time_point sign_of_life{};
  std::optional<JobError> error{};
  std::optional<JobResult> result{};
  std::string note{};         // what else there is to say of it
  line::bench::Json found{};  // of a job that finds something out
  struct Progress {
    std::string doing{};
    double share = 0.0;  // 0 .. 1
  };
  std::optional<Progress> progress{};

  host::Time due{};  // when it is to go on
  std::unique_ptr<Task> task{};
};

// As GET /api/v1/jobs/{id} shows it; the list leaves out what was found.
line::bench::Json view_of(const Job& job, bool with_found = true);

// What axes are doing on behalf of clients of the API: at most one job each, carried out by the host library in the
// drives' time. Everything happens in one thread, which calls `reached`; requests between two such calls find every job
// waiting.
class Jobs {
 public:
  using WallClock = std::function<std::chrono::steady_clock::time_point()>;
  using Publish = std::function<void(const line::bench::Json& event)>;
  static constexpr std::size_t most_remembered = 64;
  // Of a halt, before it becomes a quick stop: who asked for it sees the axis at rest or stopped within 300 ms.
  static constexpr auto longest_halt = std::chrono::milliseconds(250);
  static constexpr auto longest_silence = std::chrono::milliseconds(500);  // of jobs that live on signs of life

  // `drives` outlives this. `wall_clock`: what signs of life are timed by, since they come from people.
  explicit Jobs(Drives& drives, WallClock wall_clock = std::chrono::steady_clock::now)
      : drives_(drives), wall_clock_(std::move(wall_clock)) {}
  // Leaves all jobs where they stand; drives keep what they were told last.
  ~Jobs();
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  // Called for each job that begins, is to end and is over: events of the stream (docs/bench-api.md).
  void on_event(Publish publish) { publish_ = std::move(publish); }

  // The calls of docs/bench-api.md, "Jobs"; the group refers to this.
  line::bench::RouteGroup routes();

  // Begins what the body of a request says; the first access to the drive is a tick later. Throws ApiError, with
  // nothing changed: 409 if the axis cannot be spoken to or has a job already. `axis` is one of drives().names().
  const Job& begin(const std::string& axis, const std::string& body);
  // The axis is halted, then the job is `cancelled`; one that is over stays as it is.
  void cancel(Job& job);
  // The user still holds the button. Throws ApiError 409 if the job does not live on it.
  void sign_of_life(Job& job);
  // Quick stop of every axis, at once. Jobs end where they stand. Answers per axis what is wrong; nothing: it stands,
  // or is being stopped.
  struct Stopped {
    std::string axis;
    std::optional<JobError> error;
  };
  std::vector<Stopped> stop_all();

  // nullptr: none of that number, or not remembered any more.
  Job* find(std::uint64_t id);
  const std::list<Job>& all() const { return jobs_; }

  Drives& drives() { return drives_; }

  // When the next job is to go on, or earlier: then `reached` finds none.
  host::Time next_deadline() const { return next_deadline_; }
  // It is `now`: those go on whose time has come.
  void reached(host::Time now);

  // nullptr: the axis has none.
  Job* running(const std::string& axis) { return running_job(axis); }
  // Ends it where it stands; the drive keeps what it was told last.
  void end(Job& job, std::string reason) { abandon(job, std::move(reason)); }

 private:
  Job* running_job(const std::string& axis);
  void make_room();
  void carry_out(Job& job);
  void resume(Job& job);
  // Without touching the drive.
  void abandon(Job& job, std::string reason);
  void tell(const Job& job) const;
  void note_progress(Job& job, const char* doing, double share) const;

  Drives& drives_;
  WallClock wall_clock_;
  Publish publish_;
  std::uint64_t last_id_ = 0;
  std::list<Job> jobs_;  // the oldest first
  host::Time next_deadline_ = links::never;
};

// The jobs of a line, in its time.
class LineJobs final : private line::Follower {
 public:
  // `line` outlives this.
  explicit LineJobs(line::Line& line, Jobs::WallClock wall_clock = std::chrono::steady_clock::now)
      : line_(line), drives_(line), jobs_(drives_, std::move(wall_clock)) {
    line_.add_follower(*this);
  }
  ~LineJobs() { line_.remove_follower(*this); }
  LineJobs(const LineJobs&) = delete;
  LineJobs& operator=(const LineJobs&) = delete;

  Jobs& jobs() { return jobs_; }
  line::bench::RouteGroup routes() { return jobs_.routes(); }

 private:
  line::Time next_deadline() const override { return jobs_.next_deadline(); }
  void reached(line::Time now) override { jobs_.reached(now); }

  line::Line& line_;
  LineDrives drives_;
  Jobs jobs_;
};

}  // namespace servodrome::studio
