// `get` and `set`: read and write objects of a drive by SDO, Modbus or the 10-byte protocol.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/object_names.hpp"

namespace servodrome::app {
namespace object_access_command {

using dictionary::Type;

struct Options {
  BusOptions bus;
  std::string eds;
  std::string type;
  bool block = false;
  std::vector<std::string> objects;  // get
  std::string object;                // set
  std::string value;
};

std::optional<Type> given_type(const Options& options) {
  if (options.type.empty()) return std::nullopt;
  const auto type = master::parse_type(options.type);
  if (!type) {
    throw Failure::wrong_use(
        fmt::format("--type {}: unknown; write i8 .. i64, u8 .. u64, bool, f32, string or bytes", options.type));
  }
  return type;
}

std::optional<Type> type_of(const Options& options, const master::ObjectCatalogue& catalogue,
                            master::ObjectAddress object) {
  if (const auto type = given_type(options)) return type;
  const master::NamedObject* known = catalogue.find(object);
  return known == nullptr ? std::nullopt : known->type;
}

// For features that only CANopen has.
master::SdoClient& sdo_of(DriveLink& link) {
  if (link.sdo() == nullptr) throw Failure::wrong_use("--block: only CANopen has the SDO block protocol");
  return *link.sdo();
}

std::vector<std::byte> upload(DriveLink& link, master::ObjectAddress object, const Options& options) {
  return options.block ? sdo_of(link).upload(object, master::SdoProtocol::block) : link.objects().upload(object);
}

void get(const Options& options) {
  const ObjectNames names(options.eds);
  given_type(options);
  DriveLink link(options.bus, false);
  const master::ObjectCatalogue& catalogue = names.of(link);
  std::vector<master::ObjectAddress> objects;
  for (const std::string& text : options.objects) objects.push_back(resolve(catalogue, text));
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  std::vector<std::string> problems;
  for (const master::ObjectAddress object : objects) {
    try {
      const std::vector<std::byte> bytes = upload(link, object, options);
      const auto type = type_of(options, catalogue, object);
      list.push_back(object_json(catalogue, link.objects().address(), object, bytes, type));
      if (!options.bus.json) fmt::print("{} = {}\n", catalogue.title(object), master::text_of_value(bytes, type));
    } catch (const master::ObjectError& error) {
      // If the drive refuses an object, the others are still read; if it is silent, the command ends.
      problems.emplace_back(error.what());
      list.push_back({{"node", link.objects().address()},
                      {"object", text_of(object)},
                      {"index", object.index},
                      {"sub", object.sub},
                      {"error", error.what()}});
      if (!error.answered()) break;
    }
  }
  if (options.bus.json) {
    const auto& document = objects.size() == 1 ? list[0] : list;
    fmt::print("{}\n", document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  }
  std::fflush(stdout);
  if (problems.empty()) return;
  for (std::size_t i = 0; i + 1 < problems.size(); ++i) warn(problems[i]);
  throw Failure::did_not_work(problems.back());
}

// An object of unknown type is written as an integer of its present size.
Type type_to_write(const Options& options, const master::ObjectCatalogue& catalogue, master::ObjectAddress object,
                   master::ObjectClient& objects) {
  if (const auto type = type_of(options, catalogue, object)) return *type;
  const bool negative = !options.value.empty() && options.value.front() == '-';
  switch (objects.upload(object).size()) {
    case 1: return negative ? Type::integer8 : Type::unsigned8;
    case 2: return negative ? Type::integer16 : Type::unsigned16;
    case 4: return negative ? Type::integer32 : Type::unsigned32;
    case 8: return negative ? Type::integer64 : Type::unsigned64;
    default:
      throw Failure::wrong_use(fmt::format("object {}: its type is not known; give --type, or --eds", text_of(object)));
  }
}

void set(const Options& options) {
  const ObjectNames names(options.eds);
  const auto value_as = [&options](Type type, const std::string& title) {
    try {
      return master::parse_value(options.value, type);
    } catch (const master::MasterError& error) {
      throw Failure::wrong_use(fmt::format("{}: {}", title, error.what()));
    }
  };
  const master::ObjectCatalogue& given = names.without_drive();
  if (knows(given, options.object)) {  // report wrong use before the bus is opened
    const master::ObjectAddress object = given.resolve(options.object);
    auto type = type_of(options, given, object);
    // The drive's own type may be wider.
    const bool is_sure = names.has_eds() || given_type(options);
    if (type && !is_sure && dictionary::size_of(*type) != 0 && *type != Type::real32 && *type != Type::boolean) {
      type = Type::integer64;
    }
    if (type) value_as(*type, given.title(object));
  }
  given_type(options);
  DriveLink link(options.bus, false);
  const master::ObjectCatalogue& catalogue = names.of(link);
  const master::ObjectAddress object = resolve(catalogue, options.object);
  const auto value_of = [&](Type type) { return value_as(type, catalogue.title(object)); };
  const Type type = type_to_write(options, catalogue, object, link.objects());
  const std::vector<std::byte> bytes = value_of(type);
  if (options.block) {
    sdo_of(link).download(object, bytes, master::SdoProtocol::block);
  } else {
    link.objects().download(object, bytes);
  }
  if (options.bus.json) {
    fmt::print("{}\n", object_json(catalogue, link.objects().address(), object, bytes, type).dump(2));
  } else {
    fmt::print("{} = {}\n", catalogue.title(object), master::text_of_value(bytes, type));
  }
}

void add_common(CLI::App& command, Options& options) {
  add_drive_options(command, options.bus, "Seconds to wait for each answer");
  command.add_option("--eds", options.eds, "Electronic data sheet with the drive's own objects, names and types");
  command.add_option("--type", options.type, "Type of the value: i8 .. i64, u8 .. u64, bool, f32, string, bytes");
  command.add_flag("--block", options.block, "Use the SDO block protocol");
}

}  // namespace object_access_command

void add_get(CLI::App& app) {
  const auto [command, options] = add_command(app, "get", "Read objects of a drive", object_access_command::get);
  command->add_option("OBJECT", options->objects, "INDEX[:SUB] in hexadecimal, or a name, e.g. 6041 or statusword")
      ->required();
  object_access_command::add_common(*command, *options);
}

void add_set(CLI::App& app) {
  const auto [command, options] = add_command(app, "set", "Write an object of a drive", object_access_command::set);
  command->add_option("OBJECT", options->object, "INDEX[:SUB] in hexadecimal, or a name")->required();
  command->add_option("VALUE", options->value, "Decimal, 0x or h for hexadecimal, text, or bytes in hexadecimal")
      ->required();
  object_access_command::add_common(*command, *options);
}

}  // namespace servodrome::app
