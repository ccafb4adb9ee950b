// The change log of virtual drives of every product, and the undo.
#include "api/change_log.hpp"

#include <gmock/gmock.h>
#include <map>
#include <random>

#include "api/author.hpp"
#include "catalogue/product.hpp"
#include "catalogue/terminal_words.hpp"
#include "commissioning_rig.hpp"
#include "draws.hpp"

namespace servodrome::studio {
namespace change_log_test {
namespace {

using api::Change;
using api::ChangeLog;
using api::Method;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using namespace std::chrono_literals;

constexpr dictionary::Entry parameter_entry() {
  dictionary::Entry entry;
  entry.index = 0x2000;
  entry.name = "Parameter";
  return entry;
}

Change change_of(const dictionary::Entry& entry, std::uint32_t before, std::uint32_t after) {
  Change change;
  change.entry = &entry;
  change.object_name = entry.name;
  change.before = api::KeptValue(std::as_bytes(std::span(&before, 1)));
  change.after = api::KeptValue(std::as_bytes(std::span(&after, 1)));
  return change;
}

TEST(ChangeLogRing, KeepsTheLastChangesAndCountsTheDroppedOnes) {
  const dictionary::Entry entry = parameter_entry();
  ChangeLog log({"x"}, 3);
  EXPECT_GT(log.oldest(), log.newest());
  for (std::uint32_t i = 0; i < 5; ++i) log.add(change_of(entry, i, i + 1), "test");
  EXPECT_EQ(log.dropped(), 2U);
  EXPECT_EQ(log.oldest(), 3U);
  EXPECT_EQ(log.newest(), 5U);
  for (std::uint32_t number = 3; number <= 5; ++number) {
    EXPECT_EQ(log.at(number).number, number);
    EXPECT_EQ(log.at(number).after, change_of(entry, 0, number).after);
  }
}

TEST(ChangeLogRing, LeavesOutMotionsAndUnchangedValues) {
  const dictionary::Entry entry = parameter_entry();
  dictionary::Entry target = entry;
  target.index = 0x607A;
  ChangeLog log({"x"});
  log.add(change_of(entry, 7, 7), "test");
  log.add(change_of(target, 1, 2), "test");
  EXPECT_EQ(log.newest(), 0U);
}

TEST(ChangeLogRing, ALongNameIsCutAndALongValueIsNotKept) {
  const dictionary::Entry entry = parameter_entry();
  ChangeLog log({"x"});
  Change change = change_of(entry, 1, 2);
  const std::array<std::byte, api::KeptValue::most_bytes + 1> text{};
  change.before = api::KeptValue(text);
  EXPECT_FALSE(change.before.known());
  log.add(change, std::string(100, 'a'));
  EXPECT_EQ(log.at(1).author(), std::string(47, 'a'));
}

TEST(Author, IsRestoredAtTheEndOfItsLife) {
  EXPECT_EQ(api::Author::present(), "");
  {
    const api::Author outer("page");
    {
      const api::Author inner("undo by " + api::Author::present());
      EXPECT_EQ(api::Author::present(), "undo by page");
    }
    EXPECT_EQ(api::Author::present(), "page");
  }
  EXPECT_EQ(api::Author::present(), "");
}

class ChangesOf : public CommissioningRig, public testing::WithParamInterface<std::string> {
 protected:
  void put(const std::string& object, std::int64_t value) {
    json_of(Method::put, "axes/" + axis_ + "/objects/" + object, json{{"value", value}}.dump());
  }
  // Writes like a master on the fieldbus.
  dictionary::AbortCode master_writes(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    dictionary::Dictionary& dictionary = line_.find_axis(axis_)->device().bus_dictionary();
    const dictionary::Entry* entry = dictionary.find(index, sub);
    if (entry == nullptr) return dictionary::AbortCode::object_does_not_exist;
    const auto bytes = dictionary::encode_number(value);
    return dictionary.write(*entry, std::span(bytes).first(dictionary::size_of(entry->type)));
  }
  json changes(const std::string& query = {}) {
    return get("changes?axis=" + axis_ + (query.empty() ? "" : "&" + query))["changes"];
  }
  json undo(const json& body) { return json_of(Method::post, "changes/undo", body.dump()); }
  api::Response ask_undo(const json& body) { return ask(Method::post, "changes/undo", body.dump()); }

  std::string axis_ = GetParam();
};
INSTANTIATE_TEST_SUITE_P(Products, ChangesOf, testing::ValuesIn(names_of_products()), name_of_test);

TEST_P(ChangesOf, TellWhoWroteWhatAndWhen) {
  client_ = "page";
  const json before = value(axis_, "6081/0");
  put("6081/0", 4321);
  pass(10ms);
  ASSERT_EQ(master_writes(0x6081, 0, 4322), dictionary::AbortCode::none);
  const json rows = changes();
  ASSERT_EQ(rows.size(), 2U) << rows.dump();
  EXPECT_EQ(rows[0]["who"], "API (page)");
  EXPECT_EQ(rows[0]["object"], "6081:00");
  EXPECT_EQ(rows[0]["before"], before);
  EXPECT_EQ(rows[0]["after"], 4321);
  EXPECT_EQ(rows[1]["before"], 4321);
  EXPECT_EQ(rows[1]["after"], 4322);
  EXPECT_THAT(rows[1]["who"].get<std::string>(), HasSubstr("SDO on "));
  EXPECT_EQ(rows[1]["time_ns"].get<std::int64_t>() - rows[0]["time_ns"].get<std::int64_t>(), 10'000'000);
  EXPECT_THAT(rows[0]["wall"].get<std::string>(), testing::MatchesRegex("20..-..-..T..:..:..\\....Z"));
}

TEST_P(ChangesOf, AJobIsNamedAndItsMotionIsLeftOut) {
  json_of(Method::post, "axes/" + axis_ + "/jobs", R"({"do": "enable"})");
  pass(3s);
  json_of(Method::post, "axes/" + axis_ + "/jobs",
          R"({"do": "move", "by": 0.1, "velocity": 2.5, "units": "revolutions"})");
  pass(3s);
  bool has_velocity = false;
  for (const json& row : changes()) {
    EXPECT_THAT(row["who"].get<std::string>(), HasSubstr("job ")) << row.dump();
    EXPECT_FALSE(row["object"] == "6040:00" || row["object"] == "607A:00") << row.dump();
    if (row["object"] == "6081:00") has_velocity = row["who"] == "job 2 (move)";
  }
  EXPECT_TRUE(has_velocity) << changes().dump();
}

TEST_P(ChangesOf, OneIsUndoneAndTheUndoIsAChange) {
  const json before = value(axis_, "6081/0");
  put("6081/0", 4321);
  const json number = changes()[0]["number"];
  const json report = undo({{"number", number}});
  ASSERT_EQ(report["undone"].size(), 1U) << report.dump();
  EXPECT_EQ(report["undone"][0]["from"], 4321);
  EXPECT_EQ(report["undone"][0]["to"], before);
  EXPECT_EQ(value(axis_, "6081/0"), before);
  const json rows = changes("since=" + number.dump());
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0]["who"], "undo by API");
  // The undo of the undo.
  undo({{"number", rows[0]["number"]}});
  EXPECT_EQ(value(axis_, "6081/0"), 4321);
}

TEST_P(ChangesOf, AValueThatWasChangedSinceStaysAndIsNamed) {
  put("6081/0", 4321);
  put("6083/0", 777);
  ASSERT_EQ(master_writes(0x6081, 0, 4322), dictionary::AbortCode::none);
  const api::Response response = ask_undo({{"number", changes()[0]["number"]}});
  EXPECT_EQ(response.status, 409U);
  EXPECT_THAT(response.body, HasSubstr("has changed the value since"));
  EXPECT_EQ(value(axis_, "6081/0"), 4322);
  // Of the values that the API wrote, the other one is undone.
  const json report = undo({{"axis", axis_}, {"who", "API"}});
  ASSERT_EQ(report["undone"].size(), 1U) << report.dump();
  EXPECT_EQ(report["undone"][0]["object"], "6083:00");
  ASSERT_EQ(report["kept"].size(), 1U) << report.dump();
  EXPECT_EQ(report["kept"][0]["object"], "6081:00");
  EXPECT_EQ(value(axis_, "6081/0"), 4322);
}

TEST_P(ChangesOf, AValueThatAPowerCycleTookStays) {
  put("6081/0", 4321);
  json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "cycle"})");
  pass(500ms);
  const json now = value(axis_, "6081/0");
  if (now == 4321) return;  // this drive stores each value immediately
  const json report = undo({{"axis", axis_}});
  EXPECT_EQ(report["undone"].size(), 0U);
  EXPECT_EQ(value(axis_, "6081/0"), now);
}

TEST_P(ChangesOf, CommandsAreLoggedButNotUndone) {
  const json mode = value(axis_, "6060/0");
  put("6060/0", mode == 3 ? 1 : 3);
  ASSERT_EQ(changes().size(), 1U);
  const api::Response response = ask_undo({{"number", changes()[0]["number"]}});
  EXPECT_EQ(response.status, 409U);
  EXPECT_THAT(response.body, HasSubstr("command"));
  EXPECT_EQ(undo({{"axis", axis_}})["kept"].size(), 1U);
  EXPECT_NE(value(axis_, "6060/0"), mode);
}

TEST_P(ChangesOf, WrongRequestsAreRefused) {
  EXPECT_EQ(ask(Method::get, "changes?axis=nobody").status, 404U);
  EXPECT_EQ(ask(Method::get, "changes?since=x").status, 400U);
  EXPECT_EQ(ask(Method::get, "changes?axes=" + axis_).status, 400U);
  EXPECT_EQ(ask(Method::get, "changes?limit=0").status, 422U);
  EXPECT_EQ(ask(Method::get, "changes?limit=1001").status, 422U);
  EXPECT_EQ(ask_undo({{"number", 999}}).status, 404U);
  EXPECT_EQ(ask_undo({{"axis", "nobody"}}).status, 404U);
  EXPECT_EQ(ask_undo(json::object()).status, 400U);
  EXPECT_EQ(ask_undo({{"axis", axis_}, {"number", 1}}).status, 400U);
  EXPECT_EQ(ask_undo({{"axis", axis_}, {"all", true}}).status, 400U);
  EXPECT_EQ(ask_undo({{"axis", axis_}, {"whom", "x"}}).status, 400U);
  json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "off"})");
  EXPECT_EQ(ask_undo({{"axis", axis_}}).status, 409U);
}

TEST_P(ChangesOf, AreShownInPages) {
  for (int i = 1; i <= 5; ++i) put("6081/0", 4000 + i);
  json page = get("changes?limit=2");
  EXPECT_EQ(page["changes"].size(), 2U);
  EXPECT_EQ(page["left_out"], 3);
  EXPECT_EQ(page["changes"][0]["after"], 4001);
  page = get("changes?limit=2&since=" + page["next"].dump());
  EXPECT_EQ(page["changes"][0]["after"], 4003);
  page = get("changes?limit=2&newest=true");
  EXPECT_EQ(page["changes"][1]["after"], 4005);
  EXPECT_EQ(get("changes?since=" + page["next"].dump())["changes"], json::array());
}

// Random writes of the API and of a master (parameters, commands and process data settings), with undos in between.
// After everything is undone, each object has its first value, or the undo names the object with a reason. The axis
// never moves.
TEST_P(ChangesOf, AfterAllIsUndoneEachObjectHasItsFirstValue) {
  line::Axis& axis = *line_.find_axis(axis_);
  const catalogue::ParameterRules& rules = catalogue::product_of(axis_).rules;
  std::vector<const dictionary::Entry*> objects;
  for (const dictionary::Entry& entry : axis.device().bus_dictionary().table()) {
    // Excludes commands, which store, restore or reset, and inputs, one of which may enable the drive.
    const master::ObjectAddress address{entry.index, entry.sub};
    if (entry.access == dictionary::Access::rw && entry.fixed_size() && !rules.is_connection(address) &&
        (!rules.is_command(address) || entry.index == 0x6060) &&
        catalogue::find_terminal(axis_, entry.index, entry.sub) == nullptr) {
      objects.push_back(&entry);
    }
  }
  std::mt19937 random(1);
  const auto below = [&random](std::size_t count) { return random() % count; };
  const auto value_now = [&](const dictionary::Entry& entry) { return axis.device().bus_dictionary().number(entry); };
  const std::int64_t angle = axis.plant().position_counts();
  std::size_t written = 0;
  std::size_t undone = 0;
  for (int draw = 0; draw < test::draws(30); ++draw) {
    const std::uint64_t begin = changes_.log().newest();
    // Before the random draw, because some objects share one value in two units (607Fh and 6080h of the iSMK).
    std::map<std::uint32_t, std::int64_t> present;
    for (const dictionary::Entry* entry : objects) present[entry->key()] = value_now(*entry);
    std::map<std::uint32_t, std::pair<const dictionary::Entry*, std::int64_t>> first;
    for (std::size_t i = 0, count = 1 + below(40); i < count; ++i) {
      const dictionary::Entry& entry = *objects[below(objects.size())];
      const std::int64_t former = value_now(entry);
      const std::uint64_t noted = changes_.log().newest();
      const std::array<std::int64_t, 4> proposals{former + 1, former - 1, 0, static_cast<std::int64_t>(below(5000))};
      const std::int64_t proposal = proposals[below(proposals.size())];
      if (below(2) == 0) {
        if (master_writes(entry.index, entry.sub, proposal) != dictionary::AbortCode::none) continue;
      } else {
        const api::Response response =
            ask(Method::put, fmt::format("axes/{}/objects/{:04X}/{:02X}", axis_, entry.index, entry.sub),
                json{{"value", proposal}}.dump());
        if (response.status >= 300) continue;
      }
      ++written;
      if (changes_.log().newest() > noted) first.try_emplace(entry.key(), &entry, present[entry.key()]);
      if (below(10) == 0) ask_undo({{"number", changes_.log().newest()}});
      if (below(10) == 0) pass(1ms);
    }
    const json report = undo({{"axis", axis_}, {"since", begin}});
    undone += report["undone"].size();
    std::map<std::string, std::string> kept;
    for (const json& one : report["kept"]) {
      kept[one["object"]] = one["what"];
      EXPECT_FALSE(one["what"].get<std::string>().empty());
    }
    for (const auto& [key, one] : first) {
      const std::string name = text_of(master::ObjectAddress{one.first->index, one.first->sub});
      if (kept.contains(name)) continue;
      EXPECT_EQ(value_now(*one.first), one.second) << name << " in draw " << draw;
    }
    // A second undo of the same change has no effect.
    EXPECT_EQ(undo({{"axis", axis_}, {"since", begin}})["undone"], json::array()) << "draw " << draw;
  }
  EXPECT_GT(written, static_cast<std::size_t>(test::draws(100)));
  EXPECT_GT(undone, static_cast<std::size_t>(test::draws(50)));
  EXPECT_EQ(axis.plant().position_counts(), angle);
  EXPECT_NE(get("axes/" + axis_)["state"], "operation enabled");
}

// A change of a limit, a gain or a mapping can move an axis with torque.
TEST_P(ChangesOf, AnUndoDoesNotMoveAnAxis) {
  put("6083/0", 54321);
  put("6081/0", 4321);
  json_of(Method::post, "axes/" + axis_ + "/jobs", R"({"do": "enable"})");
  pass(3s);
  ASSERT_EQ(get("axes/" + axis_)["state"], "operation enabled");
  const std::int64_t demand = value(axis_, "6064/0").get<std::int64_t>();
  const json report = undo({{"axis", axis_}});
  EXPECT_EQ(report["undone"], json::array());
  EXPECT_THAT(report["kept"].dump(), HasSubstr("the axis has torque, and the value could move it"));
  EXPECT_EQ(value(axis_, "6081/0"), 4321);
  pass(1s);
  EXPECT_NEAR(static_cast<double>(value(axis_, "6064/0").get<std::int64_t>()), static_cast<double>(demand), 20.0);
  EXPECT_EQ(get("axes/" + axis_)["state"], "operation enabled");
}

// The undo of all axes.
class ChangesOfALine : public CommissioningRig {
 protected:
  void SetUp() override {
    for (const std::string& axis : axes_) first_[axis] = value(axis, "6083/0");
    for (const std::string& axis : axes_) put(axis, "6083/0", 4321);
  }
  void put(const std::string& axis, const std::string& object, std::int64_t value) {
    json_of(Method::put, "axes/" + axis + "/objects/" + object, json{{"value", value}}.dump());
  }
  json undo(const json& body) { return json_of(Method::post, "changes/undo", body.dump()); }
  // The reasons of an answer, by axis.
  static std::map<std::string, std::string> kept(const json& answer) {
    std::map<std::string, std::string> reasons;
    for (const json& one : answer["kept"]) reasons[one["axis"]] = one["what"];
    return reasons;
  }

  std::vector<std::string> axes_ = names_of_products();
  std::map<std::string, json> first_{};
};

TEST_F(ChangesOfALine, AreUndoneInEachDrive) {
  const json answer = undo({{"all", true}});
  EXPECT_EQ(answer["undone"].size(), axes_.size());
  EXPECT_EQ(answer["kept"], json::array());
  for (const std::string& axis : axes_) EXPECT_EQ(value(axis, "6083/0"), first_[axis]) << axis;
}

// A drive with torque and one without power keep their values, with the reason, and the others are undone.
TEST_F(ChangesOfALine, ADriveThatCannotIsNamedAndTheOthersGoOn) {
  const std::string with_torque = axes_[0];
  const std::string without_power = axes_[1];
  json_of(Method::post, "axes/" + with_torque + "/jobs", R"({"do": "enable"})");
  pass(3s);
  json_of(Method::post, "axes/" + without_power + "/power", R"({"action": "off"})");
  const json answer = undo({{"all", true}, {"who", "API"}});
  EXPECT_EQ(answer["undone"].size(), axes_.size() - 2);
  EXPECT_EQ(kept(answer),
            (std::map<std::string, std::string>{{with_torque, "the axis has torque, and the value could move it"},
                                                {without_power, "the axis has no power"}}));
  EXPECT_EQ(value(with_torque, "6083/0"), 4321);
  for (std::size_t i = 2; i < axes_.size(); ++i) EXPECT_EQ(value(axes_[i], "6083/0"), first_[axes_[i]]) << axes_[i];
}

// A drive without a change is not reported.
TEST_F(ChangesOfALine, ADriveWithoutAChangeIsNotNamed) {
  const std::uint64_t newest = changes_.log().newest();
  json_of(Method::post, "axes/" + axes_[1] + "/power", R"({"action": "off"})");
  put(axes_[0], "6081/0", 1234);
  const json answer = undo({{"all", true}, {"since", newest}});
  EXPECT_EQ(answer["undone"].size(), 1U);
  EXPECT_EQ(answer["kept"], json::array());
}

TEST_F(ChangesOfALine, APreviewWritesNothingAndForetellsTheUndo) {
  const std::uint64_t newest = changes_.log().newest();
  json preview = undo({{"all", true}, {"preview", true}});
  EXPECT_EQ(changes_.log().newest(), newest);
  for (const std::string& axis : axes_) EXPECT_EQ(value(axis, "6083/0"), 4321) << axis;
  EXPECT_EQ(undo({{"all", true}}), preview);
}

// What was written after the list was shown stays.
TEST_F(ChangesOfALine, ChangesAfterThePreviewStay) {
  const json preview = undo({{"all", true}, {"preview", true}});
  put(axes_[0], "6083/0", 777);
  put(axes_[1], "6081/0", 1234);
  const json answer = undo({{"all", true}, {"until", preview["until"]}});
  EXPECT_EQ(answer["undone"].size(), axes_.size() - 1);
  EXPECT_THAT(kept(answer)[axes_[0]], HasSubstr("has changed the value since"));
  EXPECT_EQ(value(axes_[0], "6083/0"), 777);
  EXPECT_EQ(value(axes_[1], "6081/0"), 1234);
}

// A drive that could not be undone when the list was shown, and now could.
TEST_F(ChangesOfALine, ValuesThatAreNotInTheListStay) {
  json_of(Method::post, "axes/" + axes_[0] + "/jobs", R"({"do": "enable"})");
  pass(3s);
  const json preview = undo({{"all", true}, {"who", "API"}, {"preview", true}});
  json only = json::array();
  for (const json& one : preview["undone"]) only.push_back(one["number"]);
  json_of(Method::post, "axes/" + axes_[0] + "/jobs", R"({"do": "disable"})");
  pass(3s);
  const json answer = undo({{"all", true}, {"who", "API"}, {"until", preview["until"]}, {"only", only}});
  EXPECT_EQ(answer["undone"], preview["undone"]);
  EXPECT_EQ(kept(answer), (std::map<std::string, std::string>{{axes_[0], "the value is not in the list of the undo"}}));
  EXPECT_EQ(value(axes_[0], "6083/0"), 4321);
  EXPECT_EQ(ask(Method::post, "changes/undo", R"({"all": true, "only": 3})").status, 400U);
  EXPECT_EQ(ask(Method::post, "changes/undo", R"({"all": true, "only": [-3]})").status, 400U);
}

// Settings of process data are undone write by write: a preview lists each of them.
TEST_F(ChangesOfALine, APreviewHasAllWritesOfAMapping) {
  const auto id = value("generic402", "1800/1").get<std::int64_t>();
  put("generic402", "1800/1", id | 0x80000000);
  put("generic402", "1A00/0", 0);
  put("generic402", "1A00/1", 0x60640020);
  put("generic402", "1A00/0", 1);
  put("generic402", "1800/1", id);
  const json preview = undo({{"axis", "generic402"}, {"preview", true}});
  EXPECT_EQ(preview["kept"], json::array());
  EXPECT_GT(preview["undone"].size(), 4U);
  EXPECT_EQ(undo({{"axis", "generic402"}, {"until", preview["until"]}}), preview);
}

class InputsOf : public ChangesOf {};
INSTANTIATE_TEST_SUITE_P(Ismk, InputsOf, testing::Values("ismk", "ismk-ea"), name_of_test);

// An input of an iSMK can enable the drive, so an undo must not invert an input.
TEST_P(InputsOf, AreNotChangedByAnUndo) {
  put("2010/1", 0);
  const api::Response response = ask_undo({{"number", changes_.log().newest()}});
  EXPECT_EQ(response.status, 409U);
  EXPECT_THAT(response.body, HasSubstr("an input can move the axis"));
  EXPECT_EQ(value(axis_, "2010/1"), 0);
}

}  // namespace
}  // namespace change_log_test
}  // namespace servodrome::studio
