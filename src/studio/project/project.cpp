#include "studio/project/project.hpp"

#include <algorithm>
#include <cctype>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "line/table_reader.hpp"
#include "line/toml_text.hpp"

namespace servodrome::studio {
namespace {

// The numbers of later changes must also be exact in JSON, below 2^53.
constexpr std::uint64_t highest_change = std::uint64_t{1} << 52;

namespace fs = std::filesystem;

constexpr std::size_t longest_name = 100;

// Without a / at the end, so that the folder has a name and a parent.
fs::path whole_path(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

std::string settings_text(const std::string& name, const std::vector<std::string>& buses) {
  std::string text = fmt::format("name = {}\nschema = {}\n", line::toml_quoted(name), Project::schema);
  for (const std::string& bus : buses) {
    const std::size_t equals = bus.rfind('=');
    text += fmt::format("\n[[bus]]\nlink = {}\n", line::toml_quoted(bus.substr(0, equals)));
    if (equals == std::string::npos) continue;
    std::string drives;
    for (const char letter : bus.substr(equals + 1)) drives += letter == ',' ? ", " : std::string(1, letter);
    text += fmt::format("drives = [{}]\n", drives);
  }
  return text;
}

// The bus in the form of --bus.
std::string read_bus(const toml::table& table, line::FileReport& report) {
  line::TableReader reader(table, "bus", report);
  std::string link;
  reader.read("link", link);
  if (link.empty()) reader.complain("link", "the link is missing", "write link = \"socketcan:can0\"");
  std::vector<std::int64_t> drives;
  if (const toml::node* node = reader.node("drives")) {
    const toml::array* list = node->as_array();
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
      drives.push_back((*list)[i].value<std::int64_t>().value_or(0));
    }
    const auto is_wrong = [](std::int64_t number) { return number < 1 || number > 65535; };
    if (drives.empty() || std::any_of(drives.begin(), drives.end(), is_wrong)) {
      reader.complain("drives", "it is no list of numbers of drives", "write drives = [1, 3], or leave the key out");
    }
  }
  reader.finish();
  return drives.empty() ? link : fmt::format("{}={}", link, fmt::join(drives, ","));
}

}  // namespace

std::vector<std::string> Project::make(const fs::path& folder, const std::vector<std::string>& buses,
                                       std::string_view line) {
  std::vector<std::string> made;
  const fs::path whole = whole_path(folder);
  std::error_code error;
  if (!fs::exists(whole, error)) {
    fs::create_directories(whole, error);
    if (error) throw ProjectError(folder, "cannot be made: " + error.message(), "check path, rights and disk");
    made.emplace_back(".");
  } else if (!fs::is_directory(whole, error)) {
    throw ProjectError(folder, "is a file and no folder", "give the name of a folder");
  }
  const auto make_file = [&](const char* name, std::string_view text) {
    if (const std::error_code failed = links::replace_file(whole / name, text))
      throw ProjectError(folder / name, failed);
    made.emplace_back(name);
  };
  if (fs::exists(whole / "project.toml", error)) {
    throw ProjectError(folder / "project.toml", "exists already", "open the project without --new");
  }
  // The settings come last: a folder with them is a project.
  if (buses.empty() && !fs::exists(whole / "line.toml", error)) make_file("line.toml", line);
  const std::string name = whole.filename().string();
  make_file("project.toml", settings_text(name.empty() ? "project" : name.substr(0, longest_name), buses));
  return made;
}

Project::Project(const fs::path& folder) : folder_(whole_path(folder)) {
  std::error_code error;
  if (!fs::exists(folder_ / "project.toml", error)) {
    throw ProjectError(folder_, "there is no project here: the file project.toml is missing",
                       "make one with --new, or check the path");
  }
  lock();
  read_settings();
  read_states();
  read_changes();
}

void Project::lock() {
  std::error_code error;
  lock_ = links::FolderLock::take(folder_, error);
  if (error == std::errc::device_or_resource_busy) {
    throw ProjectError(folder_, "another server has this project open", "end it, or use its page");
  }
  if (error) unlocked_ = fmt::format("{}: cannot be locked: {}", folder_.string(), error.message());
}

void Project::read_settings() {
  const fs::path file = folder_ / "project.toml";
  line::FileReport report;
  report.file = file.string();
  const auto text = line::read_text_file(report.file, "the settings of a project", report.diagnostics);
  const auto table = text ? line::parse_toml(*text, report.file, report.diagnostics) : std::nullopt;
  if (!table) throw ProjectError(report.diagnostics);
  line::TableReader reader(*table, "", report);
  std::int64_t version = 0;
  reader.read("schema", version);
  if (version != schema && report.diagnostics.empty()) {
    reader.complain("schema", fmt::format("this program reads projects of schema {}", schema),
                    version > schema ? "use a newer version of the program" : "write schema = 1");
    throw ProjectError(report.diagnostics);  // another schema has other keys
  }
  reader.read("name", name_);
  if (name_.empty() || name_.size() > longest_name) {
    reader.complain("name", "a project has a name of at most 100 bytes", "write name = \"my machine\"");
  }
  for (const toml::table* bus : reader.tables("bus")) buses_.push_back(read_bus(*bus, report));
  reader.finish();
  if (!report.diagnostics.empty()) throw ProjectError(report.diagnostics);
}

void Project::read_states() {
  for (const std::string& name : names_in(folder_ / "state", ".json")) {
    if (!is_state_name(name)) {
      throw ProjectError(state_file(name), "this is no name of a state",
                         "rename it: at most 64 letters, digits, \".\", \"-\" and \"_\", a letter or digit first");
    }
    const auto text = read_file(state_file(name));
    if (parse_json(text.value_or(""), state_file(name)).is_null()) {
      throw ProjectError(state_file(name), "null is no state", "correct the file, or delete it", 1, 1);
    }
    states_[name] = {text, text};
  }
}

void Project::read_changes() {
  const std::string text = read_file(changes_file()).value_or("");
  std::uint32_t line = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view one = std::string_view(text).substr(at, end - at);
    at = end + 1;
    ++line;
    // A power cut in the middle of a write leaves a part of a line. The next write removes it.
    if (end == text.size() && !nlohmann::json::accept(one)) break;
    nlohmann::json change = parse_json(one, changes_file(), line);
    const auto number = change.find("number");
    if (!change.is_object() || number == change.end() || !number->is_number_unsigned() ||
        !change.value("axis", nlohmann::json()).is_string()) {
      throw ProjectError(changes_file(), "is no change: number or axis is missing", "correct or delete the line", line,
                         1);
    }
    if (number->get<std::uint64_t>() > highest_change) {
      throw ProjectError(changes_file(), fmt::format("the number of a change is above {}", highest_change),
                         "correct or delete the line", line, 1);
    }
    last_change_ = std::max(last_change_, number->get<std::uint64_t>());
    earlier_changes_.push_back(std::move(change));
    if (earlier_changes_.size() > 2 * most_earlier_changes) {
      earlier_changes_.erase(earlier_changes_.begin(), earlier_changes_.end() - most_earlier_changes);
    }
  }
  if (earlier_changes_.size() > most_earlier_changes) {
    earlier_changes_.erase(earlier_changes_.begin(), earlier_changes_.end() - most_earlier_changes);
  }
}

bool Project::is_state_name(std::string_view name) {
  constexpr std::size_t longest = 64;
  const auto is_plain = [](unsigned char letter) { return letter < 0x80 && std::isalnum(letter) != 0; };
  return !name.empty() && name.size() <= longest && is_plain(static_cast<unsigned char>(name.front())) &&
         std::all_of(name.begin(), name.end(), [&](unsigned char letter) {
           return is_plain(letter) || letter == '.' || letter == '-' || letter == '_';
         });
}

void Project::set_state(const std::string& name, const nlohmann::json& value) {
  std::string text = file_text(value);
  parse_json(text, state_file(name));
  const bool is_new = !states_.contains(name);
  if (is_new && states_.size() >= most_states) {
    throw ProjectError(folder_ / "state", fmt::format("it has {} files already", most_states), "delete some of them");
  }
  states_[name].text = std::move(text);
  unsaved_.insert(name);
}

void Project::remove_state(const std::string& name) {
  const auto found = states_.find(name);
  if (found == states_.end()) return;
  found->second.text.reset();
  unsaved_.insert(name);
}

void Project::note_saved(const std::string& name, const std::optional<std::string>& text) {
  State& state = states_[name];
  state.on_disk = text;
  if (state.text != text) return;  // it has changed since
  unsaved_.erase(name);
  if (!text) states_.erase(name);
}

}  // namespace servodrome::studio
