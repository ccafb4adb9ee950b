// Which moves the server refuses because they end beyond the travel: the cases of tests/data/reach.json, which the page
// reads as well (studio/src/model/plan.test.ts).
#include "studio/reach.hpp"

#include <fstream>
#include <gmock/gmock.h>

#include "catalogue/product.hpp"
#include "commissioning_rig.hpp"
#include "drive/drive.hpp"
#include "source_dir.hpp"

namespace servodrome::studio {
namespace reach_test {
namespace {

using api::Method;
using nlohmann::json;
using testing::HasSubstr;

json cases() {
  std::ifstream file(SERVODROME_SOURCE_DIR "/tests/data/reach.json");
  return json::parse(file);
}

// An axis with limit switches at -10 and 10 revolutions.
class ReachTest : public CommissioningRig {
 protected:
  explicit ReachTest(const std::string& product) : CommissioningRig(line_of(product)), axis_(product) {}

  static std::string line_of(const std::string& product) {
    const int counts = product == "jmc_ec" ? 4000 : product.starts_with("ismk") ? 65536 : 131072;
    return line_of_all(product) + fmt::format(
                                      "[axis.travel]\ncounts_per_unit = {}\nlow_stop = -11\nhigh_stop = 11\n"
                                      "negative_limit = -10\npositive_limit = 10\nstart = 0.25\n",
                                      counts);
  }
  std::string path(const std::string& rest) const { return "axes/" + axis_ + "/" + rest; }
  std::int64_t units(const json& revolutions) {
    const double turn = get(path("units"))["position_per_revolution"];
    return std::llround(revolutions.get<double>() * turn);
  }
  json units_of_span(const json& span) { return span.is_null() ? json() : json{units(span[0]), units(span[1])}; }
  void write(const std::string& object, std::int64_t value) {
    const api::Response response = ask(Method::put, path("objects/" + object), json{{"value", value}}.dump());
    EXPECT_EQ(response.status, 204U) << object << " " << response.body;
  }
  void write_span(const std::string& index, catalogue::SoftwareLimitSubs subs, const json& span) {
    write(fmt::format("{}/{}", index, subs.lowest), units(span[0]));
    write(fmt::format("{}/{}", index, subs.highest), units(span[1]));
  }
  void carry_out(const json& order) {
    const json job = over(json_of(Method::post, path("jobs"), order.dump()), std::chrono::seconds(60),
                          std::chrono::milliseconds(20));
    EXPECT_EQ(job["state"], "done") << job.dump();
  }
  // The axis is not enabled, so an accepted move fails before the axis moves.
  api::Response answer_to(const json& move, bool beyond = false) {
    json order{{"do", "move"}, {"velocity", 1}, {"acceleration", 50}, {"units", "revolutions"}, {"beyond", beyond}};
    for (const char* key : {"to", "by"}) {
      if (move.contains(key)) order[key] = move[key];
    }
    const std::size_t before = get("jobs")["jobs"].size();
    api::Response response = ask(Method::post, path("jobs"), order.dump());
    if (response.status == 201U) {
      const json job = over(json::parse(response.body), std::chrono::seconds(10), std::chrono::milliseconds(5));
      EXPECT_EQ(job["state"], "failed") << job.dump();
    } else {
      EXPECT_EQ(get("jobs")["jobs"].size(), before) << move.dump();
    }
    return response;
  }
  void expect_accepted(const json& moves, bool beyond = false) {
    for (const json& move : moves) EXPECT_EQ(answer_to(move, beyond).status, 201U) << move.dump();
  }
  void expect_refused(const json& moves, const std::string& reason) {
    for (const json& move : moves) {
      const api::Response response = answer_to(move);
      EXPECT_EQ(response.status, 409U) << move.dump() << " " << response.body;
      EXPECT_THAT(response.body, HasSubstr(fmt::format(fmt::runtime(reason), move.value("side", ""))));
      EXPECT_THAT(response.body, HasSubstr(R"(send \"beyond\": true)"));
    }
    expect_accepted(moves, true);
  }

  std::string axis_;
};

struct LimitCase {
  json row;
  std::string product;
  friend void PrintTo(const LimitCase& one, std::ostream* out) { *out << one.row.dump(); }
};
std::vector<LimitCase> limit_cases() {
  std::vector<LimitCase> all;
  const json rows = cases()["software_limits"];
  for (const json& row : rows) {
    for (const json& product : row["products"]) all.push_back({row, product});
  }
  return all;
}
std::string name_of_case(const testing::TestParamInfo<LimitCase>& one) {
  std::string name = one.param.row["case"].get<std::string>() + "_" + one.param.product;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char letter) { return std::isalnum(letter) == 0; }, '_');
  return name;
}

class SoftwareLimits : public ReachTest, public testing::WithParamInterface<LimitCase> {
 protected:
  SoftwareLimits() : ReachTest(GetParam().product) {}
};
INSTANTIATE_TEST_SUITE_P(Reach, SoftwareLimits, testing::ValuesIn(limit_cases()), name_of_case);

TEST_P(SoftwareLimits, BoundMovesWhileTheyAct) {
  const json& row = GetParam().row;
  const catalogue::Dialect& dialect = catalogue::product_of(axis_).dialect;
  if (row["is_homed"]) {
    carry_out({{"do", "enable"}});
    carry_out({{"do", "home"},
               {"method", dialect.cautious_homing_method},
               {"speed", 2},
               {"zero_speed", 1},
               {"offset", 0},
               {"acceleration", 50},
               {"units", "revolutions"}});
    carry_out({{"do", "disable"}});
  }
  if (row.contains("607B")) write_span("607B", {}, row["607B"]);
  if (row.contains("607D")) write_span("607D", dialect.software_limits, row["607D"]);
  pass(std::chrono::milliseconds(100));

  const json limits = get(path("limits"));
  const json acts = units_of_span(row["acts"]);
  EXPECT_EQ(limits["lowest_position"], acts.is_null() ? json() : acts[0]);
  EXPECT_EQ(limits["highest_position"], acts.is_null() ? json() : acts[1]);
  EXPECT_EQ(limits["wraps_within"], units_of_span(row["wraps_within"]));
  const drive::Axis& axis = line_.find_axis(axis_)->device().drive().axis();
  EXPECT_EQ(axis.software_limits_active(), !acts.is_null()) << "by the drive itself";
  EXPECT_EQ(axis.position_range() != 0, !row["wraps_within"].is_null()) << "by the drive itself";

  expect_refused(row["refused"], "est position of 607");
  expect_accepted(row["accepted"]);
}

class Switches : public ReachTest, public testing::WithParamInterface<std::string> {
 protected:
  Switches() : ReachTest(GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Reach, Switches, testing::ValuesIn(names_of_products()), name_of_test);

TEST_P(Switches, BoundMoves) {
  const json rows = cases()["switches"];
  expect_refused(rows["refused"], "beyond the {} limit switch at ");
  expect_accepted(rows["accepted"]);
  if (get(path("values?objects=607E:00"))["values"]["607E:00"].is_null()) return;
  write("607E/0", axis_.starts_with("ismk") ? 1 : 0x80);
  pass(std::chrono::milliseconds(100));
  if (!line_.find_axis(axis_)->device().drive().axis().units.position_inverted) return;  // it ignores 607Eh
  expect_refused(rows["refused_with_reversed_polarity"], "beyond the {} limit switch at ");
}

}  // namespace
}  // namespace reach_test
}  // namespace servodrome::studio
