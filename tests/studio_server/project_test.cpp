// The folder of a project: which files are created, refused and kept, and the state after a crash.
#include "studio/project/project.hpp"

#include <fstream>
#include <gmock/gmock.h>
#include <random>

#include "commissioning_rig.hpp"
#include "draws.hpp"
#include "line/bench/scope/line_scope.hpp"
#include "studio/project/keeper.hpp"
#include "studio/project/routes.hpp"

namespace servodrome::studio {
namespace project_test {
namespace {

namespace fs = std::filesystem;
using api::Method;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
using namespace std::chrono_literals;

// A folder of its own, deleted at the end.
class Folder {
 public:
  Folder() {
    std::string path = (fs::temp_directory_path() / "project-XXXXXX").string();
    path_ = ::mkdtemp(path.data());
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

std::string text_of(const fs::path& file) { return read_file(file).value_or("(none)"); }

void put(const fs::path& file, std::string_view text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

template <typename Act>
std::string complaint_of(Act act) {
  try {
    act();
    return {};
  } catch (const ProjectError& error) {
    return error.what();
  }
}

std::string complaint(const fs::path& folder) {
  return complaint_of([&] { const Project project(folder); });
}

TEST(Project, IsMadeOnceAndOpened) {
  const Folder folder;
  EXPECT_THAT(complaint(folder / "machine"), HasSubstr("there is no project here"));
  EXPECT_FALSE(fs::exists(folder / "machine"));
  EXPECT_THAT(Project::make(folder / "machine/", {}, "# a line\n"), ElementsAre(".", "line.toml", "project.toml"));
  EXPECT_EQ(text_of(folder / "machine/project.toml"), "name = \"machine\"\nschema = 1\n");
  EXPECT_EQ(text_of(folder / "machine/line.toml"), "# a line\n");
  {
    const Project project(folder / "machine");
    EXPECT_EQ(project.name(), "machine");
    EXPECT_THAT(project.buses(), IsEmpty());
  }
  EXPECT_THAT(complaint_of([&] { Project::make(folder / "machine", {}, "# other\n"); }), HasSubstr("exists already"));
  EXPECT_EQ(text_of(folder / "machine/line.toml"), "# a line\n");
  put(folder / "old/line.toml", "# mine\n");
  EXPECT_THAT(Project::make(folder / "old", {}, "# a line\n"), ElementsAre("project.toml"));
  EXPECT_EQ(text_of(folder / "old/line.toml"), "# mine\n");
  put(folder / "file", "");
  EXPECT_THAT(complaint_of([&] { Project::make(folder / "file", {}, ""); }), HasSubstr("is a file and no folder"));
}

TEST(Project, NamesItsBuses) {
  const Folder folder;
  EXPECT_THAT(Project::make(folder / "x", {"socketcan:can0=1,3", "raw:eth1"}, ""), ElementsAre(".", "project.toml"));
  EXPECT_EQ(text_of(folder / "x/project.toml"),
            "name = \"x\"\nschema = 1\n\n[[bus]]\nlink = \"socketcan:can0\"\ndrives = [1, 3]\n\n[[bus]]\nlink = "
            "\"raw:eth1\"\n");
  EXPECT_THAT(Project(folder / "x").buses(), ElementsAre("socketcan:can0=1,3", "raw:eth1"));
}

// A second server is refused, also by another path and after the folder was moved.
TEST(Project, IsOpenOnce) {
  const Folder folder;
  Project::make(folder / "x", {}, "");
  {
    const Project project(folder / "x");
    EXPECT_THAT(complaint(folder / "./x/"), HasSubstr("another server has this project open"));
    fs::rename(folder / "x", folder / "y");
    EXPECT_THAT(complaint(folder / "y"), HasSubstr("another server has this project open"));
  }
  EXPECT_EQ(complaint(folder / "y"), "");
}

TEST(Project, ABadFileIsNamedWithItsPlaceAndStays) {
  const Folder folder;
  Project::make(folder / "x", {}, "");
  const fs::path settings = folder / "x/project.toml";
  const auto is_refused = [&](const fs::path& file, const std::string& text, const std::string& words) {
    put(file, text);
    EXPECT_THAT(complaint(folder / "x"), HasSubstr(file.string() + words)) << text;
    EXPECT_EQ(text_of(file), text);
  };
  is_refused(settings, "name = \"x\"\nschema = \n", ":2:");
  is_refused(settings, "name = \"x\"\nschema = 2\n",
             ":2:10: schema: this program reads projects of schema 1; use a newer");
  is_refused(settings, "name = \"x\"\nschema = 2\ncolour = 3\n",
             ":2:10: schema: this program reads projects of schema 1");
  is_refused(settings, "name = \"\"\nschema = 1\n", ":1:");
  is_refused(settings, "schema = 1\n", ":");
  is_refused(settings, "name = \"x\"\nschema = 1\ncolour = 3\n", ":3:");
  is_refused(settings, "name = \"x\"\nschema = 1\n[[bus]]\ndrives = [1]\n", ":3:");
  is_refused(settings, "name = \"x\"\nschema = 1\n[[bus]]\nlink = \"mem:\"\ndrives = [\"a\"]\n", ":5:");
  is_refused(settings, "name = \"x\"\nschema = 1\n[[bus]]\nlink = \"mem:\"\ndrives = 1\n", ":5:");
  put(settings, "name = \"x\"\nschema = 1\n");
  const fs::path boards = folder / "x/state/boards.json";
  is_refused(boards, "[\n  {\"a\": }\n]\n", ":2:9: is not JSON here");
  is_refused(boards, "", ":1:1: is not JSON here");
  is_refused(boards, "[1, 1e999]\n", ":1:1: has a number that is too large");
  is_refused(boards, std::string(1000, '['), ":1:1: is nested more than 31 levels deep");
  is_refused(boards, "null", ":1:1: null is no state");
  fs::remove(boards);
  const fs::path wrong = folder / "x/state/bad name.json";
  is_refused(wrong, "1", ": this is no name of a state");
  fs::remove(wrong);
  fs::remove(folder / "x/state");
  is_refused(folder / "x/state", "no folder", ": is a file and no folder");
  fs::remove(folder / "x/state");
  const fs::path changes = folder / "x/changes.jsonl";
  is_refused(changes, "{\"axis\": \"x\", \"number\": 1}\n{\"axis\"\n", ":2:8: is not JSON here");
  is_refused(changes, "{\"axis\": \"x\", \"number\": 1}\n{\"new\": -1e999}\n", ":2:1: has a number that is too large");
  is_refused(changes, "{\"axis\": \"x\", \"number\": 1}\n{\"axis\": \"x\"}\n", ":2:1: is no change");
  is_refused(changes, "{\"axis\": \"x\", \"number\": 18446744073709551614}\n",
             ":1:1: the number of a change is above 4503599627370496");
  fs::remove(changes);
  EXPECT_EQ(complaint(folder / "x"), "");
}

TEST(Project, FilesOfJsonHaveSortedKeysAndALineForEachValue) {
  EXPECT_EQ(
      file_text(json::parse(R"({"b": [1, 2.5, "x"], "a": {"d": [], "c": [[1], {"e": null}]}})")),
      "{\n  \"a\": {\n    \"c\": [\n      [1],\n      {\n        \"e\": null\n      }\n    ],\n    \"d\": []\n  },\n"
      "  \"b\": [1, 2.5, \"x\"]\n}\n");
  EXPECT_EQ(file_text(7), "7\n");
}

// Random values are read again as they were written.
TEST(Project, RandomValuesAreReadAgain) {
  std::mt19937 random(1);
  const auto value = [&](auto&& self, int depth) -> json {
    switch (random() % (depth > 3 ? 4 : 6)) {
      case 0: return static_cast<std::int64_t>(random());
      case 1: return static_cast<double>(random()) / 7;
      case 2: return std::string(random() % 20, static_cast<char>(random() % 127 + 1));
      case 3: return random() % 2 == 0;
      case 4: return json::array({self(self, depth + 1), self(self, depth + 1)});
      default: return json{{std::to_string(random() % 10), self(self, depth + 1)}, {"x", self(self, depth + 1)}};
    }
  };
  for (int i = 0; i < test::draws(300); ++i) {
    const json one = value(value, 0);
    EXPECT_EQ(parse_json(file_text(one), "file"), one);
  }
}

TEST(Project, StatesHaveNamesAndALimit) {
  const Folder folder;
  Project::make(folder / "x", {}, "");
  Project project(folder / "x");
  for (const char* name : {"", ".", "..", "../x", "a/b", ".git", "a b", "ä", "-x"}) {
    EXPECT_FALSE(Project::is_state_name(name)) << name;
  }
  EXPECT_TRUE(Project::is_state_name("guide.axis-1"));
  json deep = 1;
  for (int i = 0; i < 70; ++i) deep = json::array({std::move(deep)});
  EXPECT_THROW(project.set_state("boards", deep), ProjectError);
  EXPECT_THAT(project.states(), IsEmpty());
  for (std::size_t i = 0; i < Project::most_states; ++i) project.set_state(fmt::format("s{}", i), i);
  EXPECT_THROW(project.set_state("more", 1), ProjectError);
  project.set_state("s1", "changed");  // one that exists
}

class ProjectOfLine : public CommissioningRig {
 protected:
  ProjectOfLine() : CommissioningRig(std::string(line::test::two_axes)) { open(); }

  // Like a new run of the server.
  void open() {
    close();
    if (!fs::exists(folder_ / "x")) Project::make(folder_ / "x", {}, "");
    project_.emplace(folder_ / "x");
    routes_.emplace(&*project_);
    scope_.emplace(line_);
    log_.emplace(changes_.log().axes());
    io_.emplace();
    keeper_.emplace(*io_, *project_, *log_, scope_->scope().recordings(), [this] { ++told_; });
  }
  void close() {
    keeper_.reset();
    scope_.reset();
    project_.reset();
  }
  api::Response ask(Method method, const std::string& target, const std::string& body = {}) {
    const std::array groups{routes_->group(), api::RouteGroup{api::recording_routes(), &scope_->scope()}};
    return line::bench::handle(line_, {.method = method, .target = "/api/v1/" + target, .body = body}, groups);
  }
  json shown(const std::string& target) { return json::parse(ask(Method::get, target).body); }
  std::shared_ptr<api::Recording> recorded(const std::string& name, int duration_ms = 20) {
    const json begun = json::parse(
        ask(Method::post, "recordings",
            json{{"name", name},
                 {"note", "a\nb"},
                 {"channels",
                  {{{"axis", "left"}, {"signal", "velocity_rpm"}}, {{"axis", "right"}, {"object", "6064:00"}}}},
                 {"duration_ms", duration_ms},
                 {"rate_hz", 1000}}
                .dump())
            .body);
    pass(100ms);
    return scope_->scope().recordings().find(begun["id"]);
  }
  void change(const std::string& object, int value) {
    const std::uint64_t before = changes_.log().newest();
    json_of(Method::put, "axes/right/objects/" + object + "/0", json{{"value", value}}.dump());
    for (std::uint64_t i = before + 1; i <= changes_.log().newest(); ++i) log_->add(changes_.log().at(i), "test");
  }
  void run_keeper(std::chrono::milliseconds span) { io_->run_for(span); }
  std::string complaint_of_files() {
    close();
    return complaint_of([&] { open(); });
  }

  Folder folder_;
  std::optional<boost::asio::io_context> io_;
  std::optional<Project> project_;
  std::optional<ProjectRoutes> routes_;
  std::optional<line::bench::LineScope> scope_;
  std::optional<api::ChangeLog> log_;
  std::optional<ProjectKeeper> keeper_;
  int told_ = 0;
};

TEST_F(ProjectOfLine, IsServed) {
  std::vector<std::string> told;
  routes_->on_event([&](const api::Json& event) { told.push_back(event.dump()); });
  const json project = shown("project")["project"];
  EXPECT_EQ(project["name"], "x");
  EXPECT_EQ(project["schema"], 1);
  EXPECT_TRUE(project["problem"].is_null());
  EXPECT_EQ(ask(Method::put, "project/state/boards", R"({"value": [1]})").status, 204U);
  EXPECT_EQ(shown("project")["project"]["unsaved"], json({"boards"}));
  EXPECT_EQ(shown("project/state"), json::parse(R"({"state": {"boards": [1]}})"));
  EXPECT_EQ(shown("project/state/boards"), json::parse(R"({"value": [1]})"));
  EXPECT_EQ(ask(Method::delete_, "project/state/boards").status, 204U);
  EXPECT_EQ(ask(Method::get, "project/state/boards").status, 404U);
  EXPECT_EQ(shown("project/state"), json::parse(R"({"state": {}})"));
  EXPECT_THAT(told, ElementsAre(R"({"kind":"project","axis":null,"state":"boards","removed":false})",
                                R"({"kind":"project","axis":null,"state":"boards","removed":true})"));
  EXPECT_EQ(ask(Method::put, "project/state/..%2Fx", R"({"value": 1})").status, 422U);
  EXPECT_EQ(ask(Method::put, "project/state/x", "{").status, 400U);
  EXPECT_EQ(ask(Method::put, "project/state/x", R"({"value": null})").status, 422U);
}

TEST(ProjectRoutes, WithoutAProjectSayHowToGetOne) {
  ProjectRoutes routes(nullptr);
  const std::array groups{routes.group()};
  const std::string body = R"({"value": 1})";
  const auto ask = [&](Method method, const std::string& target) {
    return api::begin({.method = method, .target = "/api/v1/" + target, .body = body}, groups);
  };
  EXPECT_EQ(ask(Method::get, "project").body, R"({"project":null})");
  EXPECT_EQ(ask(Method::put, "project/state/x").status, 409U);
  EXPECT_THAT(ask(Method::get, "project/state").body, HasSubstr("servodrome studio FOLDER"));
}

TEST_F(ProjectOfLine, StatesAreWrittenWhileTheServerRuns) {
  project_->set_state("boards", json::parse(R"({"b": 1, "a": 2})"));
  project_->set_state("guide.left", 1);
  run_keeper(1s);
  EXPECT_EQ(text_of(folder_ / "x/state/boards.json"), "{\n  \"a\": 2,\n  \"b\": 1\n}\n");
  EXPECT_THAT(project_->unsaved_states(), IsEmpty());
  project_->remove_state("guide.left");
  project_->set_state("boards", 3);
  keeper_->finish();
  EXPECT_FALSE(fs::exists(folder_ / "x/state/guide.left.json"));
  open();
  EXPECT_EQ(shown("project/state"), json::parse(R"({"state": {"boards": 3}})"));
}

// A file that another program has changed is not overwritten until the user decides.
TEST_F(ProjectOfLine, AFileThatAnotherProgramChangedIsNotOverwritten) {
  project_->set_state("boards", 1);
  run_keeper(1s);
  const fs::path file = folder_ / "x/state/boards.json";
  put(file, "<<<<<<< HEAD\n");
  project_->set_state("boards", 2);
  project_->set_state("other", 3);  // is written nevertheless
  run_keeper(1s);
  EXPECT_EQ(text_of(file), "<<<<<<< HEAD\n");
  EXPECT_EQ(text_of(folder_ / "x/state/other.json"), "3\n");
  ASSERT_TRUE(project_->problem());
  EXPECT_EQ(shown("project")["project"]["problem"]["where"], file.string());
  EXPECT_EQ(told_, 1);
  fs::remove(file);
  run_keeper(3s);
  EXPECT_EQ(text_of(file), "2\n");
  EXPECT_FALSE(project_->problem());
  EXPECT_GE(told_, 2);  // 3 if the file goes while it is read
}

// A folder in place of the file simulates a disk that refuses the write.
TEST_F(ProjectOfLine, WhatCannotBeWrittenIsTriedAgain) {
  fs::create_directories(folder_ / "x/changes.jsonl/in_the_way");
  change("6083", 4321);
  recorded("one");
  run_keeper(1s);
  ASSERT_TRUE(project_->problem());
  EXPECT_THAT(project_->problem()->file, testing::EndsWith("changes.jsonl"));
  EXPECT_TRUE(fs::exists(folder_ / "x/recordings/1.json"));
  fs::remove_all(folder_ / "x/changes.jsonl");
  keeper_->finish();
  EXPECT_FALSE(project_->problem());
  EXPECT_THAT(text_of(folder_ / "x/changes.jsonl"), HasSubstr("4321"));
}

// A writer that was killed before the rename leaves a temporary file next to the old file.
TEST_F(ProjectOfLine, AKilledWriteLeavesTheOldState) {
  project_->set_state("boards", 1);
  keeper_->finish();
  put(folder_ / "x/state/boards.json.part", "{\"half\": ");
  open();
  EXPECT_EQ(shown("project/state"), json::parse(R"({"state": {"boards": 1}})"));
  EXPECT_FALSE(fs::exists(folder_ / "x/state/boards.json.part"));
}

TEST_F(ProjectOfLine, ChangesAreAppendedAsLinesAndShownLater) {
  const fs::path file = folder_ / "x/changes.jsonl";
  run_keeper(300ms);
  EXPECT_FALSE(fs::exists(file));
  change("6083", 4321);
  run_keeper(1s);
  keeper_->finish();
  const std::string first = text_of(file);
  EXPECT_THAT(first, StartsWith("{\"after\":4321,\"axis\":\"right\",\"before\":"));
  EXPECT_EQ(std::count(first.begin(), first.end(), '\n'), 1);

  put(file, first + "{\"half a li");  // a power cut
  open();
  EXPECT_EQ(log_->newest(), 1U);
  EXPECT_GT(log_->oldest(), log_->newest());
  EXPECT_EQ(shown("project/changes?axis=right")["changes"][0]["after"], 4321);
  EXPECT_EQ(shown("project/changes?axis=left")["changes"], json::array());
  change("6081", 4322);
  EXPECT_EQ(log_->at(2).number, 2U);
  keeper_->finish();
  const std::string both = text_of(file);
  EXPECT_THAT(both, StartsWith(first + "{\"after\":4322,"));
  EXPECT_EQ(std::count(both.begin(), both.end(), '\n'), 2);

  put(file, both.substr(0, both.size() - 1));  // an editor that omits the last line end
  open();
  EXPECT_EQ(project_->last_change(), 2U);
  change("6081", 4323);
  keeper_->finish();
  EXPECT_THAT(text_of(file), StartsWith(both + "{\"after\":4323,"));
}

TEST_F(ProjectOfLine, RecordingsAreKeptWithNameAndNote) {
  recorded("first");
  const auto second = recorded("second");
  keeper_->finish();
  EXPECT_THAT(text_of(folder_ / "x/recordings/2.json"), HasSubstr("\"name\": \"second\",\n"));
  EXPECT_THAT(text_of(folder_ / "x/recordings/2.csv"), StartsWith("tick,time_s,left velocity_rpm [rpm]"));
  EXPECT_EQ(ask(Method::put, "recordings/2", R"({"name": "renamed"})").status, 200U);
  EXPECT_EQ(ask(Method::delete_, "recordings/1").status, 204U);
  keeper_->finish();
  EXPECT_THAT(text_of(folder_ / "x/recordings/2.json"), HasSubstr("\"renamed\""));
  EXPECT_FALSE(fs::exists(folder_ / "x/recordings/1.json"));
  EXPECT_FALSE(fs::exists(folder_ / "x/recordings/1.csv"));
  const std::string view = second->view().dump();
  std::vector<double> values;
  for (std::int64_t i = 0; i < second->samples(); ++i) values.push_back(second->value(1, i));

  open();
  ASSERT_EQ(scope_->scope().recordings().all().size(), 1U);
  const api::Recording& kept = *scope_->scope().recordings().all()[0];
  EXPECT_EQ(json::parse(kept.view().dump()), json::parse(view));
  for (std::int64_t i = 0; i < kept.samples(); ++i) EXPECT_EQ(kept.value(1, i), values[static_cast<std::size_t>(i)]);
  EXPECT_EQ(recorded("third")->plan().id, 3U);
}

// The request to delete arrives while the other thread writes the samples.
TEST_F(ProjectOfLine, ARecordingDeletedWhileItIsSavedIsGone) {
  for (int i = 1; i <= 10; ++i) {
    recorded("one");
    run_keeper(ProjectKeeper::period + 1ms * (i % 5));
    EXPECT_EQ(ask(Method::delete_, fmt::format("recordings/{}", i)).status, 204U);
  }
  keeper_->finish();
  EXPECT_TRUE(fs::is_empty(folder_ / "x/recordings"));
}

// The end of the server ends the recording.
TEST_F(ProjectOfLine, ARunningRecordingIsKeptAtTheEnd) {
  recorded("long", 60'000);
  keeper_->finish();
  open();
  ASSERT_EQ(scope_->scope().recordings().all().size(), 1U);
  EXPECT_EQ(scope_->scope().recordings().all()[0]->view()["state"], "stopped");
  EXPECT_GT(scope_->scope().recordings().all()[0]->samples(), 50);
}

TEST_F(ProjectOfLine, ABadRecordingIsNamedWithItsPlace) {
  recorded("one");
  keeper_->finish();
  EXPECT_EQ(complaint_of_files(), "");
  const fs::path csv = folder_ / "x/recordings/1.csv";
  const fs::path about = folder_ / "x/recordings/1.json";
  const std::string good = text_of(csv);
  const std::string good_about = text_of(about);
  const std::size_t third = good.find('\n', good.find('\n') + 1) + 1;
  std::string bad = good;
  bad.insert(third, "x");
  put(csv, bad);
  EXPECT_THAT(complaint_of_files(), HasSubstr("1.csv:3:1: this is no number"));
  put(csv, good.substr(0, third));
  EXPECT_THAT(complaint_of_files(), HasSubstr("1.csv:3:1: it has fewer than 20 samples"));
  fs::remove(csv);
  EXPECT_THAT(complaint_of_files(), HasSubstr("1.csv:2:1: it has fewer than 20 samples"));
  put(csv, good);
  put(about, "{\n \"name\": 1}");
  EXPECT_THAT(complaint_of_files(), HasSubstr("1.json: a key is missing or has the wrong type"));
  put(about, "{\n ");
  EXPECT_THAT(complaint_of_files(), HasSubstr("1.json:2:"));
  const std::vector<std::pair<const char*, json>> outside{
      {"samples", 0}, {"samples", 9e9}, {"stride", 0}, {"first_tick", -1}, {"channels", json::array()}};
  for (const auto& [key, value] : outside) {
    json view = json::parse(good_about);
    view[key] = value;
    put(about, view.dump());
    EXPECT_THAT(complaint_of_files(), HasSubstr("out of range")) << key;
  }
  put(about, good_about);
  put(folder_ / "x/recordings/copy.json", good_about);
  EXPECT_THAT(complaint_of_files(), HasSubstr("copy.json: its name is not the number of a recording"));
  fs::remove(folder_ / "x/recordings/copy.json");
  EXPECT_EQ(complaint_of_files(), "");
}

// An incomplete copy of a project: the samples without their description.
TEST_F(ProjectOfLine, SamplesWithoutADescriptionAreNotOverwritten) {
  recorded("one");
  keeper_->finish();
  const fs::path csv = folder_ / "x/recordings/1.csv";
  const std::string before = text_of(csv);
  fs::remove(folder_ / "x/recordings/1.json");
  open();
  EXPECT_TRUE(scope_->scope().recordings().all().empty());
  EXPECT_EQ(recorded("two")->plan().id, 2U);
  keeper_->finish();
  EXPECT_EQ(text_of(csv), before);
}

}  // namespace
}  // namespace project_test
}  // namespace servodrome::studio
