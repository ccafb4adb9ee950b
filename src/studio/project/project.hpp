#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "links/durable_file.hpp"
#include "studio/project/files.hpp"

namespace servodrome::studio {

// A folder with the line or the buses of a machine, and with what the studio keeps: docs/project.md. The thread of the
// server uses it; ProjectKeeper writes its files.
class Project {
 public:
  static constexpr int schema = 1;
  static constexpr std::size_t most_states = 1024;
  static constexpr std::size_t most_earlier_changes = 1000;

  // Makes the folder if it does not exist, and project.toml. `buses` are "LINK" or "LINK=1,3", as --bus of `servodrome
  // studio`; without buses it makes also line.toml with the text `line`, unless there is one. Returns what it made,
  // relative to the folder; "." is the folder itself. Throws ProjectError if the folder is a project already.
  static std::vector<std::string> make(const std::filesystem::path& folder, const std::vector<std::string>& buses,
                                       std::string_view line);

  // Opens a project: locks it and checks its files, except those of recordings. Throws ProjectError.
  explicit Project(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }  // absolute
  const std::string& name() const { return name_; }
  // Drives on buses, in the form of --bus; empty: a virtual line.
  const std::vector<std::string>& buses() const { return buses_; }
  std::filesystem::path line_file() const { return folder_ / "line.toml"; }
  // Why the folder is not locked against other servers; empty: it is locked.
  const std::string& unlocked() const { return unlocked_; }

  // --- The state of the page: texts of JSON files by name. They are held in memory, and ProjectKeeper writes them to
  // the files later.
  struct State {
    std::optional<std::string> text{};     // nothing: the file is to be deleted
    std::optional<std::string> on_disk{};  // content of the file when it was read or written last
  };
  // A letter or digit, then letters, digits, ".", "-" and "_"; at most 64 characters.
  static bool is_state_name(std::string_view name);
  const std::map<std::string, State>& states() const { return states_; }
  // Throws ProjectError if the value could not be read again, or if there are too many states.
  void set_state(const std::string& name, const nlohmann::json& value);
  void remove_state(const std::string& name);
  std::filesystem::path state_file(const std::string& name) const { return folder_ / "state" / (name + ".json"); }
  // States whose files differ from the memory.
  const std::set<std::string>& unsaved_states() const { return unsaved_; }
  void note_saved(const std::string& name, const std::optional<std::string>& text);

  // --- The newest `most_earlier_changes` changes of earlier runs, the oldest first, in the form of docs/bench-api.md.
  std::filesystem::path changes_file() const { return folder_ / "changes.jsonl"; }
  const std::vector<nlohmann::json>& earlier_changes() const { return earlier_changes_; }
  // The greatest number of these changes.
  std::uint64_t last_change() const { return last_change_; }

  // --- Why files cannot be written at present; nothing: they can.
  const std::optional<line::Diagnostic>& problem() const { return problem_; }
  void set_problem(std::optional<line::Diagnostic> problem) { problem_ = std::move(problem); }

 private:
  void lock();
  void read_settings();
  void read_states();
  void read_changes();

  std::filesystem::path folder_;
  std::optional<links::FolderLock> lock_;
  std::string unlocked_;
  std::string name_;
  std::vector<std::string> buses_;
  std::map<std::string, State> states_;
  std::set<std::string> unsaved_;
  std::vector<nlohmann::json> earlier_changes_;
  std::uint64_t last_change_ = 0;
  std::optional<line::Diagnostic> problem_;
};

}  // namespace servodrome::studio
