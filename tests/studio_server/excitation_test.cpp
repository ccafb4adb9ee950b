// Jobs "sweep" and "step" of every product, in virtual time: the motion of the true shaft, and the loops that the jobs
// measure.
#include <algorithm>
#include <gmock/gmock.h>

#include "catalogue/product.hpp"
#include "commissioning_rig.hpp"
#include "studio/order.hpp"
#include "tools/tuning/spectrum.hpp"

namespace servodrome::studio {
namespace excitation_test {
namespace {

using api::Method;
using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

class ExcitationOf : public CommissioningRig, public testing::WithParamInterface<std::string> {
 protected:
  std::string axis_ = GetParam();

  json run(const std::string& body, line::Time longest = 30s) {
    return over(json_of(Method::post, "axes/" + axis_ + "/jobs", body), longest, 10ms);
  }
  void enable() {
    const json job = run(R"({"do": "enable"})");
    ASSERT_EQ(job["state"], "done") << job.dump();
  }
  line::Axis& axis() { return *line_.find_axis(axis_); }
  double counts_per_turn() const {
    return const_cast<ExcitationOf*>(this)->axis().plant().parameters().encoder.counts_per_revolution;
  }
  double turns() { return static_cast<double>(axis().plant().position_counts()) / counts_per_turn(); }
  // In revolutions per second, every half millisecond while the job runs.
  struct Samples {
    std::vector<double> target;
    std::vector<double> velocity;
    json job;
  };
  Samples sampled(const std::string& body) {
    Samples samples;
    const double per_rps = get("axes/" + axis_ + "/units")["velocity_per_rps"];
    json job = json_of(Method::post, "axes/" + axis_ + "/jobs", body);
    for (unsigned n = 0; job["state"] == "running" && n < 40'000; ++n) {
      pass(500us);
      samples.target.push_back(value(axis_, "60FF/0").get<double>() / per_rps);
      samples.velocity.push_back(axis().plant().velocity_rpm() / 60.0);
      if (n % 20 == 0) job = get(fmt::format("jobs/{}", job["id"].get<int>()));
    }
    samples.job = job;
    return samples;
  }
  std::vector<json> ramps() {
    std::vector<json> values;
    for (const char* object : {"6083/0", "6084/0"}) values.push_back(value(axis_, object));
    return values;
  }
};
INSTANTIATE_TEST_SUITE_P(Products, ExcitationOf, testing::ValuesIn(names_of_products()), name_of_test);

TEST_P(ExcitationOf, ASweepShowsTheVelocityLoop) {
  enable();
  const auto before = ramps();
  const Samples samples =
      sampled(R"({"do": "sweep", "amplitude": 1, "from_hz": 2, "to_hz": 150, "seconds": 3, "units": "revolutions"})");
  ASSERT_EQ(samples.job["state"], "done") << samples.job.dump();
  const auto points = master::tuning::response_of_signals(samples.target, samples.velocity, 500e-6,
                                                          {.lowest_hz = 3.0, .highest_hz = 120.0});
  ASSERT_GT(points.size(), 20U);
  EXPECT_NEAR(std::abs(points.front().response), 1.0, 0.1);  // a loop follows slow commands
  EXPECT_GT(points.front().coherence, 0.9);
  EXPECT_LT(std::arg(points.back().response), 0.0);  // and lags behind fast ones
  EXPECT_EQ(ramps(), before);
  EXPECT_EQ(get("axes/" + axis_)["state"], "operation enabled");
  pass(200ms);
  EXPECT_NEAR(axis().plant().velocity_rpm(), 0.0, 1.0);
}

TEST_P(ExcitationOf, AStepIsReachedAndGoneBack) {
  enable();
  pass(200ms);  // jmc_ec is in operation enabled 100 ms before its brake has opened (P01-30)
  const Samples samples = sampled(R"({"do": "step", "amplitude": 2, "seconds": 0.3, "units": "revolutions"})");
  ASSERT_EQ(samples.job["state"], "done") << samples.job.dump();
  const double highest = *std::max_element(samples.velocity.begin(), samples.velocity.end());
  EXPECT_GT(highest, 1.9);
  EXPECT_LT(highest, 3.6);
  const auto risen = std::count_if(samples.velocity.begin(), samples.velocity.end(), [](double v) { return v > 1.0; });
  EXPECT_NEAR(static_cast<double>(risen) * 0.5, 300.0, 60.0);
}

// The load decides how far a torque moves the axis. It brakes hard, although its ramps are slow.
TEST_P(ExcitationOf, TheTravelIsKept) {
  if (ask(Method::get, "axes/" + axis_ + "/objects/6071/0").status != 200U) return;  // no torque mode
  for (const double slowest_rps2 : {0.0, 2.0}) {
    enable();
    const double per_rps2 = get("axes/" + axis_ + "/units")["acceleration_per_rps2"];
    if (slowest_rps2 != 0.0) {
      const json slow{{"value", std::llround(slowest_rps2 * per_rps2)}};
      EXPECT_EQ(ask(Method::put, "axes/" + axis_ + "/objects/6084/0", slow.dump()).status, 204U);
    }
    const auto before = ramps();
    const double start = turns();
    const json job =
        run(R"({"do": "step", "of": "torque", "amplitude": 15, "seconds": 2, "travel": 1.5, "units": "revolutions"})");
    EXPECT_EQ(job["state"], "failed") << job.dump();
    EXPECT_THAT(job["error"]["what"].get<std::string>(), HasSubstr("are allowed"));
    // If the ramps do not stop the axis soon, the halt becomes a quick stop.
    EXPECT_EQ(get("axes/" + axis_)["state"] == "operation enabled", !job.contains("note")) << job.dump();
    EXPECT_EQ(ramps(), before);
    pass(300ms);
    EXPECT_NEAR(axis().plant().velocity_rpm(), 0.0, 1.0);
    EXPECT_LT(turns() - start, 2 * 1.5 + 1.0);
  }
}

TEST_P(ExcitationOf, WhatIsEndedPutsRampsBack) {
  enable();
  const auto before = ramps();
  const char* body = R"({"do": "sweep", "amplitude": 1, "seconds": 20, "units": "revolutions"})";
  const json first = json_of(Method::post, "axes/" + axis_ + "/jobs", body);
  pass(500ms);
  json_of(Method::delete_, fmt::format("jobs/{}", first["id"].get<int>()));
  pass(2s);
  EXPECT_EQ(get(fmt::format("jobs/{}", first["id"].get<int>()))["state"], "cancelled");
  EXPECT_EQ(ramps(), before);
  // Another job replaces it without a question.
  const json second = json_of(Method::post, "axes/" + axis_ + "/jobs", body);
  pass(500ms);
  const json stop = run(R"({"do": "stop"})");
  EXPECT_EQ(stop["state"], "done") << stop.dump();
  EXPECT_EQ(get(fmt::format("jobs/{}", second["id"].get<int>()))["state"], "cancelled");
  EXPECT_EQ(ramps(), before);
  pass(300ms);
  EXPECT_NEAR(axis().plant().velocity_rpm(), 0.0, 1.0);
}

TEST_P(ExcitationOf, BadOrdersAreRefused) {
  const auto refused = [&](const std::string& body, unsigned status) {
    EXPECT_EQ(ask(Method::post, "axes/" + axis_ + "/jobs", body).status, status) << body;
  };
  refused(R"({"do": "sweep"})", 400);
  refused(R"({"do": "sweep", "amplitude": 0})", 422);
  refused(R"({"do": "sweep", "amplitude": 1, "of": "colour"})", 422);
  refused(R"({"do": "sweep", "amplitude": 1, "to_hz": 4000})", 422);
  refused(R"({"do": "sweep", "amplitude": 1, "seconds": 1000})", 422);
  refused(R"({"do": "step", "amplitude": 1, "travel": -1})", 422);
  for (const char* of : {"velocity", "torque", "position"}) {
    for (const char* what : {"step", "sweep"}) {
      refused(json{{"do", what}, {"of", of}, {"amplitude", 1e12}}.dump(), 422);
    }
  }
  // Beyond the travel by the command alone.
  refused(R"({"do": "step", "amplitude": 5, "seconds": 2, "travel": 1.5, "units": "revolutions"})", 422);
  refused(R"({"do": "step", "of": "position", "amplitude": 1.1, "units": "revolutions"})", 422);
  refused(R"({"do": "sweep", "amplitude": 10, "from_hz": 1, "to_hz": 2, "units": "revolutions"})", 422);
  const json job = run(R"({"do": "step", "amplitude": 1, "units": "revolutions"})");
  EXPECT_EQ(job["state"], "failed");
  EXPECT_THAT(job["error"]["what"].get<std::string>(), HasSubstr("not enabled"));
}

// The ISMC on its bus reports no units: a step in its own units needs none, except for the travel that is not given.
TEST(ExcitationOrder, NeedsTheUnitsOfTheDriveForAnUnknownTravelOnly) {
  const auto unknown = [] { return std::optional<catalogue::AxisUnits>(); };
  EXPECT_NO_THROW(read_order(R"({"do": "step", "amplitude": 1000, "travel": 4000})", unknown));
  EXPECT_NO_THROW(read_order(R"({"do": "sweep", "amplitude": 1000, "travel": 4000})", unknown));
  EXPECT_THROW(read_order(R"({"do": "step", "amplitude": 1000})", unknown), master::MasterError);
  EXPECT_THROW(read_order(R"({"do": "step", "amplitude": 1, "travel": 1, "units": "revolutions"})", unknown),
               master::MasterError);
}

}  // namespace
}  // namespace excitation_test
}  // namespace servodrome::studio
