#include "scenario/routes.hpp"

#include <array>
#include <fmt/format.h>

#include "api/body_reader.hpp"
#include "api/query.hpp"
#include "links/time.hpp"
#include "scenario/catalogue.hpp"
#include "scenario/director.hpp"
#include "scenario/parse.hpp"
#include "scenario/standard.hpp"

namespace servodrome::scenario {
namespace {

using api::ApiError;
using api::Json;

constexpr const char* api_place = "scenario";

Json seconds_or_null(const std::optional<Time>& time) { return time ? Json(links::to_seconds(*time)) : Json(nullptr); }

Routes& routes_of(const api::Call& call) { return *static_cast<Routes*>(call.context); }

constexpr std::array route_table{
    api::Route{api::Method::get, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).show(); }},
    api::Route{api::Method::put, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).begin(call.body); }},
    api::Route{api::Method::post, "/api/v1/scenario/master",
               [](api::Call& call) { return routes_of(call).master_ended(call.body); }},
    api::Route{api::Method::delete_, "/api/v1/scenario", [](api::Call& call) { return routes_of(call).end(); }},
    api::Route{api::Method::get, "/api/v1/scenario/actions", [](api::Call&) -> Json { return action_catalogue(); }},
    api::Route{api::Method::get, "/api/v1/scenario/rules", [](api::Call& call) { return routes_of(call).rules(); }},
    api::Route{api::Method::post, "/api/v1/scenario/rules",
               [](api::Call& call) { return routes_of(call).add_rules(call.body); }},
    api::Route{api::Method::delete_, "/api/v1/scenario/rules/{}",
               [](api::Call& call) { return routes_of(call).remove_rule(api::unescaped(call.arguments[0])); }},
};

Json reports_of(const Director& director) {
  constexpr std::array phases{"waiting", "active", "over"};
  Json reports = Json::array();
  for (const RuleReport& rule : director.rules()) {
    reports.push_back({{"name", rule.name},
                       {"do", rule.action},
                       {"where", rule.where},
                       {"phase", phases[static_cast<std::size_t>(rule.phase)]},
                       {"acts", rule.acts},
                       {"first_act_s", seconds_or_null(rule.first_act)},
                       {"error", rule.error}});
  }
  return reports;
}

// Throws ApiError with line and column of the first error.
Scenario checked(ScenarioFile found) {
  if (found.diagnostics.empty()) return std::move(found.scenario);
  const line::Diagnostic& first = found.diagnostics.front();
  throw ApiError{422, first.what, fmt::format("{}:{}:{}", first.file, first.line, first.column), first.hint};
}

}  // namespace

Routes::Routes(line::Line& line) : line_(line) {}
Routes::~Routes() = default;

std::span<const api::Route> Routes::table() { return route_table; }

Json Routes::begin(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("text");
  const std::string text = reader.string("text").value_or("");
  const std::string file = reader.string("file").value_or("scenario.toml");
  reader.finish();
  refuse_in_trial();
  begin(text, file, Extra::none);
  return show();
}

Director& Routes::begin(const std::string& text, const std::string& file, Extra extra) {
  Scenario scenario = checked(parse_scenario(text, file));
  if (extra == Extra::standard_expectations) {
    std::vector<std::string> axes;
    for (const auto& axis : line_.axes()) axes.push_back(axis->settings().name);
    for (Expectation& one : standard_expectations(scenario, axes)) {
      scenario.expectations.push_back(std::move(one));
    }
  }
  std::unique_ptr<Director> next;
  try {
    next = std::make_unique<Director>(line_, std::move(scenario));
  } catch (const ScenarioError& error) {
    throw ApiError{422, error.what(), fmt::format("{}: {}", file, error.where()), error.hint()};
  }
  begin(std::move(next));
  in_trial_ = false;
  return *director_;
}

void Routes::refuse_in_trial() const {
  if (!in_trial_) return;
  throw ApiError{409, "a trial runs, and the scenario is part of it", api_place, "DELETE /api/v1/trial ends the trial"};
}

// The former scenario ends first, because two scenarios cannot intercept the same messages.
void Routes::begin(std::unique_ptr<Director> next) {
  if (director_) next->take_over(*director_);
  director_.reset();
  director_ = std::move(next);
  director_->begin();
}

Json Routes::rules() const {
  const bool is_begun = director_ != nullptr && !director_->finished();
  return Json{{"rules", is_begun ? reports_of(*director_) : Json::array()}};
}

Json Routes::show() const {
  if (!director_) throw ApiError{404, "no scenario has begun", api_place, "begin one: PUT {\"text\": \"title = ...\"}"};
  constexpr std::array outcomes{"passed", "failed", "not reached"};
  Json expectations = Json::array();
  for (const Verdict& verdict : director_->verdicts()) {
    expectations.push_back({{"name", verdict.name},
                            {"outcome", outcomes[static_cast<std::size_t>(verdict.outcome)]},
                            {"at_s", links::to_seconds(verdict.at)},
                            {"found", verdict.found}});
  }
  return Json{{"title", director_->scenario().title},
              {"ended", director_->finished()},
              {"rules", reports_of(*director_)},
              {"expectations", std::move(expectations)}};
}

Json Routes::add_rules(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("text");
  const std::string text = reader.string("text").value_or("");
  reader.finish();
  const std::vector<Rule> added = checked(parse_rules(text, "rules")).rules;
  try {
    if (!director_ || director_->finished()) {
      Scenario scenario;
      scenario.title = "rules by hand";
      auto next = std::make_unique<Director>(line_, std::move(scenario));
      next->check(added);
      begin(std::move(next));
    }
    director_->add(added);
  } catch (const ScenarioError& error) {
    throw ApiError{422, error.what(), error.where(), error.hint()};
  }
  return rules();
}

Json Routes::remove_rule(const std::string& name) {
  if (director_ && !director_->was_added(name)) refuse_in_trial();
  if (!director_ || director_->finished() || !director_->remove(name)) {
    throw ApiError{404, fmt::format("there is no rule \"{}\"", name), api_place,
                   "GET /api/v1/scenario lists the rules"};
  }
  return rules();
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
  refuse_in_trial();
  if (director_) director_->finish();
  line_.changed();
  return show();
}

}  // namespace servodrome::scenario
