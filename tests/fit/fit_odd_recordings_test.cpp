// Odd recordings: gaps, clocks that do not overlap, missing samples, documents that are damaged or too large. Each is
// fitted, or refused with an error that names the place and the remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "draws.hpp"
#include "fit/error.hpp"
#include "fit/report.hpp"
#include "synthetic_axis.hpp"

namespace servodrome::fit {
namespace fit_odd_recordings_test {
namespace {

using test::Draw;
using test::forget;
using test::SyntheticAxis;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

template <typename Call>
std::string problem_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string problem_of_file(const std::string& bytes) {
  return problem_of([&] { signals_of(read_table(bytes, "f"), {}, {}, ""); });
}

// The recording of a synthetic axis, with all signals on one clock and in SI units.
Table table_of(const Signals& signals) {
  static constexpr std::pair<Role, std::pair<const char*, const char*>> columns[] = {
      {Role::position, {"position", "rad"}},
      {Role::velocity, {"velocity", "rad/s"}},
      {Role::quadrature_current, {"current_a", "A"}},
      {Role::direct_current, {"direct_current_a", "A"}},
      {Role::quadrature_voltage, {"quadrature_voltage_v", "V"}},
      {Role::direct_voltage, {"direct_voltage_v", "V"}},
  };
  Table table{.source = "t", .clocks = {signals.seconds}, .columns = {}};
  for (const auto& [role, name] : columns) {
    if (signals.has(role)) table.columns.push_back({"", name.first, name.second, 0, signals.of(role)});
  }
  return table;
}

std::array<double, parameter_count> truth_of(const SyntheticAxis& axis) {
  return {axis.resistance_ohm, 0.0,
          axis.quadrature_h,   axis.torque_constant(),
          axis.inertia_kgm2,   axis.coulomb_nm,
          axis.viscous_nms,    axis.weight_nm,
          axis.delay_s,        0.0};
}

void expect_found(const Result& result, const SyntheticAxis& axis) {
  const std::array<double, parameter_count> truth = truth_of(axis);
  for (const Figure& figure : result.figures) {
    if (figure.parameter == Parameter::direct_inductance) continue;
    const double expected = truth[static_cast<std::size_t>(figure.parameter)];
    ASSERT_TRUE(figure.value) << text_of(figure.parameter).word << ": " << figure.why_not;
    EXPECT_NEAR(*figure.value, expected, expected == 0.0 ? 1e-5 : 0.01 * std::abs(expected))
        << text_of(figure.parameter).word;
  }
}

TEST(FitOddRecordings, AGapOfYearsIsLeftOut) {
  const SyntheticAxis axis;
  for (const double gap_s : {10.0, 1e9}) {
    for (const bool by_position : {true, false}) {
      Signals signals = axis.signals();
      if (!by_position) forget(signals, {Role::position});
      for (std::size_t i = 4000; i < signals.seconds.size(); ++i) signals.seconds[i] += gap_s;
      const Signals read = signals_of(table_of(signals), axis.motor(), {}, "");
      EXPECT_NEAR(read.rate_hz(), 4000.0, 1.0);
      const Result result = fit(read, axis.motor());
      expect_found(result, axis);
      EXPECT_THAT(result.remarks, Contains(HasSubstr("a gap of")));
    }
  }
}

TEST(FitOddRecordings, SamplesSecondsApartAreTooSlow) {
  Signals signals = SyntheticAxis{}.signals();
  for (double& time : signals.seconds) time *= 1e6;
  EXPECT_THAT(problem_of([&] { fit(signals, SyntheticAxis{}.motor()); }),
              AllOf(HasSubstr("250 s apart"), HasSubstr("record at")));
}

TEST(FitOddRecordings, ClocksThatDoNotOverlapAreRefused) {
  Table table{.source = "t",
              .clocks = {{0.0, 1.0, 2.0}, {5.0, 6.0, 7.0}},
              .columns = {{"", "torque", "Nm", 0, {1.0, 2.0, 3.0}}, {"", "position", "rad", 1, {1.0, 2.0, 3.0}}}};
  const std::string problem = problem_of([&] { signals_of(table, {}, {}, ""); });
  EXPECT_THAT(problem, AllOf(HasSubstr("t: "), HasSubstr("position"), HasSubstr("torque"), HasSubstr("5 to 7 s"),
                             HasSubstr("0 to 2 s"), HasSubstr("record both at the same time")));
  // The same through a file, and for a column that has no number at all.
  EXPECT_THAT(problem_of_file("seconds_1,torque [Nm],seconds_2,velocity [rpm]\n0,1,5,1\n1,1,6,1\n"),
              HasSubstr("do not overlap"));
  EXPECT_THAT(problem_of_file("seconds,torque [Nm],velocity [rpm]\n0,1,\n1,1,\n"),
              AllOf(HasSubstr("velocity"), HasSubstr("has no sample"), HasSubstr("record")));
  EXPECT_THAT(problem_of_file("seconds,torque [Nm],velocity [rpm]\n0,1,\n1,,1\n"), HasSubstr("at the same time"));
  // A motion that begins without a position.
  Signals signals = SyntheticAxis{}.signals();
  signals.values[static_cast<std::size_t>(Role::position)][0] = std::nan("");
  EXPECT_EQ(problem_of([&] { fit(signals, SyntheticAxis{}.motor()); }), "");
}

TEST(FitOddRecordings, TheFactorOfAUnitIsANumber) {
  for (const char* factor : {"0", "0.0", "-0", "inf", "nan", "-inf", "infinity", "1e-300", "1e300", "1e999"}) {
    EXPECT_THAT(problem_of([&] { parse_assignment(fmt::format("vq=uq@{}V", factor)); }),
                AllOf(HasSubstr(fmt::format("--signal vq=uq@{}V", factor)), HasSubstr("factor"), HasSubstr("0.1V")))
        << factor;
    Table table{
        .source = "t", .clocks = {{0.0, 1.0}}, .columns = {{"", "vq", fmt::format("{}V", factor), 0, {1.0, 2.0}}}};
    const Signals signals = signals_of(table, {}, {}, "");
    EXPECT_FALSE(signals.has(Role::quadrature_voltage)) << factor;
    EXPECT_THAT(signals.why_not[static_cast<std::size_t>(Role::quadrature_voltage)], HasSubstr("factor")) << factor;
  }
  EXPECT_EQ(parse_assignment("vq=uq@-0.1V").unit, "-0.1V");
  EXPECT_EQ(parse_assignment("position=p@inc").unit, "inc");
}

TEST(FitOddRecordings, TablesThatAreEmptyOrOddAreRefused) {
  struct Row {
    std::string bytes;
    std::vector<const char*> says;
  };
  const auto json = [](const char* seconds, const char* values) {
    return fmt::format(R"({{"channels":[{{"name":"velocity","unit":"rpm","seconds":{},"values":{}}}]}})", seconds,
                       values);
  };
  std::string wide = "seconds";
  for (int i = 0; i < 10'000'000; ++i) wide += ",a";
  std::string deep = R"({"channels":)";
  deep += std::string(1'000'000, '[');
  std::string crowded = R"({"channels":[)";
  for (int i = 0; i < 1'000'000; ++i) crowded += i == 0 ? "{}" : ",{}";
  const Row rows[] = {
      {R"({"channels":[]})", {"f: ", "no channel", "give a .csv"}},
      {R"({"channels":[1]})", {"f: this JSON has no samples", "omit `-o`"}},
      {R"({"channels":{}})", {"f: this JSON is not a recording"}},
      {R"({"channels":[{"name":"velocity","seconds":[0,1],"values":[1]}]})", {"velocity", "2 times", "1 value"}},
      {json("[0,1]", R"(["1","2"])"), {"f: channel \"velocity\"", "value 1 is \"1\"", "not a number"}},
      {json("[0,1]", "[1,true]"), {"value 2 is true", "not a number"}},
      {json(R"(["0",1])", "[1,2]"), {"time 1 is \"0\"", "not a number"}},
      {json("[null,1]", "[1,2]"), {"time 1 is null", "not a number"}},
      {json("[0,NaN]", "[1,2]"), {"f: this JSON is not a recording: it cannot be read at byte"}},
      {json("[0,1]", "[1,NaN]"), {"f: this JSON is not a recording: it cannot be read at byte", "null"}},
      {json("[0,1]", "[null,null]"), {"velocity", "has no sample"}},
      {json("[0,0]", "[1,2]"), {"time stands still or goes back at sample 2"}},
      {json("[1,0]", "[1,2]"), {"time stands still or goes back at sample 2"}},
      {json("[0,1e300]", "[1,2]"), {"the time of sample 2 is 1e+300 s", "record again"}},
      {json("[-1e300,1]", "[1,2]"), {"the time of sample 1 is -1e+300 s"}},
      {json("[0,1]", "[1,1e300]"), {"velocity", "1e+300", "sample 2"}},
      {deep, {"f: ", "JSON", "give a .csv"}},
      {crowded, {"f: ", "JSON"}},
      {"seconds,velocity [rpm]\n0,1\n1e300,2\n", {"f:3: \"1e300\" in column 1"}},
      {"seconds,velocity [rpm]\n0,1\n1,inf\n", {"f:3: \"inf\" in column 2 is not a number"}},
      {"seconds,velocity [rpm]\n0,nan\n1,nan\n", {"velocity", "has no sample"}},
      {"seconds,velocity [rpm]\n0,1\n1,1e300\n", {"velocity", "1e+300", "sample 2"}},
      {"seconds,velocity [rpm]\n", {"has no sample"}},
      {wide, {"f: ", "more than 4096 columns"}},
  };
  for (const Row& row : rows) {
    for (const char* says : row.says)
      EXPECT_THAT(problem_of_file(row.bytes), HasSubstr(says)) << row.bytes.substr(0, 90);
  }
  const Signals one = signals_of(read_table("seconds,velocity [rpm]\n0,1\n", "f"), {}, {}, "");
  EXPECT_THAT(problem_of([&] { fit(one, {}); }), HasSubstr("f: 1 samples are too few; record at least 200"));
}

TEST(FitOddRecordings, AnAxisThatTheRecordingDoesNotNameIsRefused) {
  const Table table = read_table("seconds,velocity [rpm]\n0,1\n1,2\n", "f");
  EXPECT_TRUE(signals_of(table, {}, {}, "").has(Role::velocity));
  EXPECT_THAT(problem_of([&] { signals_of(table, {}, {}, "x"); }),
              AllOf(HasSubstr("f: "), HasSubstr("--axis x"), HasSubstr("have no axis name"), HasSubstr("omit --axis")));
}

TEST(FitOddRecordings, AClearlyNegativeFrictionIsRemarked) {
  const SyntheticAxis wrong{.coulomb_nm = -0.1};
  const Result result = fit(wrong.signals(), wrong.motor());
  ASSERT_TRUE(result.of(Parameter::coulomb_friction).value);
  EXPECT_NEAR(*result.of(Parameter::coulomb_friction).value, -0.1, 0.005);
  const auto remark = AllOf(HasSubstr("remark: "), HasSubstr("Coulomb friction"), HasSubstr("negative"),
                            HasSubstr("sign of a channel"), HasSubstr("unit"), HasSubstr("--signal"));
  EXPECT_THAT(table_of(result), remark);
  const std::string toml = toml_of(result, wrong.motor());
  EXPECT_THAT(toml, remark);
  EXPECT_TRUE(toml.starts_with("# remark: ")) << toml;
  EXPECT_THAT(toml, HasSubstr("\ncoulomb_friction_nm = 0.0 "));
  const SyntheticAxis right;
  const Result fine = fit(right.signals(), right.motor());
  EXPECT_THAT(table_of(fine), Not(HasSubstr("remark")));
  EXPECT_THAT(toml_of(fine, right.motor()), Not(HasSubstr("remark")));
  // Negative, but not beyond its uncertainty: friction that is too small to be seen.
  Result small = fine;
  Figure& figure = small.figures[static_cast<std::size_t>(Parameter::coulomb_friction)];
  figure.value = -0.01;
  figure.half_width = 0.02;
  EXPECT_THAT(toml_of(small, right.motor()), AllOf(HasSubstr("coulomb_friction_nm = 0.0 "), Not(HasSubstr("remark"))));
}

// A fifth of all values is missing: in one recording as missing rows, in the other as empty fields.
TEST(FitOddRecordings, IntervalsHoldTheTruthWithAFifthOfTheSamplesMissing) {
  const auto draws = static_cast<unsigned>(servodrome::test::draws(40));
  SyntheticAxis axis;
  axis.duration_s = 3.0;
  const Signals clean = axis.signals();
  const std::array<double, parameter_count> truth = truth_of(axis);
  for (const bool as_rows : {true, false}) {
    std::array<unsigned, parameter_count> held{};
    for (unsigned n = 0; n < draws; ++n) {
      Draw draw((as_rows ? 7000 : 8000) + n);
      Table whole = table_of(clean);
      constexpr double deviations[] = {0.002, 2.0, 0.05, 0.05, 0.5, 0.5};
      for (std::size_t i = 0; i < whole.columns.size(); ++i) {
        for (double& value : whole.columns[i].values) value += deviations[i] * draw.normal();
      }
      Table table = whole;
      table.clocks[0].clear();
      for (Column& column : table.columns) column.values.clear();
      for (std::size_t row = 0; row < clean.seconds.size(); ++row) {
        const bool is_lost = draw.uniform(0.0, 1.0) < 0.2;
        if (is_lost && as_rows) continue;
        table.clocks[0].push_back(whole.clocks[0][row]);
        for (std::size_t i = 0; i < table.columns.size(); ++i) {
          table.columns[i].values.push_back(is_lost ? std::nan("") : whole.columns[i].values[row]);
        }
      }
      const Result result = fit(signals_of(table, axis.motor(), {}, ""), axis.motor());
      for (std::size_t i = 0; i < parameter_count; ++i) {
        if (static_cast<Parameter>(i) == Parameter::direct_inductance) continue;
        const Figure& figure = result.figures[i];
        ASSERT_TRUE(figure.value) << text_of(figure.parameter).word << ": " << figure.why_not;
        held[i] += std::abs(*figure.value - truth[i]) <= figure.half_width ? 1U : 0U;
        EXPECT_LT(figure.half_width, truth[i] == 0.0 ? 1e-3 : std::abs(truth[i])) << text_of(figure.parameter).word;
      }
    }
    for (std::size_t i = 0; i < parameter_count; ++i) {
      if (static_cast<Parameter>(i) == Parameter::direct_inductance) continue;
      const std::string_view name = text_of(static_cast<Parameter>(i)).word;
      fmt::print("{:<26} held by {} of {} intervals\n", name, held[i], draws);
      // 95 %, less three deviations of the binomial distribution.
      EXPECT_GE(held[i], 0.95 * draws - 3.0 * std::sqrt(0.95 * 0.05 * draws)) << name;
    }
  }
}

}  // namespace
}  // namespace fit_odd_recordings_test
}  // namespace servodrome::fit
