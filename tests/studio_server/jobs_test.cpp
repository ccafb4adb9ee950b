// Jobs over the bench API, in virtual time: every product on its bus, controlled over its service port.
#include "studio/jobs.hpp"

#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "api/version.hpp"
#include "catalogue/product.hpp"
#include "commissioning_rig.hpp"
#include "draws.hpp"
#include "drive/drive.hpp"
#include "line/bench/line_bench.hpp"
#include "line/support.hpp"
#include "source_dir.hpp"

namespace servodrome::studio {
namespace jobs_test {
namespace {

using namespace std::chrono_literals;
using api::Method;
using api::Response;
using nlohmann::json;
using testing::HasSubstr;

// An axis of each product, named after it, with a travel of 10 revolutions in each direction; its index is at its
// start.
std::string line_of_all() {
  std::string text = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[bus]]
name = "ecat"
type = "ethercat"
)";
  int node = 0;
  for (const line::Product& product : line::all_products()) {
    const bool can = product.fieldbus == line::Fieldbus::can;
    const int counts = product.name == "jmc_ec" ? 4000 : product.name.starts_with("ismk") ? 65536 : 131072;
    text += fmt::format("[[axis]]\nname = \"{0}\"\nproduct = \"{0}\"\nbus = \"{1}\"\n", product.name,
                        can ? "can0" : "ecat");
    if (can) text += fmt::format("node = {}\n", ++node);
    text += fmt::format(
        "[axis.travel]\ncounts_per_unit = {}\nlow_stop = -11\nhigh_stop = 11\nnegative_limit = -10\n"
        "positive_limit = 10\nhome = {{ from = -0.5, to = 0.5 }}\nstart = 0.25\n",
        counts);
  }
  return text;
}

class JobsTest : public testing::Test {
 protected:
  JobsTest() : JobsTest(line_of_all()) {}

  Response ask(Method method, const std::string& target, const std::string& body = {}) {
    const api::RouteGroup group = jobs_.routes();
    return line::bench::handle(line_, {.method = method, .target = "/api/v1/" + target, .body = body}, {&group, 1});
  }
  json get(const std::string& target) {
    const Response response = ask(Method::get, target);
    EXPECT_EQ(response.status, 200U) << target << " " << response.body;
    return json::parse(response.body);
  }
  // Time advances in steps that are no multiple of any period, as in real time.
  void pass(line::Time span) {
    const line::Time end = line_.now() + span;
    while (line_.now() < end) line_.run_until(std::min(end, line_.now() + 7'300us));
  }
  // Begins a job; returns its number.
  std::uint64_t begin(const std::string& axis, const std::string& body) {
    const Response response = ask(Method::post, "axes/" + axis + "/jobs", body);
    EXPECT_EQ(response.status, 201U) << axis << " " << body << " " << response.body;
    if (response.status != 201U) return 0;
    const json job = json::parse(response.body);
    EXPECT_EQ(job["state"], "running");
    EXPECT_EQ(job["axis"], axis);
    return job["id"].get<std::uint64_t>();
  }
  json job(std::uint64_t id) { return get("jobs/" + std::to_string(id)); }
  // Returns the job when it is over.
  json finish(std::uint64_t id, line::Time longest = 60s) {
    const line::Time end = line_.now() + longest;
    while (line_.now() < end && job(id)["state"] == "running") pass(20ms);
    return job(id);
  }
  void expect_done(const std::string& axis, const std::string& body) {
    const json over = finish(begin(axis, body));
    EXPECT_EQ(over["state"], "done") << axis << " " << over.dump();
  }
  double object(const std::string& axis, const std::string& where) {
    return get("axes/" + axis + "/objects/" + where)["value"].get<double>();
  }
  json view(const std::string& axis) { return get("axes/" + axis); }
  bool has(const std::string& axis, const std::string& where) {
    return !get("axes/" + axis + "/values?objects=" + where)["values"][where].is_null();
  }
  double turn(const std::string& axis) { return get("axes/" + axis + "/units")["position_per_revolution"]; }
  double encoder_turn(const std::string& axis) { return get("axes/" + axis + "/geometry")["index_every"]; }
  void make_ready(const std::string& axis) {
    expect_done(axis, R"({"do": "enable"})");
    EXPECT_EQ(view(axis)["state"], "operation enabled") << axis;
  }

  void refused(const std::string& axis, const std::string& body) {
    const Response response = ask(Method::post, "axes/" + axis + "/jobs", body);
    EXPECT_EQ(response.status, 409U) << body << " " << response.body;
    EXPECT_THAT(response.body, HasSubstr("is not the last command of the axis")) << body;
  }
  // A fault that can be reset without a power cycle.
  std::string resettable_fault(const std::string& axis) {
    for (const auto one :
         {drive::Cause::over_voltage, drive::Cause::under_voltage, drive::Cause::i2t, drive::Cause::following_error}) {
      const drive::FaultRow* row = line_.find_axis(axis)->device().drive().row(one);
      if (row == nullptr || row->reset != drive::ResetRule::when_cause_gone || row->reaction == drive::Reaction::none) {
        continue;
      }
      return drive::name(row->cause);
    }
    return "";
  }
  void inject(const std::string& axis, const std::string& cause) {
    ASSERT_EQ(ask(Method::post, "axes/" + axis + "/faults", json{{"inject", cause}}.dump()).status, 200U);
  }

  explicit JobsTest(const std::string& line_file) : line_(line::test::settings_of(line_file)) { pass(300ms); }

  line::Line line_;
  std::chrono::steady_clock::time_point wall_{};
  LineJobs jobs_{line_, [this] { return wall_; }};
};

class EveryProduct : public JobsTest, public testing::WithParamInterface<std::string> {
 protected:
  // As a master does that knows nothing of jobs.
  void enable_by_controlwords(std::initializer_list<int> words) {
    for (const int word : words) {
      const std::string body = json{{"value", word}}.dump();
      EXPECT_EQ(ask(Method::put, "axes/" + axis_ + "/objects/6040/0", body).status, 204U);
      pass(300ms);
    }
    EXPECT_EQ(view(axis_)["state"], "operation enabled");
  }
  void expect_still_at(double position_counts) {
    pass(1s);
    EXPECT_NEAR(view(axis_)["position_counts"].get<double>(), position_counts, encoder_turn(axis_) / 100);
  }

  std::string axis_ = GetParam();
};
INSTANTIATE_TEST_SUITE_P(Jobs, EveryProduct, testing::ValuesIn(names_of_products()), name_of_test);

TEST_F(JobsTest, AreToldAsTheyGo) {
  std::vector<json> told;
  jobs_.jobs().on_event([&told](const api::Json& event) { told.push_back(event); });
  const std::uint64_t enabling = begin("ismc", R"({"do": "enable"})");
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0]["kind"], "job");
  EXPECT_EQ(told[0]["axis"], "ismc");
  EXPECT_EQ(told[0]["job"], job(enabling));
  finish(enabling);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1]["job"], job(enabling));
  EXPECT_EQ(told[1]["job"]["state"], "done");
  EXPECT_GT(told[1]["tick"], told[0]["tick"]);

  const std::uint64_t moving = begin("ismc", R"({"do": "move", "by": 10000000, "velocity": 100000, "beyond": true})");
  pass(50ms);
  ask(Method::delete_, fmt::format("jobs/{}", moving));
  ask(Method::delete_, fmt::format("jobs/{}", moving));  // the job is already about to end
  ASSERT_EQ(told.size(), 4U);
  EXPECT_EQ(told[3]["job"]["ending"], true);
  finish(moving);
  const std::uint64_t running_up = begin("ismc", R"({"do": "velocity", "velocity": 100000})");
  ask(Method::post, "stop");
  ASSERT_EQ(told.size(), 7U);
  EXPECT_EQ(told[4]["job"]["state"], "cancelled");
  EXPECT_EQ(told[6]["job"]["id"], running_up);
  EXPECT_EQ(told[6]["job"]["error"]["what"], "all axes were stopped");
}

constexpr const char* profile = R"("acceleration": 50, "units": "revolutions")";

TEST_P(EveryProduct, IsEnabledHomedMovedAndDisabled) {
  make_ready(axis_);
  expect_done(axis_, fmt::format(R"({{"do": "home", "method": {}, "speed": 2, "zero_speed": 1, "offset": 0, {}}})",
                                 catalogue::product_of(axis_).dialect.cautious_homing_method, profile));
  EXPECT_EQ(view(axis_)["homed"], true);
  const json moved = finish(begin(axis_, fmt::format(R"({{"do": "move", "to": 3, "velocity": 3, {}}})", profile)));
  EXPECT_EQ(moved["state"], "done") << moved.dump();
  EXPECT_NEAR(moved["result"]["position"].get<double>(), 3.0, 0.01);
  EXPECT_GT(moved["result"]["seconds"].get<double>(), 0.9);
  EXPECT_LT(moved["result"]["seconds"].get<double>(), 1.5);
  const double before = view(axis_)["position_counts"];
  const json back = finish(
      begin(axis_, fmt::format(R"({{"do": "move", "by": {}, "velocity": {}}})", std::lround(-turn(axis_)),
                               std::lround(2 * get("axes/" + axis_ + "/units")["velocity_per_rps"].get<double>()))));
  EXPECT_EQ(back["state"], "done") << back.dump();
  pass(100ms);
  EXPECT_NEAR((view(axis_)["position_counts"].get<double>() - before) / encoder_turn(axis_), -1.0, 0.01);
  expect_done(axis_, R"({"do": "disable"})");
  EXPECT_NE(view(axis_)["state"], "operation enabled");
}

TEST_P(EveryProduct, RunsAtAVelocityAndStops) {
  make_ready(axis_);
  expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": -2, {}}})", profile));
  pass(300ms);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), -120.0, 6.0) << "it goes on when the job is done";
  expect_done(axis_, R"({"do": "stop"})");
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
  EXPECT_EQ(view(axis_)["state"], "operation enabled");
}

TEST_P(EveryProduct, AMotionThatFailsHaltsTheMotionBeforeIt) {
  make_ready(axis_);
  expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": -2, {}}})", profile));
  const json over = finish(begin(axis_, R"({"do": "home", "method": 99})"));
  EXPECT_EQ(over["state"], "failed") << over;
  pass(500ms);  // an ISMC has a fault now, and coasts
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

TEST_F(JobsTest, ATuneThatFailsHaltsTheMotionBeforeIt) {
  make_ready("ismc");
  expect_done("ismc", fmt::format(R"({{"do": "velocity", "velocity": 2, {}}})", profile));
  EXPECT_EQ(finish(begin("ismc", R"({"do": "tune"})"))["state"], "failed");
  EXPECT_NEAR(view("ismc")["velocity_rpm"].get<double>(), 0.0, 2.0);
}

TEST_P(EveryProduct, GivesTorqueAndStops) {
  make_ready(axis_);
  // Kinco's drives have no slope (6087h); ESTUN's have no such mode.
  const bool has_slope = !axis_.starts_with("ismk");
  const std::uint64_t torque =
      begin(axis_, has_slope ? R"({"do": "torque", "percent": 4, "slope": 100})" : R"({"do": "torque", "percent": 4})");
  pass(150ms);
  if (axis_ == "pronet") {
    EXPECT_EQ(job(torque)["state"], "failed") << job(torque).dump();
    return;
  }
  EXPECT_NE(job(torque)["state"], "failed") << job(torque).dump();
  EXPECT_GT(view(axis_)["velocity_rpm"].get<double>(), 5.0);
  expect_done(axis_, R"({"do": "stop"})");
  pass(200ms);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

// There and back: the second move must not begin if a halt or a stop came in between.
TEST_F(JobsTest, ASequenceDoesNotGoOnAfterAStop) {
  const std::string axis = "generic402";
  const auto start = [&](const std::string& body, unsigned status) {
    const Response response = ask(Method::post, "axes/" + axis + "/jobs", body);
    EXPECT_EQ(response.status, status) << response.body;
    return json::parse(response.body);
  };
  const auto done = [&](const std::string& body) {
    const json job = start(body, 201);
    pass(2s);
    return std::to_string(job["id"].get<int>());
  };
  const std::string move =
      R"({"do": "move", "by": 1, "velocity": 5, "acceleration": 100, "units": "revolutions", "after": )";
  std::string last = done(R"({"do": "enable"})");
  last = done(move + last + "}");
  last = done(move + last + "}");
  EXPECT_EQ(start(move + "1000000}", 409)["error"]["where"], axis);
  EXPECT_EQ(ask(Method::post, "stop", "any body {").status, 200U) << "a stop stops";
  start(move + last + "}", 409);
  last = done(R"({"do": "enable"})");
  const std::string halt = done(R"({"do": "stop"})");
  start(move + last + "}", 409);
  last = done(move + halt + "}");
  // A controlword of another client, and switching the power, also during the previous job.
  const auto write_controlword = [&] {
    EXPECT_EQ(ask(Method::put, "axes/" + axis + "/objects/6040/0", R"({"value": 15})").status, 204U);
  };
  write_controlword();
  start(move + last + "}", 409);
  last = std::to_string(start(R"({"do": "enable"})", 201)["id"].get<int>());
  write_controlword();
  pass(2s);
  start(move + last + "}", 409);
  last = done(R"({"do": "enable"})");
  ask(Method::post, "axes/" + axis + "/power", R"({"action": "cycle"})");
  pass(2s);
  start(move + last + "}", 409);
}

// A stop that belongs to the sequence is carried out after an interruption, but the sequence does not continue after
// it.
TEST_F(JobsTest, AStopInASequenceDoesNotContinueItAfterAnInterruption) {
  const std::string axis = "generic402";
  const auto after = [](const std::string& what, std::uint64_t id) {
    return fmt::format(R"({{"do": "{}", "after": {}}})", what, id);
  };
  const auto move_after = [](std::uint64_t id) {
    return fmt::format(R"({{"do": "move", "by": 0.1, "velocity": 2, "after": {}, {}}})", id, profile);
  };
  for (const char* what : {"stop", "quick_stop", "disable"}) {
    for (const char* by : {"stop of all", "halt", "cancelled job"}) {
      SCOPED_TRACE(fmt::format("{} after {}", what, by));
      make_ready(axis);
      const bool by_cancelling = by == std::string("cancelled job");
      const std::uint64_t last = begin(axis, fmt::format(R"({{"do": "move", "by": 0.2, "velocity": 2, {}}})", profile));
      if (by_cancelling) ask(Method::delete_, fmt::format("jobs/{}", last));
      EXPECT_EQ(finish(last)["state"], by_cancelling ? "cancelled" : "done");
      if (by == std::string("stop of all")) ask(Method::post, "stop");
      if (by == std::string("halt")) expect_done(axis, R"({"do": "stop"})");
      const std::uint64_t stop = begin(axis, after(what, last));
      EXPECT_EQ(finish(stop)["state"], "done");
      refused(axis, after("enable", stop));
      refused(axis, move_after(stop));
      const std::uint64_t again = begin(axis, after("disable", stop));
      EXPECT_EQ(finish(again)["state"], "done");
      refused(axis, after("enable", again));
    }
  }
  // Without an interruption the sequence continues, also if the stop ends a running job of the sequence.
  make_ready(axis);
  const std::uint64_t jog = begin(axis, fmt::format(R"({{"do": "jog", "velocity": 1, {}}})", profile));
  pass(100ms);
  const std::uint64_t stop = begin(axis, after("stop", jog));
  EXPECT_EQ(finish(stop)["state"], "done");
  EXPECT_EQ(job(jog)["state"], "cancelled");
  const std::uint64_t disable = begin(axis, after("disable", stop));
  EXPECT_EQ(finish(disable)["state"], "done");
  expect_done(axis, after("enable", disable));
}

// The request to end a job can arrive when the job is just over, or when the sequence is at a stop.
TEST_F(JobsTest, ASequenceDoesNotGoOnAfterTheEndOfItsJobIsRequested) {
  const std::string axis = "generic402";
  make_ready(axis);
  const std::uint64_t moved = begin(axis, fmt::format(R"({{"do": "move", "by": 1, "velocity": 2, {}}})", profile));
  EXPECT_EQ(finish(moved)["state"], "done");
  const Response over = ask(Method::delete_, fmt::format("jobs/{}", moved));
  EXPECT_EQ(over.status, 200U);
  EXPECT_EQ(json::parse(over.body), job(moved));
  EXPECT_EQ(job(moved)["state"], "done");
  refused(axis, fmt::format(R"({{"do": "move", "by": -1, "after": {}}})", moved));
  const std::uint64_t disable = begin(axis, R"({"do": "disable"})");
  const Response stopping = ask(Method::delete_, fmt::format("jobs/{}", disable));
  EXPECT_EQ(json::parse(stopping.body)["state"], "running");
  EXPECT_FALSE(json::parse(stopping.body).contains("ending"));
  EXPECT_EQ(finish(disable)["state"], "done");
  EXPECT_NE(view(axis)["state"], "operation enabled");
  refused(axis, fmt::format(R"({{"do": "enable", "after": {}}})", disable));
  make_ready(axis);
}

TEST_F(JobsTest, TheEndOfAnEarlierJobEndsTheRestOfItsSequence) {
  const std::string axis = "generic402";
  const std::uint64_t enabled = begin(axis, R"({"do": "enable"})");
  EXPECT_EQ(finish(enabled)["state"], "done");
  const std::uint64_t moved =
      begin(axis, fmt::format(R"({{"do": "move", "by": 8, "velocity": 1, {}, "after": {}}})", profile, enabled));
  pass(100ms);
  EXPECT_EQ(ask(Method::delete_, fmt::format("jobs/{}", enabled)).status, 200U);
  EXPECT_EQ(finish(moved)["state"], "cancelled");
  EXPECT_FALSE(view(axis)["in_motion"]);
}

// A client that slept, or a request that a network held back.
TEST_F(JobsTest, ASequenceDoesNotGoOnTooLate) {
  const std::string axis = "generic402";
  make_ready(axis);
  const std::uint64_t before = begin(axis, R"({"do": "stop"})");
  EXPECT_EQ(finish(before)["state"], "done");
  const std::string next = fmt::format(R"({{"do": "enable", "after": {}, "after_within_s": 5}})", before);
  wall_ += 6s;
  const Response late = ask(Method::post, "axes/" + axis + "/jobs", next);
  EXPECT_EQ(late.status, 409U);
  EXPECT_THAT(late.body, HasSubstr("ended 6 s ago, more than 5 s"));
  wall_ -= 2s;
  expect_done(axis, next);
  const Response alone = ask(Method::post, "axes/" + axis + "/jobs", R"({"do": "enable", "after_within_s": 5})");
  EXPECT_EQ(alone.status, 400U);
  EXPECT_THAT(alone.body, HasSubstr("after_within_s is given without after"));
}

TEST_F(JobsTest, ASequenceDoesNotGoOnOnAnotherServer) {
  const std::string axis = "generic402";
  make_ready(axis);
  const std::uint64_t before = begin(axis, R"({"do": "stop"})");
  EXPECT_EQ(finish(before)["state"], "done");
  const auto next = [&](const std::string& start) {
    return json{{"do", "enable"}, {"after", before}, {"after_start", start}}.dump();
  };
  const Response other = ask(Method::post, "axes/" + axis + "/jobs", next("0123456789abcdef"));
  EXPECT_EQ(other.status, 409U);
  EXPECT_THAT(other.body, HasSubstr("a server that has ended"));
  expect_done(axis, next(api::run_name()));
}

TEST_F(JobsTest, OnlyAStopBeginsForAClientThatHasGone) {
  const std::string axis = "generic402";
  const api::RouteGroup group = jobs_.routes();
  const auto post = [&](const std::string& body) {
    const api::Request request{.method = Method::post,
                               .target = "/api/v1/axes/" + axis + "/jobs",
                               .body = body,
                               .obsolete = "the client has gone"};
    return line::bench::handle(line_, request, {&group, 1}).status;
  };
  EXPECT_EQ(post(R"({"do": "enable"})"), 409U);
  EXPECT_EQ(get("jobs")["jobs"].size(), 0U);
  EXPECT_EQ(post(R"({"do": "quick_stop"})"), 201U);
}

TEST_F(JobsTest, TheLimitsOfADriveAreThoseOfItsObjects) {
  const json jmc = get("axes/jmc_ec/limits");
  EXPECT_EQ(jmc["velocity"], 14400.0) << "607Fh from the factory; 6080h is higher";
  EXPECT_EQ(jmc["acceleration"], 100000.0);
  EXPECT_EQ(jmc["lowest_position"], nullptr);
  const json before = get("axes/generic402/limits");
  for (const char* none : {"velocity", "acceleration", "deceleration", "lowest_position", "highest_position"}) {
    EXPECT_EQ(before[none], nullptr) << none;
  }
  ask(Method::put, "axes/generic402/objects/6080/0", R"({"value": 600})");
  ask(Method::put, "axes/generic402/objects/607d/1", R"({"value": -1000})");
  const json limits = get("axes/generic402/limits");
  EXPECT_NEAR(limits["velocity"].get<double>(), 10 * get("axes/generic402/units")["velocity_per_rps"].get<double>(), 1);
  EXPECT_EQ(limits["lowest_position"], -1000);
  EXPECT_EQ(limits["highest_position"], 0);
}

// The page explains the names of this file (studio/src/model/meanings.ts).
TEST_F(JobsTest, TheWordsAreThoseOfTheProduct) {
  std::ifstream file(SERVODROME_SOURCE_DIR "/tests/data/words.json");
  const json words = json::parse(file);
  EXPECT_EQ(words.size(), line::all_products().size());
  for (const line::Product& product : line::all_products()) {
    const std::string name(product.name);
    EXPECT_EQ(get("axes/" + name + "/words"), words.value(name, json())) << name;
  }
}

// Two relative moves: the target of each is a shaft position, also after homing with an offset.
TEST_P(EveryProduct, ShowsItsTargetAsAPositionOfTheShaft) {
  make_ready(axis_);
  expect_done(axis_, fmt::format(R"({{"do": "home", "method": {}, "speed": 2, "zero_speed": 1, "offset": 3, {}}})",
                                 catalogue::product_of(axis_).dialect.cautious_homing_method, profile));
  for (const int by : {2, -1}) {
    const double before = view(axis_)["position_counts"];
    const std::uint64_t moving =
        begin(axis_, fmt::format(R"({{"do": "move", "by": {}, "velocity": 3, {}}})", by, profile));
    pass(200ms);
    EXPECT_NEAR((view(axis_)["target_counts"].get<double>() - before) / encoder_turn(axis_), by, 0.01) << axis_;
    EXPECT_EQ(finish(moving)["state"], "done");
    EXPECT_NEAR(view(axis_)["target_counts"].get<double>(), view(axis_)["position_counts"].get<double>(),
                0.01 * encoder_turn(axis_));
  }
  EXPECT_EQ(view(axis_)["position_actual"], object(axis_, "6064/0"));
}

TEST_F(JobsTest, AResetThatAnInjectedFaultPreventsSaysSoAtOnce) {
  make_ready("generic402");
  line_.find_axis("generic402")->plant().inject(plant::Injection::encoder_loss, true);
  pass(100ms);
  const line::Time start = line_.now();
  const json over = finish(begin("generic402", R"({"do": "reset_fault"})"));
  EXPECT_LT(line_.now() - start, 500ms);
  EXPECT_EQ(over["error"]["what"], "the fault cannot be reset, because an injected fault holds: encoder_loss");
  line_.find_axis("generic402")->plant().inject(plant::Injection::encoder_loss, false);
  pass(100ms);
  expect_done("generic402", R"({"do": "reset_fault"})");
}

TEST_F(JobsTest, OverSpeedOfAJmcNamesTheLimits) {
  make_ready("jmc_ec");
  const json over =
      finish(begin("jmc_ec", R"({"do": "move", "by": 1, "velocity": 5, "acceleration": 20, "units": "revolutions"})"));
  EXPECT_EQ(over["state"], "failed");
  EXPECT_THAT(over["error"]["hint"].get<std::string>(), testing::AllOf(HasSubstr("607Fh"), HasSubstr("6080h")));
}

// A job that replaces a jog continues from where the jog is; the jog's final halt must no longer act.
TEST_P(EveryProduct, WhatTakesOverFromAJogStopsTheAxis) {
  make_ready(axis_);
  for (const char* order : {"stop", "quick_stop", "disable"}) {
    expect_done(axis_, R"({"do": "enable"})");
    const std::uint64_t jog = begin(axis_, fmt::format(R"({{"do": "jog", "velocity": 1, {}}})", profile));
    pass(100ms);
    ASSERT_EQ(job(jog)["state"], "running") << job(jog).dump();
    begin(axis_, fmt::format(R"({{"do": "{}"}})", order));
    EXPECT_EQ(job(jog)["state"], "cancelled") << order;
    pass(1s);
    EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0) << order;
  }
  expect_done(axis_, R"({"do": "enable"})");
  const std::uint64_t jog = begin(axis_, fmt::format(R"({{"do": "jog", "velocity": 1, {}}})", profile));
  pass(100ms);
  EXPECT_EQ(ask(Method::post, "stop").status, 200U);
  EXPECT_EQ(job(jog)["state"], "cancelled");
}

TEST_P(EveryProduct, JogsAsLongAsSomebodyIsThere) {
  make_ready(axis_);
  const std::uint64_t jog = begin(axis_, fmt::format(R"({{"do": "jog", "velocity": 1, {}}})", profile));
  for (int i = 0; i < 10; ++i) {
    pass(200ms);
    wall_ += 400ms;
    EXPECT_EQ(ask(Method::post, fmt::format("jobs/{}/alive", jog)).status, 200U);
  }
  EXPECT_EQ(job(jog)["state"], "running");
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 60.0, 4.0);
  wall_ += 501ms;
  pass(20ms);
  const json alive = json::parse(ask(Method::post, fmt::format("jobs/{}/alive", jog)).body);
  EXPECT_EQ(alive["ending"], true) << alive.dump() << ": a late sign of life does not continue the motion";
  const json over = finish(jog, 2s);
  EXPECT_EQ(over["state"], "done") << over.dump();
  EXPECT_THAT(over["note"].get<std::string>(), HasSubstr("nothing was heard from its client for 500 ms"));
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

TEST_P(EveryProduct, AFaultInTheMiddleEndsTheJobAndIsReset) {
  make_ready(axis_);
  const std::uint64_t move = begin(axis_, fmt::format(R"({{"do": "move", "by": 5, "velocity": 2, {}}})", profile));
  pass(500ms);
  EXPECT_EQ(job(move)["state"], "running");
  inject(axis_, resettable_fault(axis_));
  const json over = finish(move, 2s);
  EXPECT_EQ(over["state"], "failed");
  EXPECT_THAT(over["error"]["what"].get<std::string>(), HasSubstr("left operation enabled"));
  EXPECT_THAT(over["error"]["what"].get<std::string>(), HasSubstr("error code 603Fh"));
  EXPECT_EQ(over["error"]["where"], axis_);
  const json enable = finish(begin(axis_, R"({"do": "enable"})"), 5s);
  EXPECT_EQ(enable["state"], "failed");
  ASSERT_EQ(ask(Method::delete_, "axes/" + axis_ + "/faults").status, 200U);
  pass(500ms);
  expect_done(axis_, R"({"do": "reset_fault"})");
  make_ready(axis_);
}

TEST_P(EveryProduct, ACancelledMoveHaltsAndLeavesTheAxisUsable) {
  make_ready(axis_);
  const std::uint64_t move = begin(axis_, fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile));
  pass(700ms);
  EXPECT_GT(view(axis_)["velocity_rpm"].get<double>(), 100.0);
  const json ending = json::parse(ask(Method::delete_, fmt::format("jobs/{}", move)).body);
  EXPECT_EQ(ending["state"], "running");
  EXPECT_EQ(ending["ending"], true);
  const json over = finish(move, 3s);
  EXPECT_EQ(over["state"], "cancelled") << over.dump();
  pass(200ms);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
  const double stood = view(axis_)["position_counts"];
  pass(1s);
  EXPECT_NEAR(view(axis_)["position_counts"].get<double>(), stood, encoder_turn(axis_) / 500) << "the move is dropped";
  EXPECT_EQ(ask(Method::delete_, fmt::format("jobs/{}", move)).status, 200U) << "once more changes nothing";
  expect_done(axis_, fmt::format(R"({{"do": "move", "by": -1, "velocity": 2, {}}})", profile));
}

TEST_P(EveryProduct, AStopThatIsEndedAtOnceStopsTheAxis) {
  make_ready(axis_);
  begin(axis_, fmt::format(R"({{"do": "velocity", "velocity": -2, {}}})", profile));
  pass(300ms);
  const std::uint64_t stop = begin(axis_, R"({"do": "stop"})");
  ask(Method::delete_, "jobs/" + std::to_string(stop), "");
  pass(500ms);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

// The drive does not report standstill in homing, and its shaft slips a little after the halt.
TEST_F(JobsTest, AHaltInHomingLeavesAnIsmkEnabled) {
  for (const auto begun : {300ms, 500ms, 700ms}) {
    make_ready("ismk");
    begin("ismk", R"({"do": "home", "method": 33, "zero_speed": 0.5, "acceleration": 5, "units": "revolutions"})");
    pass(begun);
    const json over = finish(begin("ismk", R"({"do": "stop"})"));
    EXPECT_EQ(over["state"], "done");
    EXPECT_FALSE(over.contains("note")) << over;
    EXPECT_EQ(view("ismk")["state"], "operation enabled");
  }
}

// The shaft accelerates by 20 rpm in each millisecond. A job polls its drive each 5 ms.
TEST_F(JobsTest, AJobThatIsEndedHaltsAtOnce) {
  for (const auto begun : {5ms, 6ms, 7ms, 8ms, 9ms, 10ms, 11ms, 12ms}) {
    make_ready("ismc");
    const std::uint64_t id = begin("ismc", R"({"do": "torque", "percent": 10, "slope": 1000})");
    pass(begun);
    const double before = view("ismc")["velocity_rpm"].get<double>();
    ask(Method::delete_, "jobs/" + std::to_string(id), "");
    double most = before;
    for (int ms = 0; ms < 20; ++ms) {
      pass(1ms);
      most = std::max(most, view("ismc")["velocity_rpm"].get<double>());
    }
    EXPECT_LT(most - before, 40.0) << begun.count();
    finish(id);
  }
}

// A job that is ended before its first access halts what an earlier command has begun.
TEST_P(EveryProduct, AJobThatIsEndedBeforeItBeganHalts) {
  make_ready(axis_);
  expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": 2, {}}})", profile));
  const std::uint64_t move = begin(axis_, fmt::format(R"({{"do": "move", "by": 1, "velocity": 2, {}}})", profile));
  ask(Method::delete_, "jobs/" + std::to_string(move));
  EXPECT_EQ(finish(move)["state"], "cancelled");
  pass(1s);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

// A stop is accepted and carried out whatever its request says, and whatever comes after it.
TEST_P(EveryProduct, AStopIsCarriedOut) {
  for (const char* what : {"stop", "quick_stop", "disable"}) {
    make_ready(axis_);
    expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": 2, {}}})", profile));
    const std::uint64_t stop = begin(axis_, fmt::format(R"({{"do": "{}", "after": 1, "units": "revolutions"}})", what));
    ask(Method::delete_, "jobs/" + std::to_string(stop));
    pass(3ms);
    ask(Method::delete_, "jobs/" + std::to_string(stop));
    EXPECT_EQ(finish(stop)["state"], "done") << what;
    if (what != std::string("disable")) {  // after which the axis coasts
      EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 5.0) << what;
    }
    pass(1s);
    EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0) << what;
  }
}

// Commands that are no jobs end the running one, and the axis halts.
TEST_P(EveryProduct, AnotherCommandEndsAJob) {
  for (const auto at : {3ms, 40ms, 400ms}) {
    for (const bool by_power : {false, true}) {
      pass(500ms);
      make_ready(axis_);
      const std::uint64_t id = begin(axis_, fmt::format(R"({{"do": "move", "by": 5, "velocity": 2, {}}})", profile));
      pass(at);
      if (by_power) {
        ask(Method::post, "axes/" + axis_ + "/power", R"({"action": "cycle"})");
      } else {
        ask(Method::put, "axes/" + axis_ + "/objects/6040/0", R"({"value": 15})");
      }
      EXPECT_NE(finish(id, 2s)["state"], "done") << at.count();
      EXPECT_NE(job(id)["state"], "running") << at.count();
      pass(1s);
      EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0) << at.count();
      make_ready(axis_);
      expect_done(axis_, fmt::format(R"({{"do": "move", "by": -0.5, "velocity": 2, {}}})", profile));
    }
  }
}

// A client disables the axis, or stops it, while a job moves it or a stop of the server brakes it: it is not enabled
// again.
TEST_P(EveryProduct, TheServerDoesNotEnableWhatAClientDisables) {
  for (const int word : {0, 2, 6, 7}) {
    for (const bool while_stopping : {false, true}) {
      for (const auto at : {2ms, 3ms, 4ms, 5ms, 30ms}) {
        if (test::sanitized && at != 3ms) continue;
        SCOPED_TRACE(fmt::format("6040h = {}, {} ms after {}", word, at.count(), while_stopping ? "stop" : "velocity"));
        make_ready(axis_);
        const auto run = fmt::format(R"({{"do": "velocity", "velocity": 3, {}}})", profile);
        if (while_stopping) {
          expect_done(axis_, run);
          begin(axis_, R"({"do": "stop"})");
        } else {
          begin(axis_, run);
        }
        pass(at);
        ask(Method::put, "axes/" + axis_ + "/objects/6040/0", fmt::format(R"({{"value": {}}})", word));
        pass(2s);
        EXPECT_NE(view(axis_)["state"], "operation enabled");
        EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
        ask(Method::put, "axes/" + axis_ + "/objects/6040/0", R"({"value": 0})");
        pass(500ms);
      }
    }
  }
}

// Drives whose units take time to read: meanwhile another client's command can come.
class SlowDrives final : public Drives {
 public:
  explicit SlowDrives(line::Line& line) : drives_(line) {}
  std::function<void()> meanwhile{};

  master::Time now() const override { return drives_.now(); }
  std::vector<std::string> names() const override { return drives_.names(); }
  void require_ready(const std::string& axis) const override { drives_.require_ready(axis); }
  std::unique_ptr<master::ObjectClient> open(const std::string& axis, Wait wait) override {
    return drives_.open(axis, std::move(wait));
  }
  master::AxisOptions options(const std::string& axis) const override { return drives_.options(axis); }
  std::string product(const std::string& axis) const override { return drives_.product(axis); }
  bool has_cycles(const std::string& axis) const override { return drives_.has_cycles(axis); }
  api::Json in_cycles(const std::string& axis, master::ObjectClient& objects, const master::CanDrive& exchanged,
                      const std::function<bool()>& cancelled,
                      const std::function<void(const char* doing, double share)>& progress, const Work& work) override {
    return drives_.in_cycles(axis, objects, exchanged, cancelled, progress, work);
  }
  std::optional<catalogue::AxisUnits> units(const std::string& axis) override {
    if (meanwhile) meanwhile();
    return drives_.units(axis);
  }
  master::AxisLimits limits(const std::string& axis) override { return drives_.limits(axis); }
  Travel travel(const std::string& axis) override { return drives_.travel(axis); }
  std::uint64_t commands(const std::string& axis) const override { return drives_.commands(axis); }
  std::vector<std::optional<JobError>> stop_all() override { return drives_.stop_all(); }

 private:
  LineDrives drives_;
};

TEST_F(JobsTest, AJobThatWaitsForItsUnitsIsRefusedAfterAStop) {
  SlowDrives drives(line_);
  Jobs jobs(drives, [this] { return wall_; });
  const std::string move = R"({"do": "move", "by": 1, "velocity": 5, "units": "revolutions"})";
  drives.meanwhile = [&jobs] { jobs.stop_all(); };
  EXPECT_THROW(jobs.begin("ismc", move), api::ApiError);
  drives.meanwhile = [&jobs] { jobs.begin("ismc", R"({"do": "stop"})"); };
  EXPECT_THROW(jobs.begin("ismc", move), api::ApiError);
  EXPECT_EQ(jobs.all().size(), 1U);
  drives.meanwhile = [&jobs] { jobs.begin("jmc_ec", R"({"do": "stop"})"); };  // another axis
  jobs.begin("generic402", move);
  drives.meanwhile = [] { FAIL() << "a stop waits for no units"; };
  jobs.begin("generic402", R"({"do": "stop", "units": "revolutions"})");
}

TEST_P(EveryProduct, QuickStopTakesTheAxisFromAJob) {
  make_ready(axis_);
  const std::uint64_t move = begin(axis_, fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile));
  pass(700ms);
  expect_done(axis_, R"({"do": "quick_stop"})");
  EXPECT_EQ(job(move)["state"], "cancelled");
  EXPECT_THAT(job(move)["error"]["what"].get<std::string>(), HasSubstr("replaced by the job quick_stop"));
  pass(1s);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
  EXPECT_NE(view(axis_)["state"], "operation enabled");
}

TEST_P(EveryProduct, PowerLostInTheMiddleEndsTheJob) {
  make_ready(axis_);
  const std::uint64_t move = begin(axis_, fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile));
  pass(500ms);
  ASSERT_EQ(ask(Method::post, "axes/" + axis_ + "/power", R"({"action": "off"})").status, 200U);
  const json over = finish(move, 1s);
  EXPECT_EQ(over["state"], "failed");
  EXPECT_EQ(over["error"]["what"], "the axis has no power");
  EXPECT_EQ(ask(Method::post, "axes/" + axis_ + "/jobs", R"({"do": "enable"})").status, 409U);
  ASSERT_EQ(ask(Method::post, "axes/" + axis_ + "/power", R"({"action": "on"})").status, 200U);
  pass(500ms);
  make_ready(axis_);
}

TEST_F(JobsTest, AxesDoNotWaitForEachOther) {
  make_ready("ismc");
  make_ready("jmc_ec");
  make_ready("pronet");
  const std::uint64_t slow = begin("ismc", fmt::format(R"({{"do": "move", "by": 4, "velocity": 2, {}}})", profile));
  const std::uint64_t quick = begin("jmc_ec", fmt::format(R"({{"do": "move", "by": 2, "velocity": 3, {}}})", profile));
  const std::uint64_t back = begin("pronet", fmt::format(R"({{"do": "move", "by": -4, "velocity": 3, {}}})", profile));
  EXPECT_EQ(finish(quick)["state"], "done");
  EXPECT_EQ(job(back)["state"], "running");
  EXPECT_EQ(finish(back)["state"], "done");
  EXPECT_EQ(job(slow)["state"], "running");
  EXPECT_EQ(finish(slow)["state"], "done");
}

TEST_F(JobsTest, TheBigStopStopsEveryAxisAtOnce) {
  std::vector<std::uint64_t> running;
  for (const std::string& axis : names_of_products()) {
    if (axis == "pronet") {
      ASSERT_EQ(ask(Method::post, "axes/pronet/power", R"({"action": "off"})").status, 200U);
      continue;
    }
    if (axis == "generic402-ec") continue;  // stays disabled
    make_ready(axis);
    running.push_back(begin(axis, fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile)));
  }
  pass(700ms);
  const Response response = ask(Method::post, "stop", "{}");
  ASSERT_EQ(response.status, 200U) << response.body;
  const json stopped = json::parse(response.body)["axes"];
  ASSERT_EQ(stopped.size(), names_of_products().size());
  for (const json& axis : stopped) {
    EXPECT_EQ(axis["stopped"], true) << axis.dump();
    EXPECT_FALSE(axis.contains("error"));
  }
  for (const std::uint64_t id : running) EXPECT_EQ(job(id)["state"], "cancelled");
  pass(2s);
  for (const std::string& axis : names_of_products()) {
    EXPECT_NEAR(view(axis)["velocity_rpm"].get<double>(), 0.0, 2.0) << axis;
    if (axis == "pronet") continue;  // has no power
    EXPECT_NE(view(axis)["state"], "operation enabled") << axis;
  }
}

// Also with a master that does not know the history: it goes through the states, and nothing moves.
TEST_P(EveryProduct, TheBigStopLeavesNothingThatEnablingRevives) {
  for (const bool by_job : {true, false}) {
    make_ready(axis_);
    expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": 2, {}}})", profile));
    pass(200ms);
    ASSERT_EQ(ask(Method::post, "stop").status, 200U);
    pass(1s);
    EXPECT_EQ(object(axis_, "60FF/0"), 0.0);
    const double stood = view(axis_)["position_counts"];
    if (by_job) {
      make_ready(axis_);
    } else {
      enable_by_controlwords({0, 6, 7, 15});
    }
    expect_still_at(stood);
    expect_done(axis_, R"({"do": "disable"})");
  }
}

// A fault has already switched the axis off when a client stops it. The target of its motion must not act later.
TEST_P(EveryProduct, AStopAfterAFaultLeavesNothingThatEnablingRevives) {
  const std::string cause = resettable_fault(axis_);
  for (const std::string by : {"stop of all", "disable", "quick_stop"}) {
    SCOPED_TRACE(by);
    make_ready(axis_);
    expect_done(axis_, fmt::format(R"({{"do": "velocity", "velocity": 2, {}}})", profile));
    inject(axis_, cause);
    pass(1s);
    EXPECT_EQ(view(axis_)["state"], "fault");
    if (by == "stop of all") {
      ASSERT_EQ(ask(Method::post, "stop").status, 200U);
    } else {
      expect_done(axis_, fmt::format(R"({{"do": "{}"}})", by));
    }
    EXPECT_EQ(object(axis_, "60FF/0"), 0.0);
    ASSERT_EQ(ask(Method::delete_, "axes/" + axis_ + "/faults").status, 200U);
    pass(500ms);
    const double stood = view(axis_)["position_counts"];
    enable_by_controlwords({0, 0x80, 0, 6, 7, 15});
    expect_still_at(stood);
    expect_done(axis_, R"({"do": "disable"})");
  }
}

// A ramp that would take minutes, for example from a number in units of unknown size.
TEST_P(EveryProduct, AHaltThatDoesNotRestTheAxisBecomesAQuickStop) {
  make_ready(axis_);
  expect_done(axis_, R"({"do": "velocity", "velocity": 2, "units": "revolutions", "acceleration": 50,
                         "deceleration": 0.02})");
  const std::uint64_t halt = begin(axis_, R"({"do": "stop"})");
  pass(300ms);
  const bool rests = std::abs(view(axis_)["velocity_rpm"].get<double>()) < 2.0;
  const bool is_stopped = view(axis_)["state"] != "operation enabled";
  EXPECT_TRUE(rests || is_stopped) << view(axis_).dump();
  const json over = finish(halt, 5s);
  EXPECT_EQ(over["state"], "done") << over.dump();
  EXPECT_EQ(over.contains("note"), is_stopped) << over.dump();
  if (is_stopped) {
    EXPECT_THAT(over.value("note", ""), HasSubstr("became a quick stop"));
  }
  pass(1s);
  EXPECT_NEAR(view(axis_)["velocity_rpm"].get<double>(), 0.0, 2.0);
}

TEST_F(JobsTest, AMoveThatTakesTooLongIsStopped) {
  make_ready("generic402");
  const json over = finish(
      begin("generic402", fmt::format(R"({{"do": "move", "by": 8, "velocity": 1, "timeout_s": 0.5, {}}})", profile)));
  EXPECT_EQ(over["state"], "failed");
  EXPECT_THAT(over["error"]["what"].get<std::string>(), HasSubstr("took longer than 0.5 s and was stopped"));
  EXPECT_NEAR(view("generic402")["velocity_rpm"].get<double>(), 0.0, 2.0);
}

// In virtual time nothing happens until a call advances time; the size of the steps changes nothing.
TEST_F(JobsTest, HowTimeIsCutChangesNothing) {
  const auto run = [](line::Time piece) {
    line::Line line{line::test::settings_of(line_of_all())};
    LineJobs line_jobs(line);
    Jobs& jobs = line_jobs.jobs();
    const std::string axis = "generic402";
    line.run_until(300ms);
    jobs.begin(axis, R"({"do": "enable"})");
    EXPECT_EQ(jobs.find(1)->state, JobState::running);
    for (line::Time at = 300ms; at < 1s; at += piece) line.run_until(at);
    line.run_until(1s);
    EXPECT_EQ(jobs.find(1)->state, JobState::done);
    jobs.begin(axis, R"({"do": "move", "by": 100000, "velocity": 100000})");
    for (line::Time at = 1s; at < 4s; at += piece) line.run_until(at);
    line.run_until(4s);
    EXPECT_EQ(jobs.find(2)->state, JobState::done);
    return std::pair{line.find_axis(axis)->plant().position_counts(), jobs.find(2)->result->seconds};
  };
  const auto in_one = run(700ms);
  EXPECT_EQ(in_one, run(1ms));
  EXPECT_EQ(in_one, run(1234567ns));
}

TEST_F(JobsTest, JobsThatAreRunningEndWithTheServer) {
  for (const std::string& axis : names_of_products()) {
    make_ready(axis);
    begin(axis, fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile));
  }
  pass(300ms);
  begin("ismc", R"({"do": "stop"})");  // the job has not begun
}

TEST_F(JobsTest, RemembersSixtyFour) {
  make_ready("ismc");
  for (int i = 0; i < 80; ++i) expect_done("ismc", R"({"do": "enable"})");
  const json jobs = get("jobs")["jobs"];
  ASSERT_EQ(jobs.size(), 64U);
  EXPECT_EQ(jobs.front()["id"], 18);
  EXPECT_EQ(jobs.back()["id"], 81);
  EXPECT_EQ(ask(Method::get, "jobs/17").status, 404U);
}

class ManyAxes : public JobsTest {
 protected:
  static std::string line_of_many() {
    std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n";
    for (int node = 1; node <= 66; ++node) {
      text += fmt::format("[[axis]]\nname = \"a{0}\"\nproduct = \"generic402\"\nbus = \"can0\"\nnode = {0}\n", node);
    }
    return text;
  }
  ManyAxes() : JobsTest(line_of_many()) {}
};

TEST_F(ManyAxes, AStopIsAcceptedWhileTooManyJobsRun) {
  const std::string run = R"({"do": "velocity", "velocity": 2, "acceleration": 50, "units": "revolutions"})";
  make_ready("a65");
  expect_done("a65", run);
  for (int i = 1; i <= 64; ++i) begin(fmt::format("a{}", i), R"({"do": "enable"})");
  EXPECT_EQ(ask(Method::post, "axes/a66/jobs", R"({"do": "enable"})").status, 409U) << "64 jobs are running";
  expect_done("a65", R"({"do": "stop"})");
  EXPECT_NEAR(view("a65")["velocity_rpm"].get<double>(), 0.0, 2.0);
}

TEST_F(JobsTest, UnitsOfARevolution) {
  EXPECT_EQ(get("axes/ismk/units")["position_per_revolution"], 65536.0);
  EXPECT_EQ(get("axes/generic402/units")["velocity_per_rps"], 131072.0);
  EXPECT_EQ(get("axes/pronet/units")["velocity_per_rps"], 600.0);
  EXPECT_EQ(get("axes/ismc/units")["position_per_revolution"], 131072.0) << "it has no factors: encoder counts";
  ASSERT_EQ(ask(Method::post, "axes/ismc/power", R"({"action": "off"})").status, 200U);
  EXPECT_EQ(ask(Method::get, "axes/ismc/units").status, 409U) << "its factors cannot be asked for";
}

// The encoder of the ProNet manual's examples: a revolution follows the drive's own resolution.
class ManualsEncoder : public JobsTest {
 protected:
  ManualsEncoder()
      : JobsTest(
            "clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n[[axis]]\nname = \"pronet\"\nproduct = \"pronet\"\nbus = "
            "\"can0\"\nnode = 1\n[axis.encoder]\ncounts_per_revolution = 10000\n") {}
  double true_turns() { return static_cast<double>(line_.axes()[0]->plant().position_counts()) / 10000.0; }
};

TEST_F(ManualsEncoder, UnitsOfARevolution) {
  EXPECT_EQ(get("axes/pronet/units")["position_per_revolution"], 10000.0);
  EXPECT_EQ(get("axes/pronet/units")["velocity_per_rps"], 600.0);
}

TEST_F(ManualsEncoder, MovesByRevolutions) {
  make_ready("pronet");
  const double before = true_turns();
  expect_done("pronet", R"({"do": "move", "by": 3, "velocity": 5, "acceleration": 50, "units": "revolutions"})");
  EXPECT_NEAR(true_turns() - before, 3.0, 0.01);
  expect_done("pronet", R"({"do": "move", "to": -2, "velocity": 5, "acceleration": 50, "units": "revolutions"})");
  EXPECT_NEAR(object("pronet", "6064/0"), -20000.0, 100.0);
}

struct Refusal {
  const char* body;
  unsigned status;
  const char* what;
};
class Refusals : public JobsTest, public testing::WithParamInterface<Refusal> {};

TEST_P(Refusals, SayWhatIsWrongAndBeginNothing) {
  const Response response = ask(Method::post, "axes/generic402/jobs", GetParam().body);
  EXPECT_EQ(response.status, GetParam().status) << response.body;
  EXPECT_THAT(response.body, HasSubstr(GetParam().what));
  EXPECT_EQ(get("jobs")["jobs"], json::array());
}
INSTANTIATE_TEST_SUITE_P(
    Jobs, Refusals,
    testing::Values(Refusal{"", 400, "not JSON"}, Refusal{"{}", 400, "do is missing"},
                    Refusal{R"({"do": "fly"})", 422, "no job \\\"fly\\\""},
                    Refusal{R"({"do": "move"})", 400, "neither to nor by"},
                    Refusal{R"({"do": "move", "to": 1, "by": 1})", 400, "both to and by"},
                    Refusal{R"({"do": "move", "to": "1"})", 400, "to is"},
                    Refusal{R"({"do": "move", "to": 1e10})", 422, "units of the drive"},
                    Refusal{R"({"do": "move", "to": 1e5, "units": "revolutions"})", 422, "units of the drive"},
                    Refusal{R"({"do": "move", "to": 1, "velocity": -1})", 422, "units of the drive"},
                    Refusal{R"({"do": "move", "to": 1, "units": "inches"})", 422, "no units \\\"inches\\\""},
                    Refusal{R"({"do": "move", "to": 1, "speed": 1})", 400, "unknown key"},
                    Refusal{R"({"do": "move", "to": 1, "timeout_s": 1e9})", 422, "timeout_s is"},
                    Refusal{R"({"do": "home", "method": 200})", 422, "method is 200"},
                    Refusal{R"({"do": "velocity"})", 400, "velocity is missing"},
                    Refusal{R"({"do": "torque"})", 400, "percent is missing"},
                    Refusal{R"({"do": "torque", "percent": 1e9})", 422, "percent is"},
                    Refusal{R"({"do": "home", "method": 34.5})", 422, "method is 34.5"},
                    Refusal{R"({"do": "velocity", "velocity": null})", 400, "velocity is null"},
                    Refusal{R"({"do": "velocity", "velocity": "0,5"})", 400, "velocity is \\\"0,5\\\""},
                    Refusal{R"({"do": "velocity", "velocity": 1, "acceleration": null})", 400, "acceleration is null"},
                    Refusal{R"({"do": "move", "by": null})", 400, "by is null"},
                    Refusal{R"({"do": "torque", "percent": null})", 400, "percent is null"},
                    Refusal{R"({"do": "home", "method": null})", 400, "method is null"},
                    Refusal{R"({"do": "move", "by": 1, "timeout_s": null})", 400, "timeout_s is null"},
                    Refusal{R"({"do": "jog", "velocity": true})", 400, "velocity is true"}));

TEST_F(JobsTest, RefusesASecondJobAndWhatIsNotThere) {
  make_ready("ismc");
  const std::uint64_t move = begin("ismc", fmt::format(R"({{"do": "move", "by": 8, "velocity": 2, {}}})", profile));
  const Response second = ask(Method::post, "axes/ismc/jobs", R"({"do": "home"})");
  EXPECT_EQ(second.status, 409U);
  EXPECT_THAT(second.body, HasSubstr("the axis has a job: move"));
  EXPECT_THAT(second.body, HasSubstr(fmt::format("/api/v1/jobs/{}", move)));
  EXPECT_EQ(ask(Method::post, fmt::format("jobs/{}/alive", move)).status, 409U) << "a move needs none";
  EXPECT_EQ(ask(Method::get, "jobs/99").status, 404U);
  EXPECT_EQ(ask(Method::get, "jobs/x").status, 404U);
  EXPECT_EQ(ask(Method::delete_, "jobs/-1").status, 404U);
  EXPECT_EQ(ask(Method::post, "axes/nobody/jobs", R"({"do": "enable"})").status, 404U);
  EXPECT_EQ(ask(Method::put, "jobs/1").status, 405U);
  const json not_enabled =
      finish(begin("pronet", fmt::format(R"({{"do": "move", "by": 1, "velocity": 2, {}}})", profile)), 1s);
  EXPECT_EQ(not_enabled["state"], "failed");
  EXPECT_THAT(not_enabled["error"]["what"].get<std::string>(), HasSubstr("not enabled"));
}

}  // namespace
}  // namespace jobs_test
}  // namespace servodrome::studio
