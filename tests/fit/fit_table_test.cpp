// Recordings in all written forms, and files that are not recordings.
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fit/error.hpp"
#include "fit/signals.hpp"
#include "scope/files.hpp"

namespace servodrome::fit {
namespace fit_table_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

template <typename Call>
std::string problem_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

scope::Recording recording() {
  scope::Recording made{
      .channels = {{"position_actual_value", "pos"}, {"torque_actual_value", ""}}, .groups = {0, 1}, .group_count = 2};
  for (int row = 0; row < 4; ++row) {
    made.times.insert(made.times.end(), {row * 1ms, row * 1ms + 300us});
    made.values.insert(made.values.end(), {1000.0 + row, -0.5 * row});
  }
  made.zero_unix_ns = 1'700'000'000'000'000'000;
  return made;
}

void expect_as_recorded(const Table& table) {
  ASSERT_EQ(table.columns.size(), 2U);
  EXPECT_EQ(table.columns[0].name, "position_actual_value");
  EXPECT_EQ(table.columns[0].unit, "pos");
  EXPECT_THAT(table.columns[0].values, ElementsAre(1000, 1001, 1002, 1003));
  EXPECT_EQ(table.columns[1].name, "torque_actual_value");
  EXPECT_THAT(table.columns[1].values, ElementsAre(0, -0.5, -1, -1.5));
  const std::vector<double>& first = table.clocks[table.columns[0].clock];
  const std::vector<double>& second = table.clocks[table.columns[1].clock];
  ASSERT_EQ(second.size(), 4U);
  EXPECT_NEAR(first[3] - first[0], 3e-3, 1e-9);
  EXPECT_NEAR(second[2] - first[0], 2.3e-3, 1e-9);
}

TEST(FitTable, ReadsWhatScopeWrites) {
  expect_as_recorded(read_table(scope::csv_of(recording()), "a.csv"));
  expect_as_recorded(read_table(scope::mcap_of(recording()), "a.mcap"));
}

TEST(FitTable, ReadsScopesJson) {
  const Table table = read_table(
      R"({"channels":[{"name":"velocity_actual_value","unit":"rpm","seconds":[0,0.1],"values":[1,null]}]})", "a.json");
  EXPECT_EQ(table.columns.at(0).unit, "rpm");
  EXPECT_TRUE(std::isnan(table.columns[0].values[1]));
}

TEST(FitTable, ReadsTheBenchApisCsv) {
  const Table table = read_table(
      "tick,time_s,\"x current_a [A]\",\"y 6064:00 Position actual value [pos]\"\r\n16,0.001,1.5,7\r\n32,0.002,,8\r\n",
      "data.csv");
  EXPECT_EQ(table.columns.at(0).axis, "x");
  EXPECT_EQ(table.columns[0].name, "current_a");
  EXPECT_TRUE(std::isnan(table.columns[0].values[1]));
  EXPECT_EQ(table.columns.at(1).axis, "y");
  EXPECT_EQ(table.columns[1].name, "position_actual_value");
  EXPECT_THAT(table.clocks.at(0), ElementsAre(0.001, 0.002));
  EXPECT_THAT(problem_of([&] { signals_of(table, {}, {}, ""); }), HasSubstr("of 2 axes; choose one with --axis: x, y"));
  EXPECT_THAT(problem_of([&] { signals_of(table, {}, {}, "z"); }), HasSubstr("no axis \"z\""));
  const Signals signals = signals_of(table, {}, {}, "x");
  EXPECT_TRUE(signals.has(Role::quadrature_current));
  EXPECT_FALSE(signals.has(Role::position));
}

TEST(FitTable, SaysWhatIsWrongWithAFile) {
  const std::string mcap = scope::mcap_of(recording());
  struct Row {
    std::string bytes;
    const char* says;
  };
  const Row rows[] = {
      {"", "f: the file is empty"},
      {" \n", "f: the file is empty"},
      {"<svg/>", "f: this is a picture or a page"},
      {std::string("\x7F"
                   "ELF\0\0",
                   6),
       "f: this is neither a text file nor an MCAP file"},
      {"a,b\n1,2\n", "f: this is not a recording: no column \"seconds\" or \"time_s\" comes first"},
      {"seconds\n1\n", "f: this is not a recording: its first line names no channel"},
      {"seconds,a\n0,1\n1\n", "f:3: 1 fields, the first line has 2; the file is damaged or cut off"},
      {"seconds,a\n0,1\n1,x\n", "f:3: \"x\" in column 2 is not a number"},
      {"seconds,a\nnan,1\n", "f:2: \"nan\" in column 1 is not a number"},
      {"seconds,a\n0,1\n0,2\n", "f: time stands still or goes back at sample 2 (0 s)"},
      {"{\"a\":1}", "f: this JSON is not a recording"},
      {"{\"channels\":[{\"name\":\"a\"}]}", "f: this JSON has no samples; omit `-o`"},
      {"{", "f: this JSON is not a recording"},
      {mcap.substr(0, mcap.size() / 4), "the MCAP file is cut off or damaged"},
  };
  for (const Row& row : rows) {
    EXPECT_THAT(problem_of([&] { read_table(row.bytes, "f"); }), HasSubstr(row.says)) << row.bytes;
  }
}

// Changes any byte of a file: the file is accepted, or the error message names the problem.
TEST(FitTable, DamagedFilesAreReadOrRefused) {
  for (const std::string& whole : {scope::mcap_of(recording()), scope::csv_of(recording())}) {
    unsigned refused = 0;
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string damaged = whole;
      damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
      refused += problem_of([&] { read_table(damaged, "f"); }).empty() ? 0U : 1U;
    }
    EXPECT_GT(refused, 20U);
  }
}

TEST(FitSignals, AreInSiUnits) {
  Table table{.source = "t", .clocks = {{0.0, 1.0}}, .columns = {}};
  const auto with = [&](const char* name, const char* unit, const Motor& motor, Role role,
                        const std::vector<Assignment>& assignments = {}) {
    table.columns = {{"", name, unit, 0, {100.0, 100.0}}};
    const Signals signals = signals_of(table, motor, assignments, "");
    return signals.has(role) ? fmt::format("{:.5g}", signals.of(role)[0])
                             : signals.why_not[static_cast<std::size_t>(role)];
  };
  Motor motor;
  EXPECT_THAT(with("position_actual_value", "pos", motor, Role::position), HasSubstr("give --counts-per-revolution"));
  EXPECT_THAT(with("torque_actual_value", "0.1%", motor, Role::torque), HasSubstr("give --rated-torque"));
  EXPECT_THAT(with("current_actual_value", "0.1%", motor, Role::quadrature_current), HasSubstr("--rated-current"));
  EXPECT_THAT(with("velocity", "knots", motor, Role::velocity), HasSubstr("--signal velocity=COLUMN@UNIT"));
  motor = {.rated_torque_nm = 2.0, .rated_current_a = 3.0, .counts_per_revolution = 1000.0};
  EXPECT_EQ(with("position_actual_value", "pos", motor, Role::position), "0.62832");
  EXPECT_EQ(with("velocity_actual_value", "0.1rpm", motor, Role::velocity), "1.0472");
  EXPECT_EQ(with("torque_actual_value", "0.1%", motor, Role::torque), "0.2");
  EXPECT_EQ(with("torque_actual_value", "rated torque/1000", motor, Role::torque), "0.2");
  EXPECT_EQ(with("current_actual_value", "0.1%", motor, Role::quadrature_current), "0.42426");
  table.columns = {{"", "uq", "", 0, {100.0, 100.0}}};
  const Assignment assignment = parse_assignment("vq=Uq@0.1V");
  EXPECT_EQ(signals_of(table, motor, std::array{assignment}, "").of(Role::quadrature_voltage)[0], 10.0);
  EXPECT_THAT(problem_of([&] { signals_of(table, motor, std::array{parse_assignment("vd=ud")}, ""); }),
              HasSubstr("t: there is no column \"ud\"; columns are uq"));
  for (const char* text : {"vq", "vx=uq", "vq=", "=uq", "vq=@V"}) {
    EXPECT_THAT(problem_of([&] { parse_assignment(text); }), HasSubstr("roles are position, velocity")) << text;
  }
}

TEST(FitSignals, AVelocityThatDoesNotFitThePositionIsScaled) {
  Table table{.source = "t",
              .clocks = {{}},
              .columns = {{"", "position_actual_value", "rad", 0, {}}, {"", "velocity_actual_value", "vel", 0, {}}}};
  for (int i = 0; i < 1000; ++i) {
    table.clocks[0].push_back(1e-3 * i);
    table.columns[0].values.push_back(50.0 * std::sin(0.01 * i));
    table.columns[1].values.push_back(7.0 * 500.0 * std::cos(0.01 * i));
  }
  const Signals signals = signals_of(table, {.counts_per_revolution = 1000.0}, {}, "");
  EXPECT_NEAR(signals.of(Role::velocity)[0], 500.0, 1.0);
  EXPECT_THAT(signals.remarks, ElementsAre(HasSubstr("the velocity does not match the position")));
}

}  // namespace
}  // namespace fit_table_test
}  // namespace servodrome::fit
