#include "studio/change_routes.hpp"

#include <algorithm>
#include <array>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <set>

#include "api/author.hpp"
#include "api/query.hpp"
#include "describe/words.hpp"
#include "line/bench/object_values.hpp"
#include "links/nearest_name.hpp"
#include "studio/route_names.hpp"
#include "studio/undo.hpp"

namespace servodrome::studio {
namespace {

constexpr std::uint64_t usual_changes = 500;
constexpr std::uint64_t most_changes = 1000;

std::string utc_text(api::Change::Time wall) {
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(wall).count();
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(static_cast<std::time_t>(ms / 1000)), ms % 1000);
}

Json value_of(const dictionary::Entry& entry, const api::KeptValue& value) {
  return value.known() ? line::bench::shown(entry, value.bytes())["value"] : Json(nullptr);
}

ChangeRoutes& change_routes_of(const Call& call) { return *static_cast<ChangeRoutes*>(call.context); }

std::uint32_t axis_named(const api::ChangeLog& log, std::string_view name, const char* where) {
  const auto& axes = log.axes();
  const auto found = std::find(axes.begin(), axes.end(), name);
  if (found != axes.end()) return static_cast<std::uint32_t>(found - axes.begin());
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), where,
                 links::suggestion(name, {axes.begin(), axes.end()})};
}

Json show_changes(Call& call) {
  const api::ChangeLog& log = change_routes_of(call).log();
  const std::uint64_t since = query_integer(call, "since", 0, UINT64_MAX).value_or(0);
  const std::uint64_t limit = query_integer(call, "limit", 1, most_changes).value_or(usual_changes);
  const bool newest = query_flag(call, "newest");
  const auto axis_name = query_value(call, "axis");
  std::optional<std::uint32_t> axis;
  if (axis_name) axis = axis_named(log, *axis_name, "address");
  std::vector<std::uint64_t> fitting;
  for (std::uint64_t number = std::max(log.oldest(), std::min(since, log.newest()) + 1); number <= log.newest();
       ++number) {
    if (!axis || log.at(number).axis == *axis) fitting.push_back(number);
  }
  const std::size_t shown = std::min<std::size_t>(fitting.size(), limit);
  const std::size_t first = newest ? fitting.size() - shown : 0;
  Json rows = Json::array();
  for (std::size_t i = first; i < first + shown; ++i) rows.push_back(view_of(log.at(fitting[i]), log));
  const bool complete = newest || shown == fitting.size();
  return Json{{"changes", std::move(rows)},
              {"next", complete ? log.newest() : fitting[shown - 1]},
              {"left_out", fitting.size() - shown},
              {"dropped", log.dropped()},
              {"most", log.capacity()}};
}

void add_to(Json& answer, const UndoReport& report, const std::string& axis) {
  Json& undone = answer["undone"];
  for (const UndoReport::Object& one : report.undone) {
    undone.push_back({{"number", one.number},
                      {"axis", axis},
                      {"object", text_of(one.object)},
                      {"name", one.name},
                      {"from", value_of(*one.entry, one.from)},
                      {"to", value_of(*one.entry, one.to)}});
  }
  Json& kept = answer["kept"];
  for (const UndoReport::Kept& one : report.kept) {
    kept.push_back({{"number", one.number},
                    {"axis", axis},
                    {"object", text_of(one.object)},
                    {"name", one.name},
                    {"what", one.what},
                    {"hint", one.hint}});
  }
}

// Undoes the changes of one axis. If the changes of several axes are selected (`is_one_of_several`), a drive that
// cannot be accessed is reported as unchanged, so that the others are still undone; otherwise throws.
UndoReport undo_axis(ChangeRoutes& routes, std::uint32_t axis, const Call& call, bool is_one_of_several,
                     const UndoOrder& order) {
  const api::ChangeLog& log = routes.log();
  Call of_axis{{log.axes()[axis]}, call.body};
  std::optional<Subject> subject;
  try {
    subject.emplace(routes.subjects().open(of_axis));
  } catch (const ApiError& error) {
    if (!is_one_of_several) throw;
    return undo_nothing(log, axis, order, error.what, error.hint);
  }
  return undo(log, axis, *subject, order);
}

std::set<std::uint64_t> numbers_in(const Json& list, const char* where) {
  const auto is_number = [](const Json& each) { return each.is_number_unsigned(); };
  if (!list.is_array() || !std::all_of(list.begin(), list.end(), is_number)) {
    throw ApiError{400, fmt::format("{} is no list of whole numbers", where), where, "write [12, 13]"};
  }
  return {list.begin(), list.end()};
}

Json undo_changes(Call& call) {
  ChangeRoutes& routes = change_routes_of(call);
  const api::ChangeLog& log = routes.log();
  BodyReader body(call.body);
  const auto number = body.integer("number", std::numeric_limits<std::uint64_t>::max());
  const auto name = body.string("axis");
  const bool all = body.boolean("all").value_or(false);
  const std::uint64_t since = body.integer("since", std::numeric_limits<std::uint64_t>::max()).value_or(0);
  // Without `until`, the changes up to now, so that a change of a later axis during the undo stays.
  const std::uint64_t until =
      std::min(body.integer("until", std::numeric_limits<std::uint64_t>::max()).value_or(log.newest()), log.newest());
  const auto who = body.string("who");
  UndoOrder order;
  order.is_preview = body.boolean("preview").value_or(false);
  if (body.has("only")) order.only = numbers_in(body.required("only"), "only");
  body.finish();
  if (number.has_value() + name.has_value() + all != 1) {
    throw ApiError{400, "one of number, axis and all is needed", "body",
                   R"(write {"number": 12}, {"axis": "NAME"} or {"all": true})"};
  }
  if (number && (*number < log.oldest() || *number > log.newest())) {
    throw ApiError{404, fmt::format("there is no change {}", *number), "number",
                   fmt::format("the log has {} to {}", log.oldest(), log.newest())};
  }
  std::vector<std::uint32_t> axes;
  if (number) axes.push_back(log.at(*number).axis);
  if (name) axes.push_back(axis_named(log, *name, "axis"));
  for (std::uint32_t axis = 0; all && axis < log.axes().size(); ++axis) axes.push_back(axis);
  order.is_selected = [&](const api::Change& change) {
    if (number) return change.number == *number;
    return change.number > since && change.number <= until && (!who || change.author() == *who);
  };
  const api::Author author("undo by " + api::Author::present());
  Json answer{{"undone", Json::array()}, {"kept", Json::array()}, {"until", until}};
  for (const std::uint32_t axis : axes) {
    const UndoReport report = undo_axis(routes, axis, call, all, order);
    if (number && report.undone.empty()) {
      const std::string where = fmt::format("{}, change {}", log.axes()[axis], *number);
      if (report.kept.empty()) throw ApiError{409, "the object already has this value", where, ""};
      throw ApiError{409, report.kept[0].what, where, report.kept[0].hint};
    }
    add_to(answer, report, log.axes()[axis]);
  }
  return answer;
}

constexpr std::array change_table{
    Route{Method::get, "/api/v1/changes?axis&since&limit&newest", show_changes},
    Route{Method::post, "/api/v1/changes/undo", undo_changes},
};

}  // namespace

Json view_of(const api::Change& change, const api::ChangeLog& log) {
  const dictionary::Entry& entry = *change.entry;
  return Json{{"number", change.number},
              {"time_ns", change.at.count()},
              {"wall", utc_text(change.wall)},
              {"axis", log.axes()[change.axis]},
              {"object", text_of(master::ObjectAddress{entry.index, entry.sub})},
              {"name", change.name()},
              {"type", describe::word(entry.type)},
              {"unit", entry.unit},
              {"before", value_of(entry, change.before)},
              {"after", value_of(entry, change.after)},
              {"who", change.author()}};
}

api::RouteGroup ChangeRoutes::group() { return {change_table, this}; }

}  // namespace servodrome::studio
