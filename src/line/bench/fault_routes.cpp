#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <optional>

#include "catalogue/fault_texts.hpp"
#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/line_bench.hpp"
#include "links/nearest_name.hpp"
#include "links/number_text.hpp"

namespace servodrome::line::bench {
namespace {

// A fault that the bench can inject: one of the plant by its name, or one of the drive by its code. If several drive
// faults have the same code, the name of the cause distinguishes them.
struct Injectable {
  std::optional<plant::Injection> plant;
  drive::Cause cause = drive::Cause::none;
};

std::string code_of(const drive::FaultRow& row) { return fmt::format("0x{:04X}", row.code); }

// The rows of the drive's fault table.
std::vector<const drive::FaultRow*> rows_of(Axis& axis) {
  std::vector<const drive::FaultRow*> rows;
  for (unsigned cause = 1; cause < 256; ++cause) {
    if (const auto* row = axis.device().drive().row(static_cast<drive::Cause>(cause))) rows.push_back(row);
  }
  return rows;
}

Injectable injectable(Axis& axis, const std::string& name) {
  if (const auto injection = plant::injection_from_name(name)) return {injection};
  unsigned code = 0;
  if (name.starts_with("0x")) {
    code = links::number_of_text<unsigned>(std::string_view(name).substr(2), 16).value_or(0);
  }
  for (const drive::FaultRow* row : rows_of(axis)) {
    if ((code != 0 && row->code == code) || name == drive::name(row->cause)) return {std::nullopt, row->cause};
  }
  std::vector<std::string_view> names;
  names.reserve(plant::injection_names.size());
  for (const plant::InjectionName& known : plant::injection_names) names.push_back(known.name);
  throw ApiError{422, fmt::format("there is no fault \"{}\" to inject", name.substr(0, 40)), "inject",
                 links::suggestion(name, names) + "; or give a fault code of the drive such as \"0x2310\""};
}

// Adds text, cause and remedy of the fault: those of its alarm if it has one, otherwise those of its code.
void explain(Json& fault, const Axis& axis, const drive::FaultRow& row) {
  const std::string_view product = axis.settings().product->name;
  const catalogue::FaultText* text = row.alarm != 0 ? catalogue::find_alarm_text(product, row.alarm) : nullptr;
  if (text == nullptr) text = catalogue::find_fault_text(product, row.code);
  if (row.alarm != 0) fault["alarm"] = catalogue::alarm_name(product, row.alarm);
  if (text == nullptr) return;
  fault["text"] = text->text;
  fault["cause"] = text->cause;
  fault["remedy"] = text->remedy;
}

Json explained(Axis& axis, const std::vector<const drive::FaultRow*>& rows) {
  Json faults = Json::array();
  for (const drive::FaultRow* row : rows) {
    Json fault = view_of(*row);
    explain(fault, axis, *row);
    faults.push_back(std::move(fault));
  }
  return faults;
}

std::optional<std::uint32_t> number_in_history(Axis& axis, std::uint8_t sub) {
  constexpr std::uint16_t error_history = 0x1003;  // CiA 301 7.5.2.4
  dictionary::Dictionary& objects = axis.device().dictionary();
  const dictionary::Entry* entry = objects.find(error_history, sub);
  dictionary::ReadValue read;
  if (entry == nullptr || objects.read(*entry, read) != dictionary::AbortCode::none) return std::nullopt;
  std::uint32_t number = 0;
  std::memcpy(&number, read.bytes.data(), std::min(read.bytes.size(), sizeof number));
  return number;
}

// For a drive that stores its error codes in 1003h.
void add_error_history(Axis& axis, Json& history) {
  const std::uint32_t count = number_in_history(axis, 0).value_or(0);
  const auto rows = rows_of(axis);
  for (std::uint32_t sub = 1; sub <= count && sub <= UINT8_MAX; ++sub) {
    const auto field = number_in_history(axis, static_cast<std::uint8_t>(sub));
    if (!field) break;
    const unsigned code = *field & 0xFFFFU;  // the high word is manufacturer specific
    const auto row = std::find_if(rows.begin(), rows.end(), [code](const auto* each) { return each->code == code; });
    history.push_back({{"code", fmt::format("0x{:04X}", code)}, {"name", row != rows.end() ? (*row)->name : ""}});
    if (row != rows.end()) explain(history.back(), axis, **row);
  }
}

// The drive's own fault history, newest first.
Json past_faults(Axis& axis) {
  Json history = Json::array();
  for (std::size_t n = 0; const products::PastFault* past = axis.device().past_fault(n); ++n) {
    history.push_back({{"code", code_of(*past->fault)},
                       {"name", past->fault->name},
                       {"dc_link_v", past->dc_link_v},
                       {"velocity_rpm", past->velocity_rpm},
                       {"current_a", past->current_a},
                       {"temperature_c", past->temperature_c},
                       {"mode", past->mode},
                       {"power_stage_on", past->power_stage_on}});
    explain(history.back(), axis, *past->fault);
  }
  if (history.empty() && axis.powered()) add_error_history(axis, history);
  return history;
}

void apply(Axis& axis, const Injectable& what, bool on) {
  if (what.plant) {
    axis.plant().inject(*what.plant, on);
  } else {
    axis.inject(what.cause, on);
  }
}

}  // namespace

Json LineBench::show_faults(Call& call) {
  Axis& axis = axis_of(call);
  Json injected = Json::array();
  for (const plant::InjectionName& known : plant::injection_names) {
    if (axis.plant().injected(known.injection)) injected.push_back(known.name);
  }
  for (const drive::FaultRow* row : rows_of(axis)) {
    if (axis.injected(row->cause)) injected.push_back(code_of(*row));
  }
  Json drive_faults = Json::array();
  for (const drive::FaultRow* row : rows_of(axis)) {
    drive_faults.push_back({{"code", code_of(*row)}, {"cause", drive::name(row->cause)}, {"name", row->name}});
  }
  Json plant_faults = Json::array();
  for (const plant::InjectionName& known : plant::injection_names) plant_faults.push_back(known.name);
  return Json{{"active", explained(axis, active_faults(axis))},
              {"warnings", explained(axis, active_warnings(axis))},
              {"history", past_faults(axis)},
              {"injected", std::move(injected)},
              {"injectable", {{"plant", std::move(plant_faults)}, {"drive", std::move(drive_faults)}}}};
}

Json LineBench::inject(Call& call) {
  Axis& axis = axis_of(call);
  BodyReader body(call.body);
  body.required("inject");
  const Injectable what = injectable(axis, body.string("inject").value_or(""));
  body.finish();
  apply(axis, what, true);
  return show_faults(call);
}

Json LineBench::take_back(Call& call) {
  Axis& axis = axis_of(call);
  BodyReader body(call.body, true);
  const auto name = body.string("inject");
  std::optional<Injectable> what;
  if (name) what = injectable(axis, *name);
  body.finish();
  if (what) {
    apply(axis, *what, false);
  } else {
    for (const plant::InjectionName& known : plant::injection_names) axis.plant().inject(known.injection, false);
    for (const drive::FaultRow* row : rows_of(axis)) axis.inject(row->cause, false);
  }
  return show_faults(call);
}

}  // namespace servodrome::line::bench
