#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <limits>
#include <optional>

#include "catalogue/product.hpp"
#include "catalogue/status_words.hpp"
#include "links/nearest_name.hpp"
#include "links/number_text.hpp"
#include "studio/jobs.hpp"
#include "studio/route_names.hpp"
#include "tools/tuning/drive_gains.hpp"

// The calls of the API that move axes.
namespace servodrome::studio {
namespace {

Jobs& jobs_of(const Call& call) { return *static_cast<Jobs*>(call.context); }

const char* word(JobState state) {
  switch (state) {
    case JobState::running: return "running";
    case JobState::done: return "done";
    case JobState::failed: return "failed";
    case JobState::cancelled: return "cancelled";
  }
  return "";
}

Json view_of(const JobError& error) { return Json{{"what", error.what}, {"where", error.where}, {"hint", error.hint}}; }

Job& job_argument(Call& call) {
  const std::string_view text = call.arguments.front();
  const auto id = links::number_of_text<std::uint64_t>(text);
  Job* job = id ? jobs_of(call).find(*id) : nullptr;
  if (job != nullptr) return *job;
  throw ApiError{404, fmt::format("there is no job \"{}\"", text.substr(0, 40)), "address",
                 fmt::format("GET /api/v1/jobs lists the last {}", Jobs::most_remembered)};
}

std::string axis_name(Call& call) {
  const std::vector<std::string> names = jobs_of(call).drives().names();
  const std::string_view name = call.arguments.front();
  if (std::find(names.begin(), names.end(), name) != names.end()) return std::string(name);
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "address",
                 links::suggestion(name, {names.begin(), names.end()})};
}

Json begin_job(Call& call) {
  const Job& job = jobs_of(call).begin(axis_name(call), call.body, call.obsolete);
  call.halts = job.order.takes_over;
  return view_of(job);
}

// The result of a job may be long, so only the view of a single job shows it.
Json list_jobs(Call& call) {
  Json jobs = Json::array();
  for (const Job& job : jobs_of(call).all()) jobs.push_back(view_of(job, false));
  return Json{{"jobs", std::move(jobs)}};
}

Json show_job(Call& call) { return view_of(job_argument(call)); }

Json end_job(Call& call) {
  Job& job = job_argument(call);
  BodyReader(call.body, true).finish();
  jobs_of(call).cancel(job);
  call.halts = true;
  return view_of(job);
}

Json keep_alive(Call& call) {
  Job& job = job_argument(call);
  BodyReader(call.body, true).finish();
  jobs_of(call).sign_of_life(job);
  return view_of(job);
}

// Ignores the body, so that no mistake in it prevents the stop.
Json stop_all(Call& call) {
  call.halts = true;
  Json axes = Json::array();
  for (const Jobs::Stopped& one : jobs_of(call).stop_all()) {
    axes.push_back({{"name", one.axis}, {"stopped", !one.error}});
    if (one.error) axes.back()["error"] = view_of(*one.error);
  }
  return Json{{"axes", std::move(axes)}};
}

Json show_units(Call& call) {
  const std::string axis = axis_name(call);
  try {
    const auto units = jobs_of(call).drives().units(axis);
    const auto per_revolution = [&](double catalogue::AxisUnits::*part) {
      return units ? Json((*units).*part) : Json();
    };
    return Json{{"position_per_revolution", per_revolution(&catalogue::AxisUnits::position)},
                {"velocity_per_rps", per_revolution(&catalogue::AxisUnits::velocity)},
                {"acceleration_per_rps2", per_revolution(&catalogue::AxisUnits::acceleration)}};
  } catch (const master::MasterError& error) {
    throw ApiError{409, error.happened(), error.where(), error.remedy()};
  }
}

// The names of modes and of the statusword's bits, as the axis's product uses them.
Json show_words(Call& call) {
  const std::string product = jobs_of(call).drives().product(axis_name(call));
  Json modes = Json::object();
  for (const catalogue::ModeName& row : catalogue::mode_names(product)) modes[std::to_string(row.mode)] = row.name;
  Json bits = Json::array();
  for (const catalogue::StatusWord& row : catalogue::status_words(product)) {
    bits.push_back({{"bit", row.bit}, {"name", row.name}});
    if (row.mode != catalogue::every_mode) bits.back()["mode"] = row.mode;
  }
  return Json{{"modes", std::move(modes)}, {"statusword", std::move(bits)}};
}

// A limit of 0 or of the greatest number means: no limit.
template <typename T>
std::optional<double> limit_of(const std::optional<T>& object) {
  if (!object || *object == 0 || *object == std::numeric_limits<T>::max()) return std::nullopt;
  return *object;
}

std::optional<double> lower(const std::optional<double>& one, const std::optional<double>& other) {
  return one && other ? std::min(*one, *other) : one ? one : other;
}

// The limits of the drive's objects that apply to a motion, in the drive's units.
Json show_limits(Call& call) {
  const std::string axis = axis_name(call);
  Drives& drives = jobs_of(call).drives();
  drives.require_ready(axis);
  try {
    const master::AxisLimits limits = drives.limits(axis);
    const auto units = drives.units(axis);
    constexpr double seconds_of_minute = 60.0;
    std::optional<double> motor_velocity;
    if (const auto rpm = limit_of(limits.motor_speed_rpm); rpm && units) {
      motor_velocity = *rpm / seconds_of_minute * units->velocity;
    }
    const auto json_of = [](const auto& value) { return value ? Json(*value) : Json(); };
    const Travel travel = drives.travel(axis);
    const std::optional<PositionSpan>& range = travel.wraps_within;
    return Json{{"velocity", json_of(lower(limit_of(limits.profile_velocity), motor_velocity))},
                {"acceleration", json_of(limit_of(limits.acceleration))},
                {"deceleration", json_of(limit_of(limits.deceleration))},
                {"lowest_position", travel.limits ? Json(travel.limits->lowest) : Json()},
                {"highest_position", travel.limits ? Json(travel.limits->highest) : Json()},
                {"wraps_within", range ? Json{range->lowest, range->highest} : Json()}};
  } catch (const master::MasterError& error) {
    throw ApiError{409, error.happened(), error.where(), error.remedy()};
  }
}

// The gains that a user sets, in the order of the manual; values, units and ranges are those of the objects.
Json show_gains(Call& call) {
  const std::string axis = axis_name(call);
  const Drives& drives = jobs_of(call).drives();
  const std::string product = drives.product(axis);
  const catalogue::TuningDialect& dialect = catalogue::product_of(product).tuning;
  Json gains = Json::array();
  for (const catalogue::GainLine& line : catalogue::product_of(product).gain_guide) {
    gains.push_back({{"object", text_of(line.object)}, {"set", line.set}, {"does", line.does}});
  }
  return Json{{"gains", std::move(gains)},
              {"measures", drives.has_cycles(axis)},
              {"writes", !dialect.gains.empty()},
              {"tunes_itself", dialect.tunes_itself},
              {"velocity_mode", dialect.velocity_mode},
              {"full_torque", dialect.full_torque_text}};
}

constexpr std::array table{
    Route{Method::post, "/api/v1/axes/{}/jobs", begin_job, 201, api::urgent},
    Route{Method::get, "/api/v1/axes/{}/units", show_units},
    Route{Method::get, "/api/v1/axes/{}/limits", show_limits},
    Route{Method::get, "/api/v1/axes/{}/words", show_words},
    Route{Method::get, "/api/v1/axes/{}/gains", show_gains},
    Route{Method::get, "/api/v1/jobs", list_jobs},
    Route{Method::get, "/api/v1/jobs/{}", show_job},
    Route{Method::delete_, "/api/v1/jobs/{}", end_job, 200, api::urgent},
    Route{Method::post, "/api/v1/jobs/{}/alive", keep_alive, 200, api::urgent},
    Route{Method::post, "/api/v1/stop", stop_all, 200, api::urgent},
};

}  // namespace

Json view_of(const Job& job, bool with_found) {
  Json view{{"id", job.id},
            {"axis", job.axis},
            {"do", job.order.what},
            {"units", job.order.in_revolutions ? "revolutions" : "drive"},
            {"state", word(job.state)},
            {"began_tick", job.began_tick}};
  if (job.state == JobState::running && (job.cancelled || job.fell_silent)) view["ending"] = true;
  if (job.state == JobState::running && job.progress) {
    view["progress"] = {{"doing", job.progress->doing}, {"share", job.progress->share}};
  }
  if (!job.note.empty()) view["note"] = job.note;
  if (job.error) view["error"] = view_of(*job.error);
  if (job.result) view["result"] = {{"position", job.result->position}, {"seconds", job.result->seconds}};
  if (with_found && !job.found.is_null()) view["found"] = job.found;
  return view;
}

api::RouteGroup Jobs::routes() { return {table, this}; }

}  // namespace servodrome::studio
