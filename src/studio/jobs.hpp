#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "api/routes.hpp"
#include "studio/drives.hpp"
#include "studio/line_drives.hpp"
#include "studio/order.hpp"
#include "studio/task.hpp"

namespace servodrome::studio {

enum class JobState : std::uint8_t { running, done, failed, cancelled };

struct JobResult {
  double position = 0.0;  // in the units of the order
  double seconds = 0.0;   // in drive time
};

struct Job {
  std::uint64_t id = 0;
  std::string axis;
  Order order;
  JobState state = JobState::running;
  bool cancelled = false;    // cancel was requested; the axis comes to rest
  bool fell_silent = false;  // its signs of life failed to appear; the axis comes to rest
  // The sequence ends here: begin() refuses a job `after` this one. Set for a job that a client cancels, and for a stop
  // that is carried out although its sequence was interrupted.
  bool breaks_sequence = false;
  std::uint64_t commands = 0;  // Drives::commands when it began
  std::int64_t began_tick = 0;
  std::chrono::steady_clock::time_point sign_of_life{};
  std::chrono::steady_clock::time_point ended{};
  std::optional<JobError> error{};
  std::optional<JobResult> result{};
  std::string note{};  // additional information for the user
  api::Json found{};   // result of a job that measures something
  struct Progress {
    std::string doing{};
    double share = 0.0;  // 0 .. 1
  };
  std::optional<Progress> progress{};

  master::Time due{};        // time at which it continues
  bool has_noticed = false;  // its task has noticed that it must end
  std::unique_ptr<Task> task{};
};

// The form of GET /api/v1/jobs/{id}; the list of jobs omits `found`.
api::Json view_of(const Job& job, bool with_found = true);

// The jobs of axes for clients of the API, at most one per axis. They run in the drives' time, by `Axis402`.
// Everything runs in one thread, which calls `reached`; between two such calls every job waits.
class Jobs {
 public:
  using WallClock = std::function<std::chrono::steady_clock::time_point()>;
  using Publish = std::function<void(const api::Json& event)>;
  static constexpr std::size_t most_remembered = 64;
  // A halt that has not brought the axis to rest within this time becomes a quick stop.
  static constexpr auto longest_halt = std::chrono::milliseconds(250);
  static constexpr auto longest_silence = std::chrono::milliseconds(500);  // longest time without a sign of life

  // `drives` must outlive this object. `wall_clock` times the signs of life, since they come from people.
  explicit Jobs(Drives& drives, WallClock wall_clock = std::chrono::steady_clock::now)
      : drives_(drives), wall_clock_(std::move(wall_clock)) {}
  // Ends all jobs without touching the drives, which keep their last commands.
  ~Jobs();
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  // `publish` is called for each job that begins, is being cancelled, or ends: events of the stream
  // (docs/bench-api.md).
  void on_event(Publish publish) { publish_ = std::move(publish); }

  // The calls of docs/bench-api.md, "Jobs"; the returned group refers to this object.
  api::RouteGroup routes();

  // Begins the job in the body of a request; the first access to the drive follows one tick later. Throws ApiError
  // without any change: 409 if the axis does not communicate, or has a job that the new one does not replace. `axis` is
  // one of drives().names(). `obsolete` is Call::obsolete: only a stop begins then.
  const Job& begin(const std::string& axis, const std::string& body, std::string_view obsolete = {});
  // Halts the axis, then sets the job to `cancelled`. A job that has ended, and a stop, stay unchanged, but no job
  // begins `after` them any more. The jobs that have begun after it, in the same sequence, are cancelled too.
  void cancel(Job& job);
  // Sign of life (dead man's switch): the user still holds the button. Throws ApiError 409 if the job does not use it.
  void sign_of_life(Job& job);
  // Quick stop of every axis, at once. All jobs end immediately. Returns the error of each axis; empty: it stands, or
  // is stopping.
  struct Stopped {
    std::string axis;
    std::optional<JobError> error;
  };
  std::vector<Stopped> stop_all();

  // Returns nullptr if the number is unknown or no longer remembered.
  Job* find(std::uint64_t id);
  const std::list<Job>& all() const { return jobs_; }

  Drives& drives() { return drives_; }

  // Deadline of the next call of reached(). It may be too early; reached() then does nothing.
  master::Time next_deadline() const { return next_deadline_; }
  // The time is `now`: continues the jobs that are due.
  void reached(master::Time now);

  // Returns nullptr if the axis has no running job.
  Job* running(const std::string& axis) { return running_job(axis); }
  // Ends a job immediately, without touching the drive, which keeps its last command.
  void end(Job& job, std::string reason) { abandon(job, std::move(reason)); }

 private:
  Job* running_job(const std::string& axis);
  // Returns the job if it is the last command of the axis and no client has interrupted its sequence; else nullptr.
  const Job* last_in_sequence(const std::string& axis, std::uint64_t id) const;
  void require_last(const std::string& axis, const Order::After& after) const;
  bool breaks_sequence(const std::string& axis, const Order& order) const;
  // A stop of an axis that does not communicate: ends its jobs, and leaves the quick stop to Drives::stop_when_back.
  void note_refused_stop(const std::string& axis, const std::string& body);
  // The number of client commands and the last job of an axis.
  struct Asked {
    std::uint64_t commands = 0;
    std::uint64_t job = 0;
    friend bool operator==(const Asked&, const Asked&) = default;
  };
  Asked asked(const std::string& axis) const;
  // Removes an ended job if there are too many. Throws ApiError 409 if all are running, unless it `must` succeed.
  void make_room(bool must);
  void carry_out(Job& job);
  void note_failed_stop(const Job& job);
  void resume(Job& job);
  // Ends a job without touching the drive.
  void abandon(Job& job, std::string reason);
  void tell(const Job& job) const;
  void explain_by_injection(Job& job) const;
  void note_silence(Job& job);
  void note_progress(Job& job, const char* doing, double share) const;

  Drives& drives_;
  WallClock wall_clock_;
  Publish publish_;
  std::uint64_t last_id_ = 0;
  std::list<Job> jobs_;  // oldest first
  master::Time next_deadline_ = links::never;
};

// The jobs of a line, in the line's time.
class LineJobs final : private line::Follower {
 public:
  // `line` must outlive this object.
  explicit LineJobs(line::Line& line, Jobs::WallClock wall_clock = std::chrono::steady_clock::now)
      : line_(line), drives_(line), jobs_(drives_, std::move(wall_clock)) {
    line_.add_follower(*this);
  }
  ~LineJobs() { line_.remove_follower(*this); }
  LineJobs(const LineJobs&) = delete;
  LineJobs& operator=(const LineJobs&) = delete;

  Jobs& jobs() { return jobs_; }
  api::RouteGroup routes() { return jobs_.routes(); }

 private:
  line::Time next_deadline() const override { return jobs_.next_deadline(); }
  void reached(line::Time now) override { jobs_.reached(now); }

  line::Line& line_;
  LineDrives drives_;
  Jobs jobs_;
};

}  // namespace servodrome::studio
