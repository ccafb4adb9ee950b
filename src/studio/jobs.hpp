#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "line/bench/routes.hpp"
#include "line/line.hpp"
#include "studio/order.hpp"
#include "studio/task.hpp"

namespace servodrome::studio {

enum class JobState : std::uint8_t { running, done, failed, cancelled };

// What went wrong, as the API tells it.
struct JobError {
  std::string what;
  std::string where;
  std::string hint;
};

struct JobResult {
  double position = 0.0;  // in the units of the order
  double seconds = 0.0;   // of the line's time
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

  line::Time due{};  // when it is to go on
  std::unique_ptr<Task> task{};
};

// What axes are doing on behalf of somebody at the API: at most one job each, carried out in the line's time by the
// host library over the drive's service port. Everything happens in the line's thread; requests between two advances of
// the line find every job waiting.
class Jobs final : public line::Follower {
 public:
  using WallClock = std::function<std::chrono::steady_clock::time_point()>;
  static constexpr std::size_t most_remembered = 64;
  static constexpr auto longest_silence = std::chrono::milliseconds(500);  // of jobs that live on signs of life

  // `line` outlives this. `wall_clock`: what signs of life are timed by, since they come from people.
  explicit Jobs(line::Line& line, WallClock wall_clock = std::chrono::steady_clock::now);
  // Leaves all jobs where they stand; drives keep what they were told last.
  ~Jobs();
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  // The calls of docs/bench-api.md, "Jobs"; the group refers to this.
  line::bench::RouteGroup routes();

  // Begins what the body of a request says; the first access to the drive is a tick later. Throws ApiError, with
  // nothing changed: 409 if the axis has no power or a job already.
  const Job& begin(line::Axis& axis, const std::string& body);
  // The axis is halted, then the job is `cancelled`; one that is over stays as it is.
  void cancel(Job& job);
  // Whoever holds the button still does. Throws ApiError 409 if the job does not live on it.
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

  // --- line::Follower
  line::Time next_deadline() const override;
  void reached(line::Time now) override;

 private:
  Job* running_job(const std::string& axis);
  void make_room();
  void carry_out(Job& job, line::Axis& axis);
  void resume(Job& job);
  // Without touching the drive.
  void abandon(Job& job, std::string reason);

  line::Line& line_;
  WallClock wall_clock_;
  std::uint64_t last_id_ = 0;
  std::list<Job> jobs_;  // the oldest first
};

}  // namespace servodrome::studio
