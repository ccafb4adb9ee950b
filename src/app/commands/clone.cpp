#include "tools/clone/clone.hpp"

#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sstream>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/whole_file.hpp"

namespace servodrome::app {
namespace clone_command {

using nlohmann::ordered_json;

struct Options {
  BusOptions bus;
  std::string file;
  std::string eds;
};

master::CloneProgress progress_of(const Options& options) {
  const bool shown = on_terminal() && !options.bus.json;
  return [shown](const char* doing, std::size_t done, std::size_t of) {
    if (InterruptGuard::interrupted()) {
      throw master::MasterError("interrupted", fmt::format("{} {} of {}", doing, done, of),
                                "nothing was written; start the command again");
    }
    if (shown && done % 16 == 0) fmt::print(stderr, "\r  {} {} of {}\x1B[K", doing, done + 1, of);
  };
}

// The description of a CAN drive's objects, and its source.
struct Known {
  describe::DeviceFile device;
  std::string from;
};

describe::DeviceFile read_sheet(const std::string& text, const std::string& name) {
  std::istringstream stream(text);
  return describe::read_eds(stream, name);
}

// Reads the data sheet that a drive may store in 1021h. Empty if there is none that can be read.
std::optional<describe::DeviceFile> sheet_in_drive(master::ObjectClient& objects) {
  try {
    const std::vector<std::byte> bytes = objects.upload({0x1021, 0});
    return read_sheet(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), "1021h");
  } catch (const master::ObjectError& error) {
    if (!error.answered()) throw;
  } catch (const describe::DeviceFileError&) {
  }
  return std::nullopt;
}

Known objects_of(DriveLink& link, const Options& options) {
  if (!options.eds.empty()) {
    try {
      return {read_sheet(describe::read_file(options.eds), options.eds), options.eds};
    } catch (const describe::DeviceFileError& error) {
      throw Failure::wrong_use(fmt::format("--eds {}", error.what()));
    }
  }
  if (auto sheet = sheet_in_drive(link.objects()))
    return {std::move(*sheet), "the data sheet stored in the drive, 1021h"};
  if (const line::Product* product = link.product()) {
    const describe::Description description = product->describe();
    describe::DeviceFile device = master::objects_of_table(description.table);
    device.vendor_name = description.vendor_name;
    device.product_name = description.product_name;
    device.order_code = description.order_code;
    device.bit_rates_kbit = description.bit_rates_kbit;
    device.lss_supported = description.lss_supported;
    return {std::move(device), fmt::format("the dictionary of `{}`", product->name)};
  }
  return {master::objects_that_answer(link.objects(), progress_of(options)),
          "the objects from 1000h to 67FFh that answer; --eds FILE adds names, types and PDO mapping"};
}

void clone(const Options& options) {
  const BusKind kind = bus_kind(options.bus).kind;
  if (kind != BusKind::can && kind != BusKind::ethercat) {
    throw Failure::wrong_use("clone: only CANopen and EtherCAT drives can be read; give such a bus with --bus");
  }
  if (kind == BusKind::ethercat && !options.eds.empty()) {
    throw Failure::wrong_use("clone: --eds is for CAN; on EtherCAT the slave lists its objects itself");
  }
  const InterruptGuard guard;
  DriveLink link(options.bus, true);
  if (link.sdo() != nullptr) link.sdo()->cancel_when(InterruptGuard::interrupted);  // reading takes seconds
  const auto progress = progress_of(options);
  const auto end_line = [&options] {
    if (on_terminal() && !options.bus.json) fmt::print(stderr, "\r\x1B[K");
  };
  master::Clone read;
  std::string text;
  std::string from;
  try {
    if (auto* coe = dynamic_cast<master::CoeObjects*>(&link.objects())) {
      master::EthercatSlave& slave = coe->slave();
      from = "the slave's SDO information";
      read = master::read_clone(link.objects(), master::objects_of_slave(slave.coe(), progress), 0, progress);
      if (const line::Product* product = link.product()) read.device.vendor_name = product->describe().vendor_name;
      text = master::slave_information(read, slave.found().sii);
    } else {
      Known known = objects_of(link, options);
      from = known.from;
      const auto node = static_cast<std::uint8_t>(link.objects().address());
      read = master::read_clone(link.objects(), std::move(known.device), node, progress);
      text = master::configuration_file(read, std::filesystem::path(options.file).filename().string(), node);
    }
  } catch (...) {
    end_line();
    throw;
  }
  end_line();
  if (read.values == 0) {
    throw Failure::did_not_work(fmt::format("{}: no object could be read; is it a drive?", link.objects().where()));
  }
  write_whole_file(options.file, text);
  if (options.bus.json) {
    ordered_json unread = ordered_json::array();
    for (const master::UnreadObject& one : read.unread)
      unread.push_back({{"object", text_of(one.address)}, {"why", one.why}});
    fmt::print("{}\n", ordered_json{{"file", options.file},
                                    {"objects_from", from},
                                    {"objects", read.device.entries.size()},
                                    {"values", read.values},
                                    {"unread", unread}}
                           .dump(2, ' ', false, ordered_json::error_handler_t::replace));
    return;
  }
  fmt::print("{}: {} objects (from {}), {} values\n", options.file, read.device.entries.size(), from, read.values);
  for (const master::UnreadObject& one : read.unread) fmt::print("not read: {}: {}\n", text_of(one.address), one.why);
  const bool on_ethercat = kind == BusKind::ethercat;
  fmt::print("`servodrome up {} {}` runs it\n", on_ethercat ? "--esi" : "--eds", options.file);
}

}  // namespace clone_command

void add_clone(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "clone", "Read a drive's dictionary and values into a file that `servodrome up` runs as a simulated drive",
      clone_command::clone);
  command
      ->add_option("-o,--output", options->file, "File to write: an EDS with values (DCF), or for EtherCAT an ESI file")
      ->required();
  command->add_option("--eds", options->eds, "CAN: electronic data sheet with the objects of the drive");
  add_bus_options(*command, options->bus, "Seconds to wait for each answer");
  command->get_option("--bus")->description(can_or_ethercat_help());
  add_node_option(*command, options->bus);
  command->get_option("--node")->description(
      "Node-ID, 1..127, or on EtherCAT position behind the master, 1.., or (a number above the count of slaves) "
      "station alias; the only one found if not given");
}

}  // namespace servodrome::app
