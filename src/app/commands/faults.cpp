// `faults`: shows the faults of a drive, their causes and remedies.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "axis/fault_report.hpp"
#include "catalogue/product.hpp"

namespace servodrome::app {
namespace faults_command {

struct Options {
  BusOptions bus;
  bool reset = false;
  bool clear_history = false;
};

using Faults = std::vector<master::ReportedFault>;

nlohmann::ordered_json json_of(const Faults& faults, std::string_view product) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const master::ReportedFault& fault : faults) {
    nlohmann::ordered_json meanings = nlohmann::ordered_json::array();
    for (const catalogue::FaultText* meaning : fault.meanings) {
      meanings.push_back({{"alarm", catalogue::alarm_name(product, meaning->alarm)},
                          {"text", meaning->text},
                          {"cause", meaning->cause},
                          {"remedy", meaning->remedy},
                          {"of_class", meaning->code != fault.code}});
    }
    list.push_back({{"code", fault.code},
                    {"alarm", catalogue::alarm_name(product, fault.alarm)},
                    {"object", text_of(fault.source)},
                    {"meanings", std::move(meanings)}});
  }
  return list;
}

void print_explained(const char* title, const Faults& faults, std::string_view product) {
  if (faults.empty()) return;
  fmt::print("{}:\n", title);
  for (const master::ReportedFault& fault : faults) {
    fmt::print("  {}\n", text_of(fault, product));
    for (const catalogue::FaultText* meaning : fault.meanings) {
      if (fault.meanings.size() > 1) fmt::print("  {}\n", meaning->text);
      fmt::print("    cause:  {}\n    remedy: {}\n", meaning->cause, meaning->remedy);
    }
  }
}

void print_list(const char* title, const Faults& faults, std::string_view product) {
  if (faults.empty()) return;
  fmt::print("{}, newest first:\n", title);
  for (const master::ReportedFault& fault : faults) {
    fmt::print("  {}  {}\n", text_of(fault.source), text_of(fault, product));
  }
}

void run(const Options& options) {
  DriveLink link(options.bus, true);
  const auto axis = link.open_axis({});
  const std::string_view product = link.product() != nullptr ? link.product()->name : std::string_view{};
  const InterruptGuard guard;
  if (options.clear_history) master::clear_fault_history(link.objects());
  std::string refusal;
  if (options.reset) {
    try {
      axis->reset_fault();
    } catch (const master::MasterError& error) {
      // First show the faults that are still active.
      const std::string_view text = error.what();
      refusal = fmt::format(
          "{}{} On a virtual drive, a fault injected by the bench API holds until it is removed there "
          "(docs/bench-api.md)",
          text, text.ends_with('.') ? "" : ".");
    }
  }
  const master::FaultReport report = master::read_faults(link.objects(), catalogue::product_of(product));
  const std::uint16_t word = report.statusword;
  if (options.bus.json) {
    nlohmann::ordered_json json{{"node", axis->address()},
                                {"product", product},
                                {"state", drive::name(master::state_of(word))},
                                {"statusword", word},
                                {"error_register", nullptr},
                                {"active", json_of(report.active, product)},
                                {"warnings", json_of(report.warnings, product)},
                                {"history", json_of(report.history, product)},
                                {"log", json_of(report.log, product)}};
    if (report.error_register) json["error_register"] = *report.error_register;
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{} {}: {}, statusword {}", link.noun(), axis->address(), drive::name(master::state_of(word)),
               master::text_of_statusword(word, product, report.mode));
    if (report.error_register.value_or(0) != 0) {
      fmt::print(", error register {:02X}h ({})", *report.error_register,
                 master::text_of_error_register(*report.error_register));
    }
    fmt::print("\n");
    print_explained("active", report.active, product);
    print_explained("warning", report.warnings, product);
    if (report.active.empty() && report.warnings.empty()) fmt::print("no fault is active\n");
    print_list("history", report.history, product);
    print_list("the drive's own log", report.log, product);
  }
  std::fflush(stdout);
  if (!refusal.empty()) throw Failure::did_not_work(refusal);
  if (!report.active.empty()) {
    throw Failure::did_not_work(
        fmt::format("{}: {} active", link.objects().where(), report.active.size() == 1 ? "a fault is" : "faults are"));
  }
}

}  // namespace faults_command

void add_faults(CLI::App& app) {
  const auto [command, options] = add_command(app, "faults",
                                              "Show the active faults of a drive with cause and remedy, and its fault "
                                              "history; exit status 1 if a fault is active",
                                              faults_command::run);
  add_drive_options(*command, options->bus, "Seconds to wait for each answer");
  command->add_flag("--reset", options->reset, "Reset the fault first");
  command->add_flag("--clear-history", options->clear_history, "Empty the history (1003h) first");
}

}  // namespace servodrome::app
