#include "line/line_file.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <set>

#include "line/axis_address.hpp"
#include "line/axis_plant.hpp"
#include "line/coupling_table.hpp"
#include "line/described_product.hpp"
#include "line/model_plant.hpp"
#include "line/table_reader.hpp"
#include "line/toml_text.hpp"
#include "links/can/link_name.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"
#include "links/link_scheme.hpp"
#include "links/nearest_name.hpp"
#include "links/serial/format_text.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::line {
namespace {

constexpr std::size_t longest_name = 16;  // bus: limit of socketcand; axis: fits a table
constexpr std::size_t most_buses = 16;
constexpr std::size_t most_axes = 1000;

// For example "a link is slcan:PATH, socketcan:INTERFACE or mem:".
std::string link_forms(const char* link, links::LinkSchemes schemes) {
  return fmt::format("{} is {} or {}", link, links::forms(schemes), links::scheme::mem.form);
}

// Names are part of URLs, file names and log lines, so few characters are allowed.
bool is_name(std::string_view text) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
  return !text.empty() && text.size() <= longest_name && std::all_of(text.begin(), text.end(), allowed);
}

class LineFileReader {
 public:
  LineFileReader(const std::string& file, std::span<const Product> products)
      : folder_(std::filesystem::path(file).parent_path()), products_(products) {
    report_.file = file;
  }

  LineFile read(const toml::table& root) {
    TableReader reader(root, "", report_);
    read_clock(reader);
    if (const toml::table* api = reader.table("api")) read_api(*api);
    for (const toml::table* bus : reader.tables("bus")) read_bus(*bus);
    for (const toml::table* axis : reader.tables("axis")) read_axis(*axis);
    for (const toml::table* coupling : reader.tables("coupling")) {
      TableReader coupling_reader(*coupling, "coupling", report_);
      read_coupling(coupling_reader, settings_);
    }
    reader.finish();
    if (bus_names(settings_).empty()) {
      reader.complain("bus", "there is no bus", "add one: [[bus]] with name = \"can0\"");
    }
    if (settings_.axes.empty() && report_.diagnostics.empty()) {
      reader.complain("axis", "there is no axis", "add one: [[axis]] with name, product, bus and node");
    }
    for (std::vector<Diagnostic>* found : {&report_.diagnostics, &report_.warnings}) {
      std::stable_sort(found->begin(), found->end(), [](const auto& a, const auto& b) {
        return std::pair(a.line, a.column) < std::pair(b.line, b.column);
      });
    }
    return {std::move(settings_), std::move(report_.diagnostics), std::move(report_.warnings)};
  }

 private:
  void read_clock(TableReader& root) {
    std::string clock = "real";
    root.read("clock", clock);
    if (clock == "virtual") {
      settings_.clock = ClockMode::virtual_time;
    } else if (clock != "real") {
      root.complain("clock", fmt::format("there is no clock \"{}\"", clock), "write \"real\" or \"virtual\"");
    }
  }

  void read_api(const toml::table& table) {
    TableReader reader(table, "api", report_);
    reader.read("enabled", settings_.api.enabled);
    std::string address = fmt::format("{}:{}", settings_.api.address, settings_.api.port);
    reader.read("address", address);
    if (const auto error = parse_api_address(address, settings_.api); !error.empty()) {
      reader.complain("address", error, "write \"ADDRESS:PORT\", for example \"127.0.0.1:8402\"");
    }
    reader.finish();
  }

  void read_name(TableReader& reader, std::string_view what, std::string& name) {
    reader.read("name", name);
    if (is_name(name)) return;
    reader.complain("name", name.empty() ? "is missing" : fmt::format("\"{}\" cannot be a name", name),
                    fmt::format("name the {} with 1 to {} letters, digits, - and _", what, longest_name));
  }

  void read_bus(const toml::table& table) {
    TableReader reader(table, "bus", report_);
    std::string type = "can";
    reader.read("type", type);
    if (type != "can" && type != "ethercat" && type != "rs485") {
      reader.complain("type", fmt::format("there is no type of bus \"{}\"", type),
                      "write \"can\", \"ethercat\" or \"rs485\"");
    }
    std::string name;
    read_name(reader, "bus", name);
    const std::vector<std::string_view> names = bus_names(settings_);
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      reader.complain("name", fmt::format("there is a bus \"{}\" already", name), "give each bus a name of its own");
    }
    if (names.size() == most_buses) {
      reader.complain("name", "exceeds the number of buses", fmt::format("a line has at most {}", most_buses));
    }
    if (type == "rs485") {
      read_serial_bus(reader, std::move(name));
    } else if (type == "ethercat") {
      read_ethercat_bus(reader, std::move(name));
    } else {
      read_can_bus(reader, std::move(name));
    }
    reader.finish();
  }

  void read_can_bus(TableReader& reader, std::string name) {
    BusSettings bus;
    bus.name = std::move(name);
    reader.read("bit_rate", bus.bit_rate, 10'000, 1'000'000);
    reader.read("ideal", bus.ideal);
    read_links(reader, bus.links, link_forms("a link", links::can_schemes),
               [](const std::string& text) { links::parse_can_link(text); });
    settings_.buses.push_back(std::move(bus));
  }

  void read_ethercat_bus(TableReader& reader, std::string name) {
    EthercatBusSettings bus;
    bus.name = std::move(name);
    read_links(reader, bus.links, link_forms("a link of an EtherCAT segment", links::ethercat_schemes_easiest_first),
               [](const std::string& text) { links::parse_ethercat_link(text); });
    settings_.ethercat_buses.push_back(std::move(bus));
  }

  void read_serial_bus(TableReader& reader, std::string name) {
    SerialBusSettings bus;
    bus.name = std::move(name);
    reader.read("bit_rate", bus.format.bit_rate, 1'200, 1'000'000);
    std::string format = "8N1";
    reader.read("format", format);
    const auto parsed = links::parse_character_format(format, bus.format.bit_rate);
    if (parsed && parsed->data_bits == 8) {
      bus.format = *parsed;
    } else {
      reader.complain("format", fmt::format("\"{}\" is not a format", format),
                      "write \"8N1\", \"8E1\", \"8O1\", or the same with 2 stop bits");
    }
    std::int64_t silence_ms = 0;
    reader.read("silence_ms", silence_ms, 0, 1'000);
    bus.silence = std::chrono::milliseconds(silence_ms);
    read_links(reader, bus.links, link_forms("a link of an RS485 line", links::serial_schemes),
               [](const std::string& text) { links::parse_serial_link(text); });
    settings_.serial_buses.push_back(std::move(bus));
  }

  // `parse` must throw LinkError if its text is no link of this kind of bus.
  template <typename Parse>
  void read_links(TableReader& reader, std::vector<std::string>& links, const std::string& forms, const Parse& parse) {
    const toml::node* node = reader.node("links");
    if (node == nullptr) return;
    const toml::array* array = node->as_array();
    if (array == nullptr) {
      reader.complain("links", "is not a list", fmt::format("write links = [\"LINK\"]; {}", forms));
      return;
    }
    for (const toml::node& element : *array) {
      const auto* text = element.as_string();
      std::string problem = "is not a string";
      if (text != nullptr) problem = problem_of_link(text->get(), parse);
      if (problem.empty()) {
        links.push_back(text->get());
      } else {
        report_.complain(element.source().begin, fmt::format("bus.links: {}", problem), forms);
      }
    }
  }

  template <typename Parse>
  std::string problem_of_link(const std::string& text, const Parse& parse) {
    try {
      parse(text);
    } catch (const links::LinkError& error) {
      return error.what();
    }
    if (text != "mem:" && !taken_links_.insert(text).second) return fmt::format("\"{}\" is taken", text);
    return {};
  }

  void read_axis(const toml::table& table) {
    AxisSettings axis;
    TableReader reader(table, "axis", report_);
    read_name(reader, "axis", axis.name);
    const auto same_name = [&axis](const AxisSettings& other) { return other.name == axis.name; };
    if (std::any_of(settings_.axes.begin(), settings_.axes.end(), same_name)) {
      reader.complain("name", fmt::format("there is an axis \"{}\" already", axis.name),
                      "give each axis a name of its own");
    }
    if (settings_.axes.size() == most_axes) {
      reader.complain("name", "exceeds the number of axes", fmt::format("a line has at most {}", most_axes));
    }
    read_product(reader, axis);
    read_model(reader, axis);
    read_axis_address(reader, settings_, axis);
    reader.read("serial_number", axis.serial_number);
    reader.read("store", axis.store);
    if (!axis.store.empty()) {
      axis.store = (folder_ / axis.store).lexically_normal().string();
      const auto same_store = [&axis](const AxisSettings& other) { return other.store == axis.store; };
      if (std::any_of(settings_.axes.begin(), settings_.axes.end(), same_store)) {
        reader.complain("store", "another axis uses this file", "give each axis a file of its own");
      }
    }
    axis.plant.sensors.seed = static_cast<std::uint32_t>(settings_.axes.size() + 1);  // no two axes alike
    read_axis_plant(reader, axis);
    reader.finish();
    settings_.axes.push_back(std::move(axis));
  }

  void read_product(TableReader& reader, AxisSettings& axis) {
    if (reader.node("description") != nullptr) return read_description(reader, axis);
    std::string product;
    reader.read("product", product);
    axis.product = find_product(products_, product);
    if (axis.product != nullptr) return;
    std::vector<std::string_view> names;
    for (const Product& known : products_) names.push_back(known.name);
    reader.complain("product", product.empty() ? "is missing" : fmt::format("there is no product \"{}\"", product),
                    links::suggestion(product, names));
  }

  // Reads a drive from a maker's description. Axes with the same file and device share one product.
  void read_description(TableReader& reader, AxisSettings& axis) {
    std::string file;
    std::string device;
    reader.read("description", file);
    reader.read("device", device);
    if (reader.node("product") != nullptr) {
      reader.complain("product", "both product and description are given", "remove one of them");
    }
    if (file.empty()) return;
    const std::string path = (folder_ / file).lexically_normal().string();
    const auto known = descriptions_.find({path, device});
    if (known != descriptions_.end()) {
      axis.described = known->second;
    } else {
      try {
        axis.described = describe_product(path, device);
      } catch (const describe::DeviceFileError& error) {
        reader.complain("description", fmt::format("{}: {}", error.where(), error.problem()), error.remedy());
        return;
      }
      descriptions_[{path, device}] = axis.described;
    }
    axis.product = axis.described.get();
    fit_encoder(*axis.product, axis.plant);
  }

  // A model sets the motor data first; the keys of the file then replace them.
  void read_model(TableReader& reader, AxisSettings& axis) {
    if (axis.product == nullptr) {
      reader.node("model");
      return;
    }
    axis.model = axis.product->default_model;
    if (axis.product->models.empty()) return;  // then finish() reports the key as unknown
    reader.read("model", axis.model);
    if (const products::Model* model = products::find_model(axis.product->models, axis.model)) {
      fit_model(*model, axis.plant);
      return;
    }
    std::vector<std::string_view> names;
    for (const products::Model& known : axis.product->models) names.push_back(known.name);
    reader.complain("model", fmt::format("{} has no model \"{}\"", axis.product->name, axis.model),
                    links::suggestion(axis.model, names));
  }

  std::filesystem::path folder_;
  std::span<const Product> products_;
  FileReport report_;
  LineSettings settings_;
  std::set<std::string> taken_links_;
  std::map<std::pair<std::string, std::string>, std::shared_ptr<const Product>> descriptions_;  // by file and device
};

}  // namespace

LineFile parse_line_file(std::string_view text, const std::string& file, std::span<const Product> products) {
  LineFile failed;
  const auto root = parse_toml(text, file, failed.diagnostics);
  return root ? LineFileReader(file, products).read(*root) : failed;
}

LineFile load_line_file(const std::string& path, std::span<const Product> products) {
  LineFile failed;
  const auto text = read_text_file(path, "a line file", failed.diagnostics);
  return text ? parse_line_file(*text, path, products) : failed;
}

}  // namespace servodrome::line
