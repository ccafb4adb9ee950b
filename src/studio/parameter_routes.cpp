#include <array>
#include <fmt/format.h>
#include <sstream>

#include "api/query.hpp"
#include "axis/object_catalogue.hpp"
#include "catalogue/product.hpp"
#include "studio/commissioning.hpp"
#include "studio/route_names.hpp"
#include "tools/parameters/loader.hpp"

// The parameters of an axis as in `servodrome params`: shown as text, loaded, compared, stored.
namespace servodrome::studio {
namespace {

using api::Content;

constexpr const char* body_name = "body";  // replaces a file name in messages

template <typename Act>
auto said(unsigned status, Act act) {
  try {
    return act();
  } catch (const master::MasterError& error) {
    throw api_error(error, status);
  }
}

master::ParameterFile parameters_in(const Call& call) {
  std::istringstream text(call.body);
  return said(400, [&text] { return master::ParameterFile::read(text, body_name); });
}

Json show_parameters(Call& call) {
  Subject subject = subject_of(call);
  const master::ParameterList list = subject.parameters(query_flag(call, "connection"));
  said(409, [&] {
    master::ParameterFile file{.identity = master::DriveIdentity::read(subject.objects, subject.product)};
    file.values = master::read_parameters(subject.objects, list, subject.node_id).values;
    call.content = Content{"text/plain; charset=utf-8", file.text()};
  });
  return nullptr;
}

// Addresses together with the names of the parameters.
Json view_of(std::span<const master::ObjectAddress> addresses, const master::ParameterList& list) {
  Json view = Json::array();
  for (const master::ObjectAddress address : addresses) {
    const master::Parameter* parameter = list.find(address);
    view.push_back({{"object", text_of(address)}, {"name", parameter != nullptr ? parameter->name : ""}});
  }
  return view;
}

Json load_parameter_text(Call& call) {
  Subject subject = subject_of(call);
  const bool store = query_flag(call, "store");
  const master::LoadOptions options{
      .node_id = subject.node_id, .force = query_flag(call, "force"), .skip_absent = query_flag(call, "skip_absent")};
  const master::ParameterList list = subject.parameters(query_flag(call, "connection"));
  const master::ParameterFile file = parameters_in(call);
  master::LoadReport report;
  try {
    const master::DriveIdentity drive = master::DriveIdentity::read(subject.objects, subject.product);
    report = master::load_parameters(subject.objects, file, body_name, list, drive, options);
  } catch (const master::LoadError& error) {
    throw api_error(error, 409);  // the drive refused it; the remedy lists what was restored
  } catch (const master::MasterError& error) {
    throw api_error(error, 422);  // nothing was written
  }
  const bool stored = store && said(409, [&] { return master::store_parameters(subject.objects, list.rules()); });
  return Json{{"compared", report.compared},
              {"written", view_of(report.written, list)},
              {"skipped", view_of(report.skipped, list)},
              {"stored", stored},
              {"keeps_at_once", list.rules().store.empty()},
              {"after_restart", view_of(report.after_restart, list)},
              {"lost_with_power", view_of(report.volatile_ones, list)}};
}

Json differences_of(std::span<const master::ParameterValue> left, std::span<const master::ParameterValue> right,
                    const Subject& subject, std::size_t compared, bool only_common) {
  const auto text = [](const master::ParameterValue* value) {
    return value != nullptr ? Json(master::text_of(*value)) : Json(nullptr);
  };
  Json rows = Json::array();
  for (const master::ParameterDifference& one : master::compare(left, right, subject.node_id, only_common)) {
    // The drive's table has priority, because a person may have written the file.
    const master::ParameterValue& known = one.right != nullptr ? *one.right : *one.left;
    rows.push_back({{"object", text_of(one.address)},
                    {"name", known.name},
                    {"type", master::short_word(known.type)},
                    {"unit", known.unit},
                    {"left", text(one.left)},
                    {"right", text(one.right)}});
  }
  return Json{{"compared", compared}, {"differences", std::move(rows)}};
}

Json compare(Call& call) {
  const std::string with = query_value(call, "with").value_or("factory");
  if (with != "factory" && with != "stored") {
    throw ApiError{400, fmt::format("with is \"{}\"", with.substr(0, 40)), "address", "write factory or stored"};
  }
  Subject subject = subject_of(call);
  const master::ParameterList list = subject.parameters();
  if (with == "stored" && !subject.stored) {
    throw ApiError{409, "the drive does not show its stored values while it runs", std::string(call.arguments[0]),
                   "save the parameters as a file when they are stored, and compare with the file"};
  }
  return said(409, [&] {
    const auto left = with == "stored" ? subject.stored(list) : master::factory_parameters(list);
    const auto right = master::read_parameters(subject.objects, list, subject.node_id).values;
    return differences_of(left, right, subject, std::min(left.size(), right.size()), true);
  });
}

// Compares only the parameters that the file contains: it may hold just a few.
Json compare_with_file(Call& call) {
  Subject subject = subject_of(call);
  const master::ParameterFile file = parameters_in(call);
  const master::ParameterList list = subject.parameters(true);
  return said(409, [&] {
    auto right = master::read_parameters(subject.objects, list, subject.node_id).values;
    std::erase_if(right, [&file](const master::ParameterValue& value) { return file.find(value.address) == nullptr; });
    return differences_of(file.values, right, subject, file.values.size(), false);
  });
}

// The parameters that the drive cannot store and whose present value is not the factory's.
std::vector<master::ObjectAddress> changed_volatile_ones(Subject& subject, const master::ParameterList& list) {
  const auto factory = master::factory_parameters(list);
  const auto present = master::read_parameters(subject.objects, list, subject.node_id).values;
  std::vector<master::ObjectAddress> changed;
  for (const master::ParameterDifference& one : master::compare(factory, present, subject.node_id, true)) {
    if (!list.find(one.address)->retained) changed.push_back(one.address);
  }
  return changed;
}

Json store_now(Call& call) {
  Subject subject = subject_of(call);
  BodyReader(call.body, true).finish();
  const catalogue::ParameterRules& rules = catalogue::product_of(subject.product).rules;
  const master::ParameterList list = subject.parameters();
  return said(409, [&] {
    const bool stored = master::store_parameters(subject.objects, rules);
    return Json{{"stored", stored},
                {"keeps_at_once", rules.store.empty()},
                {"lost_with_power", view_of(changed_volatile_ones(subject, list), list)}};
  });
}

constexpr std::array parameter_table{
    Route{Method::get, "/api/v1/axes/{}/parameters?connection", show_parameters},
    Route{Method::put, "/api/v1/axes/{}/parameters?store&force&skip_absent&connection", load_parameter_text},
    Route{Method::get, "/api/v1/axes/{}/parameters/diff?with", compare},
    Route{Method::post, "/api/v1/axes/{}/parameters/diff", compare_with_file},
    Route{Method::post, "/api/v1/axes/{}/parameters/store", store_now},
};

}  // namespace

api::RouteGroup parameter_routes(Subjects& subjects) { return {parameter_table, &subjects}; }

}  // namespace servodrome::studio
