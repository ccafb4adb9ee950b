#include "studio/trial_routes.hpp"

#include <array>

#include "api/body_reader.hpp"
#include "links/time.hpp"
#include "scenario/trial_report.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;
using api::Json;

constexpr const char* trial_place = "trial";

TrialRoutes& trial_of(const api::Call& call) { return *static_cast<TrialRoutes*>(call.context); }

// {"trials": [...], "master": "...", "format": "html" or "junit"}. The caller puts the sections in front of </html>.
Json report(api::Call& call) {
  api::BodyReader reader(call.body);
  const Json& given = reader.required("trials");
  if (!given.is_array()) throw ApiError{422, "is no array", "trials", "send what DELETE /api/v1/trial returned"};
  const std::string master = reader.string("master").value_or("");
  const std::string format = reader.string("format").value_or("html");
  reader.finish();
  const scenario::TrialJson trials(given);
  if (format == "html") {
    call.content = {"text/html; charset=utf-8", scenario::html_of(trials, {}, master)};
  } else if (format == "junit") {
    call.content = {"application/xml", scenario::junit_of(trials, master)};
  } else {
    throw ApiError{422, "there is no such format", "format", "give html or junit"};
  }
  return nullptr;
}

constexpr std::array trial_table{
    api::Route{api::Method::put, "/api/v1/trial", [](api::Call& call) { return trial_of(call).begin(call.body); }},
    api::Route{api::Method::post, "/api/v1/trial/master",
               [](api::Call& call) { return trial_of(call).master_ended(call.body); }},
    api::Route{api::Method::post, "/api/v1/trial/report", report},
    api::Route{api::Method::delete_, "/api/v1/trial", [](api::Call& call) { return trial_of(call).end(); }},
};

}  // namespace

std::span<const api::Route> TrialRoutes::table() { return trial_table; }

scenario::Director& TrialRoutes::director() const {
  if (record_ == nullptr) {
    throw ApiError{409, "no trial runs", trial_place, "begin one: PUT {\"text\": \"title = ...\"}"};
  }
  return *scenarios_.director();
}

Json TrialRoutes::begin(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("text");
  const std::string text = reader.string("text").value_or("");
  const std::string file = reader.string("file").value_or("scenario.toml");
  const double after_s = reader.number("after_s", 0, 60).value_or(3);
  reader.finish();
  scenario::Director& begun = scenarios_.begin(text, file, scenario::Routes::Extra::standard_expectations);
  record_.reset();  // of the trial that the scenario has replaced
  result_ = {};
  result_.path = file;
  result_.scenario = begun.scenario();
  const auto after = links::from_seconds(after_s);
  record_ = std::make_unique<TrialRecord>(line_, result_.scenario.duration + after);
  scenarios_.begin_trial();
  return Json{{"title", result_.scenario.title},
              {"duration_s", links::to_seconds(result_.scenario.duration)},
              {"seed", result_.scenario.seed}};
}

Json TrialRoutes::master_ended(const std::string& body) {
  api::BodyReader reader(body);
  reader.required("exit_status");
  const auto exit_status = static_cast<int>(reader.signed_integer("exit_status").value_or(0));
  const bool was_ended = reader.boolean("was_ended").value_or(false);
  const bool uses_buses = reader.boolean("uses_buses").value_or(false);
  std::string output = reader.string("output").value_or("");
  reader.finish();
  scenario::Director& its = director();
  result_.exit_status = exit_status;
  result_.was_ended = was_ended;
  result_.uses_buses = uses_buses;
  result_.master_output = std::move(output);
  its.master_ended(result_.exit_status == 0 && !result_.was_ended);
  line_.changed();
  return nullptr;
}

Json TrialRoutes::end() {
  scenario::Director& its = director();
  its.finish();
  record_->complete(result_, its);
  record_.reset();
  scenarios_.end_trial();
  line_.changed();
  // The trial is sent as text: as an object of api::Json its keys would lose the order that the program's JSON has.
  return Json{{"trial", scenario::json_of(result_).dump(-1, ' ', false, Json::error_handler_t::replace)},
              {"section", scenario::html_section_of(result_)}};
}

}  // namespace servodrome::studio
