#include "studio/project/keeper.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "studio/change_routes.hpp"
#include "studio/project/recording_files.hpp"

namespace servodrome::studio {
namespace {

namespace fs = std::filesystem;

void replace(const fs::path& file, const std::string& text) {
  make_folder(file.parent_path());
  if (const std::error_code error = links::replace_file(file, text)) throw ProjectError(file, error);
}

// If another program has changed the file since it was read, the user decides what is kept.
void write_state(const fs::path& file, const Project::State& state) {
  const auto present = read_file(file);
  if (present && present != state.on_disk && present != state.text) {
    throw ProjectError(file, "another program has changed this file, so it is not overwritten",
                       "delete the file to write what the page has, or start the server again to read the file");
  }
  if (state.text) {
    replace(file, *state.text);
  } else {
    remove_file(file);
  }
}

// Returns the text after the last line end of the file: a line that an editor has left without a line end, or a part of
// a line from before a power cut.
std::string incomplete_line(const fs::path& file) {
  std::string text = read_file(file).value_or("");
  return text.substr(text.rfind('\n') + 1);
}

void append_lines(const fs::path& file, bool is_first, std::string text) {
  const std::string rest = is_first ? incomplete_line(file) : "";
  if (nlohmann::json::accept(rest)) {
    text.insert(0, "\n");
  } else if (!rest.empty()) {
    std::error_code error;
    fs::resize_file(file, fs::file_size(file) - rest.size(), error);
    if (error) throw ProjectError(file, error);
  }
  if (const std::error_code error = links::append_to_file(file, text)) throw ProjectError(file, error);
}

void remove_parts(const fs::path& folder) {
  std::error_code ignored;
  for (const std::string& name : names_in(folder, ".part")) fs::remove(folder / (name + ".part"), ignored);
}

}  // namespace

ProjectKeeper::ProjectKeeper(boost::asio::io_context& io, Project& project, api::ChangeLog& log,
                             api::Recordings& recordings, Changed changed)
    : project_(project),
      log_(log),
      recordings_(recordings),
      changed_(std::move(changed)),
      timer_(io),
      written_(project.last_change()) {
  load_recordings(project.folder() / "recordings", recordings_);
  for (const auto& recording : recordings_.all()) {
    saved_[recording->plan().id] = {recording->plan().name, recording->plan().note};
  }
  for (const char* folder : {"state", "recordings"})
    remove_parts(project.folder() / folder);  // of a run that was killed
  log_.begin_after(written_);
  recordings_.on_removed([this](std::uint32_t id) { deleted_.insert(id); });
  schedule();
}

ProjectKeeper::~ProjectKeeper() { recordings_.on_removed({}); }

fs::path ProjectKeeper::recording_file(std::uint32_t id, const char* extension) const {
  return project_.folder() / "recordings" / fmt::format("{}.{}", id, extension);
}

void ProjectKeeper::collect_states(std::vector<Task>& tasks) {
  for (const std::string& name : project_.unsaved_states()) {
    const Project::State state = project_.states().at(name);
    tasks.push_back({[state, file = project_.state_file(name)] { write_state(file, state); },
                     [this, name, text = state.text] { project_.note_saved(name, text); }});
  }
}

void ProjectKeeper::collect_changes(std::vector<Task>& tasks) {
  std::vector<api::Change> changes;
  for (std::uint64_t number = std::max(log_.oldest(), written_ + 1); number <= log_.newest(); ++number) {
    changes.push_back(log_.at(number));
  }
  if (changes.empty()) return;
  const auto write = [&log = log_, changes, file = project_.changes_file(),
                      is_first = written_ == project_.last_change()] {
    std::string text;
    for (const api::Change& change : changes) text += line_text(view_of(change, log));
    append_lines(file, is_first, std::move(text));
  };
  tasks.push_back({write, [this, last = log_.newest()] { written_ = last; }});
}

void ProjectKeeper::collect_recordings(std::vector<Task>& tasks) {
  for (const auto& recording : recordings_.all()) {
    const api::Recording::Plan& plan = recording->plan();
    if (plan.fault_moment || !recording->ended() || recording->samples() == 0) continue;
    const auto saved = saved_.find(plan.id);
    const bool is_new = saved == saved_.end();
    if (!is_new && saved->second.name == plan.name && saved->second.note == plan.note) continue;
    const auto write = [recording = std::shared_ptr<const api::Recording>(recording), is_new,
                        about = about_text(*recording), samples = recording_file(plan.id, "csv"),
                        file = recording_file(plan.id, "json")] {
      if (is_new) replace(samples, samples_text(recording));
      replace(file, about);
    };
    tasks.push_back(
        {write, [this, id = plan.id, described = Described{plan.name, plan.note}] { saved_[id] = described; }});
  }
}

void ProjectKeeper::collect_deleted(std::vector<Task>& tasks) {
  for (const std::uint32_t id : deleted_) {
    const auto write = [about = recording_file(id, "json"), samples = recording_file(id, "csv")] {
      remove_file(about);
      remove_file(samples);
    };
    tasks.push_back({write, [this, id] { deleted_.erase(id); }});
  }
}

// Begins to write what is new.
void ProjectKeeper::begin() {
  std::vector<Task> tasks;
  collect_states(tasks);
  collect_changes(tasks);
  collect_recordings(tasks);
  collect_deleted(tasks);
  if (tasks.empty()) return set_problem(std::nullopt);
  const auto write = [tasks = std::move(tasks)] {
    Result result;
    for (const Task& task : tasks) {
      try {
        task.write();
        result.done.push_back(task.done);
      } catch (const ProjectError& error) {
        if (!result.problem) result.problem = error.first();
      }
    }
    return result;
  };
  try {
    writing_ = std::async(std::launch::async, write);
  } catch (const std::system_error& error) {
    set_problem(line::Diagnostic{project_.folder().string(), 0, 0,
                                 fmt::format("no thread could be created to write: {}", error.what()),
                                 "stop other programs, or raise the limit of threads"});
  }
}

// Takes the result of the other thread, and waits for it if need be.
void ProjectKeeper::end() {
  if (!writing_.valid()) return;
  const Result result = writing_.get();
  for (const auto& done : result.done) done();
  set_problem(result.problem);
}

void ProjectKeeper::set_problem(std::optional<line::Diagnostic> problem) {
  const auto text = [](const std::optional<line::Diagnostic>& its) { return its ? to_string(*its) : ""; };
  const bool is_other = text(problem) != text(project_.problem());
  project_.set_problem(std::move(problem));
  if (is_other) changed_();
}

void ProjectKeeper::schedule() {
  if (project_.problem() && !writing_.valid()) {
    timer_.expires_after(period_of_retries);
  } else {
    timer_.expires_after(period);
  }
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;
    const bool is_over = !writing_.valid() || writing_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    if (is_over) {
      end();
      begin();
    }
    schedule();
  });
}

void ProjectKeeper::finish() {
  timer_.cancel();
  for (const auto& recording : recordings_.all()) {
    if (recording->state() == api::RecordingState::running) recording->stop();
  }
  end();
  begin();
  end();
}

}  // namespace servodrome::studio
