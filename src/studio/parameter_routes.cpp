#include <array>
#include <fmt/format.h>
#include <sstream>

#include "host/object_catalogue.hpp"
#include "host/parameters/loader.hpp"
#include "line/bench/body_reader.hpp"
#include "studio/commissioning.hpp"

// The parameters of an axis as in `servodrome params`: shown as text, loaded, compared, stored.
namespace servodrome::studio {
namespace {

using line::bench::ApiError;
using line::bench::BodyReader;
using line::bench::Call;
using line::bench::Content;
using line::bench::Json;
using line::bench::Method;
using line::bench::Route;

constexpr const char* body_name = "body";  // replaces a file name in messages

template <typename Act>
auto said(unsigned status, Act act) {
  try {
    return act();
  } catch (const host::HostError& error) {
    throw api_error(error, status);
  }
}

host::ParameterFile parameters_in(const Call& call) {
  std::istringstream text(call.body);
  return said(400, [&text] { return host::ParameterFile::read(text, body_name); });
}

Json show_parameters(Call& call) {
  Subject subject = subject_of(call);
  const host::ParameterList list = subject.parameters(flag(call, "connection"));
  said(409, [&] {
    host::ParameterFile file{.identity = host::DriveIdentity::read(subject.objects, subject.product)};
    file.values = host::read_parameters(subject.objects, list, subject.node_id).values;
    call.content = Content{"text/plain; charset=utf-8", file.text()};
  });
  return nullptr;
}

// Addresses together with the names of the parameters.
Json view_of(std::span<const host::ObjectAddress> addresses, const host::ParameterList& list) {
  Json view = Json::array();
  for (const host::ObjectAddress address : addresses) {
    const host::Parameter* parameter = list.find(address);
    view.push_back({{"object", text_of(address)}, {"name", parameter != nullptr ? parameter->name : ""}});
  }
  return view;
}

Json load_parameter_text(Call& call) {
  Subject subject = subject_of(call);
  const bool store = flag(call, "store");
  const host::LoadOptions options{
      .node_id = subject.node_id, .force = flag(call, "force"), .skip_absent = flag(call, "skip_absent")};
  const host::ParameterList list = subject.parameters(flag(call, "connection"));
  const host::ParameterFile file = parameters_in(call);
  host::LoadReport report;
  try {
    const host::DriveIdentity drive = host::DriveIdentity::read(subject.objects, subject.product);
    report = host::load_parameters(subject.objects, file, body_name, list, drive, options);
  } catch (const host::LoadError& error) {
    throw api_error(error, 409);  // the drive refused it; the remedy lists what was restored
  } catch (const host::HostError& error) {
    throw api_error(error, 422);  // nothing was written
  }
  const bool stored = store && said(409, [&] { return host::store_parameters(subject.objects, list.rules()); });
  return Json{{"compared", report.compared},
              {"written", view_of(report.written, list)},
              {"skipped", view_of(report.skipped, list)},
              {"stored", stored},
              {"keeps_at_once", list.rules().store.empty()},
              {"after_restart", view_of(report.after_restart, list)},
              {"lost_with_power", view_of(report.volatile_ones, list)}};
}

Json differences_of(std::span<const host::ParameterValue> left, std::span<const host::ParameterValue> right,
                    const Subject& subject, std::size_t compared, bool only_common) {
  const auto text = [](const host::ParameterValue* value) {
    return value != nullptr ? Json(host::text_of(*value)) : Json(nullptr);
  };
  Json rows = Json::array();
  for (const host::ParameterDifference& one : host::compare(left, right, subject.node_id, only_common)) {
    // The drive's table has priority, because a person may have written the file.
    const host::ParameterValue& known = one.right != nullptr ? *one.right : *one.left;
    rows.push_back({{"object", text_of(one.address)},
                    {"name", known.name},
                    {"type", host::short_word(known.type)},
                    {"unit", known.unit},
                    {"left", text(one.left)},
                    {"right", text(one.right)}});
  }
  return Json{{"compared", compared}, {"differences", std::move(rows)}};
}

Json compare_with_factory(Call& call) {
  Subject subject = subject_of(call);
  const host::ParameterList list = subject.parameters();
  return said(409, [&] {
    const auto left = host::factory_parameters(list);
    const auto right = host::read_parameters(subject.objects, list, subject.node_id).values;
    return differences_of(left, right, subject, std::min(left.size(), right.size()), true);
  });
}

// Compares only the parameters that the file contains: it may hold just a few.
Json compare_with_file(Call& call) {
  Subject subject = subject_of(call);
  const host::ParameterFile file = parameters_in(call);
  const host::ParameterList list = subject.parameters(true);
  return said(409, [&] {
    auto right = host::read_parameters(subject.objects, list, subject.node_id).values;
    std::erase_if(right, [&file](const host::ParameterValue& value) { return file.find(value.address) == nullptr; });
    return differences_of(file.values, right, subject, file.values.size(), false);
  });
}

Json store_now(Call& call) {
  Subject subject = subject_of(call);
  BodyReader(call.body, true).finish();
  const host::ParameterRules& rules = host::parameter_rules_of(subject.product);
  const bool stored = said(409, [&] { return host::store_parameters(subject.objects, rules); });
  return Json{{"stored", stored}, {"keeps_at_once", rules.store.empty()}};
}

constexpr std::array parameter_table{
    Route{Method::get, "/api/v1/axes/{}/parameters", show_parameters},
    Route{Method::put, "/api/v1/axes/{}/parameters", load_parameter_text},
    Route{Method::get, "/api/v1/axes/{}/parameters/diff", compare_with_factory},
    Route{Method::post, "/api/v1/axes/{}/parameters/diff", compare_with_file},
    Route{Method::post, "/api/v1/axes/{}/parameters/store", store_now},
};

}  // namespace

line::bench::RouteGroup parameter_routes(Subjects& subjects) { return {parameter_table, &subjects}; }

}  // namespace servodrome::studio
