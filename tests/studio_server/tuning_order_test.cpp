// Jobs "tune" and "tune_itself" of every product, in virtual time over the service port, and the information about
// gains.
#include <gmock/gmock.h>

#include "axis/object_catalogue.hpp"
#include "commissioning_rig.hpp"
#include "draws.hpp"

namespace servodrome::studio {
namespace tuning_order_test {
namespace {

using api::Method;
using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

class TuningOf : public CommissioningRig, public testing::WithParamInterface<std::string> {
 protected:
  TuningOf() : CommissioningRig(line_of_all(GetParam())) {}

  std::string axis_ = GetParam();

  json begin(const std::string& body) { return json_of(Method::post, "axes/" + axis_ + "/jobs", body); }
  json over(const json& job, line::Time longest = 200s) { return CommissioningRig::over(job, longest, 50ms); }
  json run(const std::string& body) { return over(begin(body)); }
  json gains() { return get("axes/" + axis_ + "/gains"); }
  double rpm() { return line_.find_axis(axis_)->plant().velocity_rpm(); }
  bool is_at_rest() { return get("axes/" + axis_)["state"] != "operation enabled" && std::abs(rpm()) < 0.5; }
  json values_of_gains() {
    json values = json::object();
    const json listed = gains();
    for (const json& line : listed["gains"]) {
      const auto object = line["object"].get<std::string>();
      values[object] = value(axis_, object.substr(0, 4) + "/" + object.substr(5));
    }
    return values;
  }
};
INSTANTIATE_TEST_SUITE_P(Products, TuningOf, testing::ValuesIn(names_of_products()), name_of_test);

// One product of each kind with known gains: over the service port the fieldbus makes no difference.
class Tuned : public TuningOf {};
INSTANTIATE_TEST_SUITE_P(Products, Tuned, testing::Values("generic402", "ismk"), name_of_test);

TEST_P(TuningOf, WhatIsTurnedIsThere) {
  const json listed = gains();
  for (const json& line : listed["gains"]) {
    const auto object = line["object"].get<std::string>();
    EXPECT_TRUE(value(axis_, object.substr(0, 4) + "/" + object.substr(5)).is_number()) << object;
    EXPECT_FALSE(line["set"].get<std::string>().empty());
    EXPECT_FALSE(line["does"].get<std::string>().empty());
  }
  EXPECT_EQ(gains()["gains"].empty(), axis_ == "ismc" || axis_ == "pronet") << "whose manuals print none";
  EXPECT_EQ(gains()["tunes_itself"], axis_.starts_with("ismk"));
  EXPECT_EQ(gains()["full_torque"], axis_.starts_with("ismk") ? "peak current" : "rated torque");
  EXPECT_EQ(gains()["velocity_mode"], axis_.starts_with("ismk") ? -3 : 9);
  EXPECT_EQ(gains()["measures"], true);
}

TEST_P(TuningOf, AProposalWritesNothing) {
  const json before = values_of_gains();
  const json job = run(R"({"do": "tune", "bandwidth_hz": 30, "seconds": 4})");
  EXPECT_TRUE(is_at_rest());
  EXPECT_EQ(values_of_gains(), before);
  if (axis_ == "ismc" || axis_ == "pronet") {  // these have no cyclic synchronous velocity
    ASSERT_EQ(job["state"], "failed") << job.dump();
    EXPECT_FALSE(job["error"]["what"].get<std::string>().empty());
    return;
  }
  ASSERT_EQ(job["state"], "done") << job.dump();
  const json& found = job["found"];
  EXPECT_EQ(found["result"], "proposed");
  EXPECT_GT(found["before"]["open_loop"].size(), 10U);
  EXPECT_EQ(found["before"]["lost_cycles"], 0);
  EXPECT_FALSE(found.contains("after"));
  EXPECT_GT(found["si"]["velocity_kp"], 0.0);
}

TEST_P(Tuned, GainsAreWrittenAndKeepTheirPromise) {
  const json begun = begin(R"({"do": "tune", "bandwidth_hz": 35, "apply": true, "seconds": 4})");
  pass(3s);
  const json underway = get(fmt::format("jobs/{}", begun["id"].get<int>()));
  ASSERT_EQ(underway["state"], "running") << underway.dump();
  EXPECT_GT(underway["progress"]["share"], 0.0);
  EXPECT_FALSE(underway["progress"]["doing"].get<std::string>().empty());
  const json job = over(begun);
  ASSERT_EQ(job["state"], "done") << job.dump();
  const json& found = job["found"];
  EXPECT_EQ(found["result"], "applied");
  EXPECT_NEAR(found["after"]["bandwidth_hz"].get<double>(), 35.0, 0.15 * 35.0);
  EXPECT_GE(found["after"]["phase_margin_deg"], 40.0);
  EXPECT_GT(found["step_after"]["velocity"].size(), 100U);
  for (const json& gain : found["gains"]) {
    const auto object = gain["object"].get<std::string>();
    EXPECT_EQ(value(axis_, object.substr(0, 4) + "/" + object.substr(5)), gain["after"]) << object;
  }
  EXPECT_TRUE(is_at_rest());
}

TEST_P(Tuned, EndedItBrakesAndPutsBack) {
  const json before = values_of_gains();
  const json begun = begin(R"({"do": "tune", "apply": true, "seconds": 4})");
  pass(2s);
  ASSERT_GT(std::abs(rpm()), 5.0);
  ask(Method::delete_, fmt::format("jobs/{}", begun["id"].get<int>()));
  const json job = over(begun, 3s);
  EXPECT_EQ(job["state"], "cancelled") << job.dump();
  EXPECT_TRUE(is_at_rest());
  EXPECT_EQ(values_of_gains(), before);
}

TEST_P(Tuned, TheBigStopEndsIt) {
  const json before = values_of_gains();
  const json begun = begin(R"({"do": "tune", "apply": true, "seconds": 4})");
  for (int i = 0; i < 1000 && values_of_gains() == before; ++i) pass(100ms);
  ASSERT_NE(values_of_gains(), before) << "they were written";
  pass(2s);
  ask(Method::post, "stop");
  EXPECT_EQ(get(fmt::format("jobs/{}", begun["id"].get<int>()))["state"], "cancelled");
  EXPECT_EQ(values_of_gains(), before);
  pass(2s);
  EXPECT_LT(std::abs(rpm()), 0.5);
}

// STOP may come at any moment, also while the tuning brakes the axis at the end of a measurement.
TEST_P(Tuned, TheBigStopEndsItAtAnyMoment) {
  const json before = values_of_gains();
  const auto stop_after = [&](const std::string& request, line::Time time) {
    const json begun = begin(request);
    pass(time);
    const bool is_over = get(fmt::format("jobs/{}", begun["id"].get<int>()))["state"] != "running";
    ask(Method::post, "stop");
    pass(1s);
    EXPECT_TRUE(is_at_rest()) << time.count();
    if (!is_over) {
      EXPECT_EQ(values_of_gains(), before) << time.count();
    }
  };
  const auto duration = [&](const std::string& request) {
    const line::Time began = line_.now();
    run(request);
    return line_.now() - began;
  };
  const std::string measure = R"({"do": "tune", "seconds": 4})";
  const line::Time measured = duration(measure);
  for (line::Time time = 300ms; time < measured - 1s; time += test::stride * 1900ms) stop_after(measure, time);
  for (line::Time time = measured - 1s; time < measured; time += test::stride * 110ms) stop_after(measure, time);
  if (axis_ != "generic402") return;
  const std::string apply = R"({"do": "tune", "apply": true, "seconds": 4})";
  const line::Time applied = duration(apply);
  const json listed = gains();
  for (const json& gain : listed["gains"]) {
    const auto object = gain["object"].get<std::string>();
    const api::Response answer =
        ask(Method::put, "axes/" + axis_ + "/objects/" + object.substr(0, 4) + "/" + object.substr(5),
            json{{"value", before[object]}}.dump());
    ASSERT_LT(answer.status, 300U) << object << answer.body;
  }
  ASSERT_EQ(values_of_gains(), before);
  stop_after(apply, applied - 300ms);
}

// A controlword and a switch of the power are later commands than the job: it does not enable the axis again.
TEST_P(Tuned, AnotherCommandEndsIt) {
  for (const char* command : {"controlword", "power"}) {
    for (line::Time at = 200ms; at < 12s; at += test::stride * 731ms) {
      const json begun = begin(R"({"do": "tune", "seconds": 4})");
      pass(at);
      if (get(fmt::format("jobs/{}", begun["id"].get<int>()))["state"] != "running") break;
      if (command == std::string("power")) {
        json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "cycle"})");
      } else {
        ask(Method::put, "axes/" + axis_ + "/objects/6040/0", R"({"value": 6})");
      }
      const json job = over(begun, 3s);
      ASSERT_NE(job["state"], "running") << command << at.count();
      pass(1s);
      ASSERT_TRUE(is_at_rest()) << command << at.count();
    }
  }
}

// The drive learns while it turns. Whatever ends the job also ends the learning.
class OwnTuning : public CommissioningRig {
 protected:
  OwnTuning() : CommissioningRig(line_of_all("ismk")) {}
};
TEST_F(OwnTuning, AnIsmkThatIsStoppedDoesNotLearnOn) {
  const auto control = [this] { return value("ismk", "2340/10"); };
  const json before = control();
  for (line::Time at = 300ms; at < 6s; at += 900ms) {
    json_of(Method::post, "axes/ismk/jobs", R"({"do": "tune_itself"})");
    pass(at);
    ask(Method::post, "stop");
    EXPECT_EQ(control(), before) << at.count();
    pass(1s);
  }
}

TEST_P(Tuned, WithoutPowerItFailsInTime) {
  const json begun = begin(R"({"do": "tune", "seconds": 4})");
  pass(2s);
  json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "off"})");
  const json job = over(begun, 3s);
  EXPECT_EQ(job["state"], "failed") << job.dump();
  EXPECT_FALSE(job["error"]["hint"].get<std::string>().empty());
}

TEST_P(TuningOf, ItselfWhereItCan) {
  const json job = run(R"({"do": "tune_itself"})");
  if (!axis_.starts_with("ismk")) {
    EXPECT_EQ(job["state"], "failed");
    return;
  }
  ASSERT_EQ(job["state"], "done") << job.dump();
  EXPECT_EQ(job["found"]["result"], "tuned by the drive itself");
  EXPECT_TRUE(is_at_rest());
}

TEST_P(TuningOf, WrongRequestsAreRefused) {
  const std::string target = "axes/" + axis_ + "/jobs";
  EXPECT_EQ(ask(Method::post, target, R"({"do": "tune", "bandwidth_hz": 0})").status, 422U);
  EXPECT_EQ(ask(Method::post, target, R"({"do": "tune", "apply": 1})").status, 400U);
  EXPECT_EQ(ask(Method::post, target, R"({"do": "tune", "gain": 1})").status, 400U);
  EXPECT_EQ(ask(Method::get, "axes/nobody/gains").status, 404U);
}

}  // namespace
}  // namespace tuning_order_test
}  // namespace servodrome::studio
