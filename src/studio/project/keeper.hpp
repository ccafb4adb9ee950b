#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <future>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "api/change_log.hpp"
#include "api/scope/recordings.hpp"
#include "studio/project/project.hpp"

namespace servodrome::studio {

// Writes the state of the page, the changes and the recordings of a server into its project. It polls them for new data
// every `period`. Another thread writes, so a slow disk delays no drive. A failed write is repeated until it succeeds.
// All calls come from the thread of `io`.
class ProjectKeeper {
 public:
  static constexpr auto period = std::chrono::milliseconds(200);
  static constexpr auto period_of_retries = std::chrono::seconds(2);
  // Is called when Project::problem() has changed.
  using Changed = std::function<void()>;

  // All arguments must outlive this object. Loads the project's recordings, and begins the numbers of the log after
  // those of earlier runs. Throws ProjectError.
  ProjectKeeper(boost::asio::io_context& io, Project& project, api::ChangeLog& log, api::Recordings& recordings,
                Changed changed);
  ~ProjectKeeper();
  ProjectKeeper(const ProjectKeeper&) = delete;
  ProjectKeeper& operator=(const ProjectKeeper&) = delete;

  // Ends the running recordings and writes everything that is not written yet. The server calls it when it ends. If a
  // write fails, Project::problem() has the reason.
  void finish();

 private:
  // `write` runs in the other thread and throws ProjectError, `done` afterwards in this one unless it threw.
  struct Task {
    std::function<void()> write;
    std::function<void()> done;
  };
  struct Result {
    std::vector<std::function<void()>> done;
    std::optional<line::Diagnostic> problem;  // the first one
  };
  struct Described {
    std::string name;
    std::string note;
  };

  void collect_states(std::vector<Task>& tasks);
  void collect_changes(std::vector<Task>& tasks);
  void collect_recordings(std::vector<Task>& tasks);
  void collect_deleted(std::vector<Task>& tasks);
  void begin();
  void end();
  void schedule();
  void set_problem(std::optional<line::Diagnostic> problem);
  std::filesystem::path recording_file(std::uint32_t id, const char* extension) const;

  Project& project_;
  api::ChangeLog& log_;
  api::Recordings& recordings_;
  Changed changed_;
  boost::asio::steady_timer timer_;
  std::future<Result> writing_;               // valid while the other thread writes
  std::uint64_t written_;                     // number of the last change in the file
  std::map<std::uint32_t, Described> saved_;  // recordings whose files are complete
  std::set<std::uint32_t> deleted_;           // recordings whose files are to be deleted
};

}  // namespace servodrome::studio
