#include "scenario/routes.hpp"

#include <array>
#include <fmt/format.h>

#include "api/body_reader.hpp"
#include "scenario/director.hpp"
#include "scenario/parse.hpp"
#include "scenario/standard.hpp"

namespace servodrome::scenario {
namespace {

using api::ApiError;
using api::Json;

constexpr const char* api_place = "scenario";

double seconds(Time time) { return std::chrono::duration<double>(time).count(); }

Json seconds_or_null(const std::optional<Time>& time) { return time ? Json(seconds(*time)) : Json(nullptr); }

Routes& routes_of(const api::Call& call) { return *static_cast<Routes*>(call.context); }

constexpr std::array route_table{
    api::Route{api::Method::get, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).show(); }},
    api::Route{api::Method::put, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).begin(call.body); }},
    api::Route{api::Method::post, "/api/v1/scenario/master",
               [](api::Call& call) { return routes_of(call).master_ended(call.body); }},
    api::Route{api::Method::delete_, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).end(); }},
};

}  // namespace

Routes::Routes(line::Line& line) : line_(line) {}
Routes::~Routes() = default;

api::RouteGroup Routes::group() { return {route_table, this}; }

Json Routes::begin(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("text");
  const std::string text = reader.string("text").value_or("");
  const std::string file = reader.string("file").value_or("scenario.toml");
  reader.finish();
  begin(text, file, Extra::none);
  return show();
}

Director& Routes::begin(const std::string& text, const std::string& file, Extra extra) {
  ScenarioFile parsed = parse_scenario(text, file);
  if (!parsed.diagnostics.empty()) {
    const line::Diagnostic& first = parsed.diagnostics.front();
    throw ApiError{422, first.what, fmt::format("{}:{}:{}", first.file, first.line, first.column), first.hint};
  }
  if (extra == Extra::standard_expectations) {
    std::vector<std::string> axes;
    for (const auto& axis : line_.axes()) axes.push_back(axis->settings().name);
    for (Expectation& one : standard_expectations(parsed.scenario, axes)) {
      parsed.scenario.expectations.push_back(std::move(one));
    }
  }
  std::unique_ptr<Director> next;
  try {
    next = std::make_unique<Director>(line_, std::move(parsed.scenario));
  } catch (const ScenarioError& error) {
    throw ApiError{422, error.what(), fmt::format("{}: {}", file, error.where()), error.hint()};
  }
  director_.reset();
  director_ = std::move(next);
  director_->begin();
  return *director_;
}

Json Routes::show() const {
  if (!director_) throw ApiError{404, "no scenario has begun", api_place, "begin one: PUT {\"text\": \"title = ...\"}"};
  Json rules = Json::array();
  for (const RuleReport& rule : director_->rules()) {
    rules.push_back({{"name", rule.name},
                     {"acts", rule.acts},
                     {"first_act_s", seconds_or_null(rule.first_act)},
                     {"error", rule.error}});
  }
  constexpr std::array outcomes{"passed", "failed", "not reached"};
  Json expectations = Json::array();
  for (const Verdict& verdict : director_->verdicts()) {
    expectations.push_back({{"name", verdict.name},
                            {"outcome", outcomes[static_cast<std::size_t>(verdict.outcome)]},
                            {"at_s", seconds(verdict.at)},
                            {"found", verdict.found}});
  }
  return Json{{"title", director_->scenario().title},
              {"ended", director_->finished()},
              {"rules", std::move(rules)},
              {"expectations", std::move(expectations)}};
}

Json Routes::master_ended(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("success");
  const bool success = reader.boolean("success").value_or(false);
  reader.finish();
  if (director_) director_->master_ended(success);
  line_.changed();
  return show();
}

Json Routes::end() {
  if (director_) director_->finish();
  line_.changed();
  return show();
}

}  // namespace servodrome::scenario
