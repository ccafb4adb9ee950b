// `params`: a drive's parameters as a text file: save, load, compare.
#include <ctime>
#include <filesystem>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sstream>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/object_names.hpp"
#include "app/whole_file.hpp"
#include "catalogue/product.hpp"
#include "links/nearest_name.hpp"
#include "master/canopen/pre_operational.hpp"
#include "tools/parameters/loader.hpp"

namespace servodrome::app {
namespace params_command {

using nlohmann::ordered_json;

struct Options {
  BusOptions bus;
  std::string eds;
  std::vector<std::string> files;
  std::string output;  // save: the output file
  bool connection = false;
  bool date = false;         // save
  bool force = false;        // load
  bool store = false;        // load
  bool skip_absent = false;  // load
  bool factory = false;      // diff
};

master::ParameterFile read_file(const std::string& path) {
  std::istringstream file(read_text_file(path, fmt::format("\"{}\", a file of parameters", path)));
  return master::ParameterFile::read(file, path);
}

// The drive behind --bus and its parameter list: from --eds, from its product's dictionary, or from the drive
// (EtherCAT).
struct Drive {
  explicit Drive(const Options& options)
      : link(options.bus, false), kind(bus_kind(options.bus).kind), list(list_of(options)) {
    if (link.sdo() != nullptr) node_id = link.sdo()->node_id();
  }
  std::string_view product() { return link.product() != nullptr ? link.product()->name : std::string_view{}; }

  DriveLink link;
  BusKind kind;
  master::NodeId node_id{};
  master::ParameterList list;

 private:
  master::ParameterList list_of(const Options& options) {
    const catalogue::ParameterRules& rules = catalogue::product_of(product()).rules;
    if (const auto sheet = data_sheet(options.eds)) {
      return master::ParameterList::of_data_sheet(*sheet, rules, options.connection);
    }
    if (link.product() != nullptr) {
      const describe::Description description = link.product()->describe();
      const bool serial = kind == BusKind::modbus || kind == BusKind::serial10;
      return master::ParameterList::of_dictionary(serial ? description.service_table : description.table, rules,
                                                  options.connection);
    }
    if (auto* coe = dynamic_cast<master::CoeObjects*>(&link.objects())) {
      return master::ParameterList::of_slave(coe->slave().coe(), rules, options.connection);
    }
    throw Failure::wrong_use(fmt::format(
        "{}: the parameters of this drive are not known; give its data sheet with --eds", link.objects().where()));
  }
};

// The parameters of a product, without access to a drive.
master::ParameterList list_of_product(const std::string& name, const Options& options) {
  const line::Product* product = line::find_product(line::all_products(), name);
  if (product == nullptr) {
    throw Failure::wrong_use(
        fmt::format("--factory: factory values are known for the products of `servodrome products` only, and \"{}\" is "
                    "not one of them",
                    name));
  }
  return master::ParameterList::of_dictionary(product->describe().table, catalogue::product_of(name).rules,
                                              options.connection);
}

master::ParameterProgress progress_of(const Options& options) {
  const bool shown = on_terminal() && !options.bus.json;
  return [shown](const char* doing, std::size_t done, std::size_t of) {
    if (InterruptGuard::interrupted()) {
      throw master::MasterError("interrupted", fmt::format("{} {} of {}", doing, done, of), "start the command again");
    }
    if (!shown) return;
    fmt::print(stderr, "\r  {} {} of {}\x1B[K", doing, done + 1, of);
  };
}

void end_line(const Options& options) {
  if (on_terminal() && !options.bus.json) fmt::print(stderr, "\r\x1B[K");
}

ordered_json json_of(std::span<const master::ObjectAddress> objects) {
  ordered_json list = ordered_json::array();
  for (const master::ObjectAddress object : objects) list.push_back(text_of(object));
  return list;
}

void save(const Options& options) {
  if (options.files.empty() == options.output.empty()) {
    throw Failure::wrong_use("params save: give one FILE to write to (FILE or -o FILE; - is standard output)");
  }
  const InterruptGuard guard;
  Drive drive(options);
  master::ParameterFile file{.identity = master::DriveIdentity::read(drive.link.objects(), drive.product())};
  master::ReadParameters read =
      master::read_parameters(drive.link.objects(), drive.list, drive.node_id, progress_of(options));
  end_line(options);
  file.values = std::move(read.values);
  if (options.date) file.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  const std::string& path = options.files.empty() ? options.output : options.files.front();
  if (path == "-") {
    fmt::print("{}", file.text());
    return;
  }
  write_whole_file(path, file.text());
  if (options.bus.json) {
    fmt::print(
        "{}\n",
        ordered_json{{"file", path}, {"parameters", file.values.size()}, {"absent", json_of(read.absent)}}.dump(2));
    return;
  }
  fmt::print("{}: {} parameters of {}\n", path, file.values.size(), file.identity.text());
  if (!read.absent.empty()) {
    fmt::print("not in the drive, or not accessible on this bus: {}\n", master::text_of(read.absent));
  }
}

void load(const Options& options) {
  if (options.factory != options.files.empty()) {
    throw Failure::wrong_use("params load: give FILE, or --factory for the factory values of the product");
  }
  const std::string path = options.factory ? "factory" : options.files.front();
  master::ParameterFile file;
  if (!options.factory) file = read_file(path);
  const InterruptGuard guard;
  Drive drive(options);
  master::ObjectClient& objects = drive.link.objects();
  const master::DriveIdentity identity = master::DriveIdentity::read(objects, drive.product());
  if (options.factory) {
    file = {.identity = identity, .values = master::factory_parameters(drive.list)};
    if (file.values.empty()) {
      throw Failure::wrong_use(fmt::format(
          "--factory: {} has no factory values; give a data sheet with default values with --eds", objects.where()));
    }
  }
  std::optional<master::PreOperational> state;
  master::LoadOptions load_options{.node_id = drive.node_id,
                                   .force = options.force,
                                   .skip_absent = options.skip_absent || options.factory,
                                   .progress = progress_of(options)};
  if (master::SdoClient* sdo = drive.link.sdo()) {
    load_options.before_communication = [&state, sdo] { state.emplace(sdo->bus(), sdo->node_id(), *sdo); };
  }
  master::LoadReport report;
  try {
    report = master::load_parameters(objects, file, path, drive.list, identity, load_options);
  } catch (const master::LoadError& error) {
    end_line(options);
    if (state && error.outcome() != master::LoadError::Outcome::bus_lost) state->leave();
    throw;
  } catch (...) {
    end_line(options);
    throw;
  }
  end_line(options);
  if (state) state->leave();
  const bool stored = options.store && master::store_parameters(objects, drive.list.rules());
  const bool stores_at_once = drive.list.rules().store.empty();
  const bool left_there = state && state->was_unknown();
  if (options.bus.json) {
    ordered_json json{{"file", path}, {"compared", report.compared}, {"written", json_of(report.written)}};
    json["skipped"] = json_of(report.skipped);
    json["stored"] = stored;
    json["after_restart"] = json_of(report.after_restart);
    json["lost_with_power"] = json_of(report.volatile_ones);
    json["left_pre_operational"] = left_there;
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print("{} {}: {} parameters as in {}, {} of them written\n", drive.link.noun(), objects.address(),
             report.compared, path, report.written.size());
  if (!report.skipped.empty()) fmt::print("skipped: {}\n", master::text_of(report.skipped));
  if (stored) {
    fmt::print("stored, with all other parameters as the drive has them at present\n");
  } else if (options.store) {
    fmt::print("this drive has no store command: it keeps non-volatile parameters as soon as they are written\n");
  } else if (!report.written.empty() && !stores_at_once) {
    fmt::print("not stored: lost at power-off (--store stores them)\n");
  }
  if (!report.volatile_ones.empty()) {
    fmt::print("cannot be stored in the drive, lost at power-off: {}\n", master::text_of(report.volatile_ones));
  }
  if (!report.after_restart.empty()) {
    fmt::print("restart the drive: these take effect at the next power-on: {}\n",
               master::text_of(report.after_restart));
  }
  if (left_there) {
    fmt::print(
        "the node stays in pre-operational, because its previous NMT state is not known; start it with `servodrome nmt "
        "start`\n");
  }
}

// The side that has name and unit: the other one may come from a file that a person wrote.
const master::ParameterValue& named(const master::ParameterDifference& one) {
  if (one.left == nullptr) return *one.right;
  return one.right != nullptr && one.left->name.empty() ? *one.right : *one.left;
}

void print_differences(const Options& options, const std::string& left, const std::string& right,
                       const std::vector<master::ParameterDifference>& differences, std::size_t compared) {
  const auto text = [](const master::ParameterValue* value) {
    return value != nullptr ? master::text_of(*value) : "-";
  };
  if (options.bus.json) {
    ordered_json list = ordered_json::array();
    for (const master::ParameterDifference& one : differences) {
      const master::ParameterValue& known = named(one);
      ordered_json json{{"object", text_of(one.address)}, {"name", known.name}, {"unit", known.unit}};
      json["left"] = one.left != nullptr ? ordered_json(text(one.left)) : ordered_json(nullptr);
      json["right"] = one.right != nullptr ? ordered_json(text(one.right)) : ordered_json(nullptr);
      list.push_back(json);
    }
    fmt::print("{}\n",
               ordered_json{{"left", left}, {"right", right}, {"compared", compared}, {"differences", list}}.dump(2));
    return;
  }
  if (differences.empty()) {
    fmt::print("{} and {} are equal: {} parameters\n", left, right, compared);
    return;
  }
  fmt::print("{:<8} {:>14}    {:<14} {}\n", "object", "left", "right", "name");
  for (const master::ParameterDifference& one : differences) {
    const master::ParameterValue& known = named(one);
    const std::string unit = known.unit.empty() ? "" : fmt::format(" [{}]", known.unit);
    fmt::print("{:<8} {:>14} -> {:<14} {}{}\n", text_of(one.address), text(one.left), text(one.right), known.name,
               unit);
  }
  fmt::print("left: {}; right: {}\n", left, right);
}

// Compares only the parameters that the file contains: it may hold just a few.
master::ReadParameters read_those_of(Drive& drive, const master::ParameterFile& file, const Options& options) {
  master::ReadParameters all =
      master::read_parameters(drive.link.objects(), drive.list, drive.node_id, progress_of(options));
  end_line(options);
  std::erase_if(all.values,
                [&file](const master::ParameterValue& value) { return file.find(value.address) == nullptr; });
  return all;
}

void diff(const Options& options) {
  if (options.files.size() + (options.factory ? 1U : 0U) > 2 || (options.files.empty() && !options.factory)) {
    throw Failure::wrong_use("params diff: give FILE (against the drive), FILE FILE, FILE --factory, or --factory");
  }
  const InterruptGuard guard;
  std::vector<master::ParameterFile> files;
  for (const std::string& path : options.files) files.push_back(read_file(path));
  std::vector<master::ParameterValue> left;
  std::vector<master::ParameterValue> right;
  std::string left_name;
  std::string right_name;
  master::NodeId node_id;
  const bool needs_drive = files.size() + (options.factory ? 1U : 0U) < 2;
  bool only_common = options.factory;
  if (!needs_drive) {
    left = files[0].values;
    left_name = options.files[0];
    right_name = options.factory ? "factory" : options.files[1];
    right = options.factory ? master::factory_parameters(list_of_product(files[0].identity.product, options))
                            : files[1].values;
  } else {
    Drive drive(options);
    node_id = drive.node_id;
    right_name = drive.link.objects().where();
    if (files.empty()) {
      left = master::factory_parameters(drive.list);
      left_name = "factory";
      right = master::read_parameters(drive.link.objects(), drive.list, node_id, progress_of(options)).values;
      end_line(options);
    } else {
      left = files[0].values;
      left_name = options.files[0];
      right = read_those_of(drive, files[0], options).values;
    }
  }
  const auto differences = master::compare(left, right, node_id, only_common);
  const std::size_t compared = only_common ? std::min(left.size(), right.size()) : std::max(left.size(), right.size());
  print_differences(options, left_name, right_name, differences, compared);
  if (!differences.empty()) {
    throw Failure::did_not_work(fmt::format("{} of {} parameters differ", differences.size(), compared));
  }
}

void add_common(CLI::App& command, Options& options) {
  add_drive_options(command, options.bus, "Seconds to wait for each answer");
  command.add_option("--eds", options.eds, "Electronic data sheet of a drive that is not in `servodrome products`");
  command.add_flag("--connection", options.connection,
                   "Include node-ID, bit rate and the other communication settings");
}

void add_save(CLI::App& params) {
  const auto [command, options] = add_command(params, "save", "Write the parameters of a drive into a text file", save);
  command->add_option("FILE", options->files, "File to write; - for standard output")->expected(0, 1);
  command->add_option("-o,--output", options->output, "The same as FILE");
  command->add_flag("--date", options->date, "Write the date into the file; without it equal drives give equal files");
  add_common(*command, *options);
}

void add_load(CLI::App& params) {
  const auto [command, options] =
      add_command(params, "load",
                  "Write the parameters of a file into a drive, read them back, and restore the "
                  "previous values if one is rejected",
                  load);
  command->add_option("FILE", options->files, "File of `params save`, or a part of it")->expected(0, 1);
  command->add_flag("--factory", options->factory, "Load the factory values of the product instead of a file");
  command->add_flag("--store", options->store,
                    "Store all parameters of the drive in non-volatile memory, not only those of the file");
  command->add_flag("--force", options->force, "Load the file of another product as well");
  command->add_flag("--skip-absent", options->skip_absent, "Skip parameters that the drive does not have on this bus");
  add_common(*command, *options);
}

void add_diff(CLI::App& params) {
  const auto [command, options] =
      add_command(params, "diff",
                  "Compare a file with a drive, with another file, or either with the factory's values; exit status 1: "
                  "they differ",
                  diff);
  command->add_option("FILE", options->files, "One or two files")->expected(0, 2);
  command->add_flag("--factory", options->factory, "Compare with the factory values of the product");
  add_common(*command, *options);
}

}  // namespace params_command

void add_params(CLI::App& app) {
  CLI::App* params = app.add_subcommand("params", "Save, load and compare the parameters of a drive");
  params->require_subcommand(1);
  params_command::add_save(*params);
  params_command::add_load(*params);
  params_command::add_diff(*params);
}

}  // namespace servodrome::app
