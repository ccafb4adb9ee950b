#include "line/line_file.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <set>

#include "line/model_plant.hpp"
#include "line/nearest_name.hpp"
#include "line/table_reader.hpp"
#include "line/travel.hpp"
#include "links/can/link_name.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"
#include "links/serial/format_text.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::line {
namespace {

constexpr std::size_t longest_name = 16;  // of a bus: what socketcand carries; of an axis: fits a table
constexpr std::size_t most_buses = 16;
constexpr std::size_t most_axes = 1000;
constexpr std::size_t largest_file = 1 << 20;

constexpr const char* can_link_forms = "a link is socketcand:HOST:PORT/BUS, slcan:PATH, socketcan:INTERFACE or mem:";
constexpr const char* ethercat_link_forms = "a link of an EtherCAT segment is udp:HOST:PORT, raw:INTERFACE or mem:";
constexpr const char* serial_link_forms = "a link of an RS485 line is pty:PATH, serial:DEVICE, tcp:HOST:PORT or mem:";

// Names stand in URLs, file names and log lines.
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
    reader.finish();
    if (bus_names().empty()) {
      reader.complain("bus", "there is no bus", "add one: [[bus]] with name = \"can0\"");
    }
    if (settings_.axes.empty() && report_.diagnostics.empty()) {
      reader.complain("axis", "there is no axis", "add one: [[axis]] with name, product, bus and node");
    }
    std::stable_sort(report_.diagnostics.begin(), report_.diagnostics.end(), [](const auto& a, const auto& b) {
      return std::pair(a.line, a.column) < std::pair(b.line, b.column);
    });
    return {std::move(settings_), std::move(report_.diagnostics)};
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
    const std::vector<std::string_view> names = bus_names();
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      reader.complain("name", fmt::format("there is a bus \"{}\" already", name), "give each bus a name of its own");
    }
    if (names.size() == most_buses) {
      reader.complain("name", "is one bus too many", fmt::format("a line has at most {}", most_buses));
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
    read_links(reader, bus.links, can_link_forms, [](const std::string& text) { links::parse_can_link(text); });
    settings_.buses.push_back(std::move(bus));
  }

  void read_ethercat_bus(TableReader& reader, std::string name) {
    EthercatBusSettings bus;
    bus.name = std::move(name);
    read_links(reader, bus.links, ethercat_link_forms,
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
      reader.complain("format", fmt::format("\"{}\" is no format", format),
                      "write \"8N1\", \"8E1\", \"8O1\", or the same with 2 stop bits");
    }
    std::int64_t silence_ms = 0;
    reader.read("silence_ms", silence_ms, 0, 1'000);
    bus.silence = std::chrono::milliseconds(silence_ms);
    read_links(reader, bus.links, serial_link_forms, [](const std::string& text) { links::parse_serial_link(text); });
    settings_.serial_buses.push_back(std::move(bus));
  }

  std::vector<std::string_view> bus_names() const {
    std::vector<std::string_view> names;
    for (const BusSettings& bus : settings_.buses) names.push_back(bus.name);
    for (const SerialBusSettings& bus : settings_.serial_buses) names.push_back(bus.name);
    for (const EthercatBusSettings& bus : settings_.ethercat_buses) names.push_back(bus.name);
    return names;
  }

  // `parse` throws LinkError for what is no link of the bus.
  template <typename Parse>
  void read_links(TableReader& reader, std::vector<std::string>& links, const char* forms, const Parse& parse) {
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
      reader.complain("name", "is one axis too many", fmt::format("a line has at most {}", most_axes));
    }
    read_product(reader, axis);
    read_model(reader, axis);
    read_address(reader, axis);
    read_serial(reader, axis);
    reader.read("serial_number", axis.serial_number);
    reader.read("store", axis.store);
    if (!axis.store.empty()) {
      axis.store = (folder_ / axis.store).lexically_normal().string();
      const auto same_store = [&axis](const AxisSettings& other) { return other.store == axis.store; };
      if (std::any_of(settings_.axes.begin(), settings_.axes.end(), same_store)) {
        reader.complain("store", "another axis uses this file", "give each axis a file of its own");
      }
    }
    read_plant(reader, axis);
    reader.finish();
    settings_.axes.push_back(std::move(axis));
  }

  void read_product(TableReader& reader, AxisSettings& axis) {
    std::string product;
    reader.read("product", product);
    axis.product = find_product(products_, product);
    if (axis.product != nullptr) return;
    std::vector<std::string_view> names;
    for (const Product& known : products_) names.push_back(known.name);
    reader.complain("product", product.empty() ? "is missing" : fmt::format("there is no product \"{}\"", product),
                    suggestion(product, names));
  }

  // A model brings its motor; what the file says of the motor comes on top.
  void read_model(TableReader& reader, AxisSettings& axis) {
    if (axis.product == nullptr) {
      reader.node("model");
      return;
    }
    axis.model = axis.product->default_model;
    if (axis.product->models.empty()) return;  // the key is unknown then
    reader.read("model", axis.model);
    if (const products::Model* model = products::find_model(axis.product->models, axis.model)) {
      fit_model(*model, axis.plant);
      return;
    }
    std::vector<std::string_view> names;
    for (const products::Model& known : axis.product->models) names.push_back(known.name);
    reader.complain("model", fmt::format("{} has no model \"{}\"", axis.product->name, axis.model),
                    suggestion(axis.model, names));
  }

  // The fieldbus: its own of the product's kind, found by name, or the only one there is.
  void read_address(TableReader& reader, AxisSettings& axis) {
    if (axis.product == nullptr) {  // nobody knows which bus it needs, and which of these keys
      for (const char* key : {"bus", "alias", "oscillator_ppm", "cable_ns"}) reader.node(key);
      read_node(reader, axis);
      return;
    }
    const bool on_ethercat = axis.product->fieldbus == Fieldbus::ethercat;
    std::vector<std::string_view> names;
    if (on_ethercat) {
      for (const EthercatBusSettings& known : settings_.ethercat_buses) names.push_back(known.name);
    } else {
      for (const BusSettings& known : settings_.buses) names.push_back(known.name);
    }
    const std::optional<std::size_t> bus = read_fieldbus(reader, axis, names);
    if (on_ethercat) {
      read_ethercat_address(reader, axis, bus);
    } else {
      axis.bus = bus;
      read_can_address(reader, axis);
    }
  }

  // Index into `names`, which are the buses that the axis can stand on.
  std::optional<std::size_t> read_fieldbus(TableReader& reader, const AxisSettings& axis,
                                           const std::vector<std::string_view>& names) {
    std::string bus;
    reader.read("bus", bus);
    const auto found = std::find(names.begin(), names.end(), bus);
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    if (bus.empty() && reader.node("serial") != nullptr) return std::nullopt;  // on the RS485 line alone
    if (bus.empty() && names.size() == 1) return 0;
    const std::vector<std::string_view> all = bus_names();
    if (find_serial_bus(bus)) {
      reader.complain("bus", fmt::format("\"{}\" is an RS485 line", bus), fmt::format("write serial = \"{}\"", bus));
    } else if (std::find(all.begin(), all.end(), bus) != all.end()) {
      const bool on_ethercat = axis.product->fieldbus == Fieldbus::ethercat;
      reader.complain(
          "bus",
          fmt::format("a `{}` is a drive for {}, \"{}\" is {}", axis.product->name, on_ethercat ? "EtherCAT" : "CAN",
                      bus, on_ethercat ? "a CAN bus" : "an EtherCAT segment"),
          on_ethercat ? "name a bus with type = \"ethercat\"" : "`servodrome products` lists those for EtherCAT");
    } else if (bus.empty() && names.empty() && !settings_.serial_buses.empty()) {
      reader.complain("serial", "is missing", "name the RS485 line of the axis: serial = \"NAME\"");
    } else if (!all.empty()) {
      reader.complain("bus", bus.empty() ? "is missing" : fmt::format("there is no bus \"{}\"", bus),
                      names.empty() ? no_such_bus(axis) : suggestion(bus, names));
    }
    return std::nullopt;
  }

  static const char* no_such_bus(const AxisSettings& axis) {
    return axis.product->fieldbus == Fieldbus::ethercat
               ? "the product needs a bus with type = \"ethercat\", and there is none"
               : "the product needs a CAN bus, and there is none; `servodrome products` lists those for EtherCAT";
  }

  void read_ethercat_address(TableReader& reader, AxisSettings& axis, std::optional<std::size_t> bus) {
    constexpr double worst_oscillator_ppm = 200;
    constexpr std::int64_t longest_cable_ns = 100'000;
    AxisEthercatSettings ethercat;
    std::int64_t cable_ns = 0;
    reader.read("alias", ethercat.alias);
    reader.read("oscillator_ppm", ethercat.oscillator_ppm);
    reader.read("cable_ns", cable_ns, 0, longest_cable_ns);
    ethercat.cable = links::Time(cable_ns);
    if (std::abs(ethercat.oscillator_ppm) > worst_oscillator_ppm) {
      reader.complain("oscillator_ppm", fmt::format("{:g} is out of range", ethercat.oscillator_ppm),
                      fmt::format("expected -{0:g} .. {0:g}", worst_oscillator_ppm));
    }
    for (const char* key : {"node", "bit_rate"}) {
      if (reader.node(key) == nullptr) continue;
      reader.complain(key, "is of an axis on a CAN bus", "an EtherCAT slave's address is its place in the file");
    }
    if (!bus) return;
    ethercat.bus = *bus;
    axis.ethercat = ethercat;
  }

  static void read_node(TableReader& reader, AxisSettings& axis) {
    reader.read("node", axis.node_id, 1, 127);
    reader.read("bit_rate", axis.bit_rate, 10'000, 1'000'000);
  }

  void read_can_address(TableReader& reader, AxisSettings& axis) {
    for (const char* key : {"alias", "oscillator_ppm", "cable_ns"}) {
      if (reader.node(key) != nullptr) {
        reader.complain(key, "is of an axis on an EtherCAT segment", "leave the key out");
      }
    }
    read_node(reader, axis);
    check_bit_rate(reader, axis);
    const unsigned node = node_in_force(axis);
    if (node == 0 || !axis.bus) return;
    for (const AxisSettings& other : settings_.axes) {
      if (other.bus != axis.bus || node_in_force(other) != node) continue;
      reader.complain("node", fmt::format("axis \"{}\" is node {} of this bus already", other.name, node),
                      fmt::format("node {} is free", free_node(*axis.bus)));
      return;
    }
  }

  // A drive may be set to another bit rate than its bus, but not to one that it does not have.
  void check_bit_rate(TableReader& reader, const AxisSettings& axis) {
    if (axis.product == nullptr || axis.product->describe == nullptr || (axis.bit_rate == 0 && !axis.bus)) return;
    const std::uint32_t rate = axis.bit_rate != 0 ? axis.bit_rate : settings_.buses[*axis.bus].bit_rate;
    const std::vector<unsigned> rates = axis.product->describe().bit_rates_kbit;
    const bool known = std::any_of(rates.begin(), rates.end(), [rate](unsigned kbit) { return kbit * 1000 == rate; });
    if (known) return;
    reader.complain(axis.bit_rate != 0 ? "bit_rate" : "bus",
                    fmt::format("a `{}` cannot be set to {} bit/s", axis.product->name, rate),
                    fmt::format("it has {} kbit/s", fmt::join(rates, ", ")));
  }

  std::optional<std::size_t> find_serial_bus(std::string_view name) const {
    for (std::size_t i = 0; i < settings_.serial_buses.size(); ++i) {
      if (settings_.serial_buses[i].name == name) return i;
    }
    return std::nullopt;
  }

  void read_serial(TableReader& reader, AxisSettings& axis) {
    AxisSerialSettings serial;
    std::string bus;
    std::string protocol;
    reader.read("serial", bus);
    reader.read("station", serial.station, 1, modbus::highest_station);
    reader.read("serial_protocol", protocol);
    if (bus.empty()) {
      for (const char* key : {"station", "serial_protocol"}) {
        if (reader.node(key) == nullptr) continue;
        reader.complain(key, "is of an axis on an RS485 line", "name the line: serial = \"NAME\"");
      }
      return;
    }
    const auto found = find_serial_bus(bus);
    if (!found) {
      std::vector<std::string_view> names;
      for (const SerialBusSettings& known : settings_.serial_buses) names.push_back(known.name);
      reader.complain("serial", fmt::format("there is no RS485 line \"{}\"", bus),
                      names.empty() ? "add one: [[bus]] with type = \"rs485\"" : suggestion(bus, names));
      return;
    }
    serial.bus = *found;
    if (axis.product == nullptr) return;
    if (axis.product->serial == nullptr) {
      reader.complain("serial", fmt::format("a `{}` has no RS485 port", axis.product->name), "leave the key out");
      return;
    }
    read_serial_product(reader, axis, serial, protocol);
    axis.serial = serial;
  }

  void read_serial_product(TableReader& reader, const AxisSettings& axis, AxisSerialSettings& serial,
                           const std::string& protocol) {
    const SerialInterface& port = *axis.product->serial;
    const SerialBusSettings& bus = settings_.serial_buses[serial.bus];
    if (!port.supports(bus.format)) {
      reader.complain(
          "serial",
          fmt::format("a `{}` cannot be set to the bit rate and format of \"{}\"", axis.product->name, bus.name),
          "docs/line-file.md has those of each product under `format`");
    }
    if (serial.station != 0 && !port.has_own_station) {
      reader.complain("station", fmt::format("the station of a `{}` is its node-ID", axis.product->name),
                      "write node = N instead");
    }
    if (!protocol.empty()) {
      std::vector<std::string_view> names;
      for (const products::SerialProtocol known : port.protocols) {
        names.push_back(name_of(known));
        if (names.back() == protocol) serial.protocol = known;
      }
      if (!serial.protocol) {
        reader.complain("serial_protocol", fmt::format("a `{}` does not speak \"{}\"", axis.product->name, protocol),
                        suggestion(protocol, names));
      }
    }
    const unsigned station = serial.station != 0 ? serial.station : node_in_force(axis);
    for (const AxisSettings& other : settings_.axes) {
      if (!other.serial || other.serial->bus != serial.bus || station_in_force(other) != station) continue;
      reader.complain(serial.station != 0 ? "station" : "serial",
                      fmt::format("axis \"{}\" is station {} of this line already", other.name, station),
                      port.has_own_station ? "give another with station = N" : "give another with node = N");
      return;
    }
  }

  static unsigned station_in_force(const AxisSettings& axis) {
    return axis.serial->station != 0 ? axis.serial->station : node_in_force(axis);
  }

  static unsigned node_in_force(const AxisSettings& axis) {
    if (axis.node_id != 0) return axis.node_id;
    return axis.product != nullptr ? axis.product->factory_node_id : 0;
  }

  unsigned free_node(std::size_t bus) const {
    for (unsigned node = 1; node < 127; ++node) {
      const auto has = [&](const AxisSettings& axis) { return axis.bus == bus && node_in_force(axis) == node; };
      if (std::none_of(settings_.axes.begin(), settings_.axes.end(), has)) return node;
    }
    return 127;
  }

  template <typename Struct, std::size_t Count>
  void read_group(TableReader& axis, std::string_view key, Struct& target, const std::array<Key<Struct>, Count>& keys) {
    if (const toml::table* table = axis.table(key)) {
      TableReader reader(*table, axis.name_of(key), report_);
      reader.read(target, keys);
      reader.finish();
    }
  }

  void read_plant(TableReader& reader, AxisSettings& axis) {
    const std::size_t complaints = report_.diagnostics.size();
    read_group(reader, "motor", axis.plant.motor, motor_keys);
    read_group(reader, "load", axis.plant.load, load_keys);
    read_group(reader, "supply", axis.plant.supply, supply_keys);
    read_group(reader, "encoder", axis.plant.encoder, encoder_keys);
    read_group(reader, "thermal", axis.plant.thermal, thermal_keys);
    std::vector<std::string> switches;
    const toml::table* travel = reader.table("travel");
    if (travel != nullptr && axis.product != nullptr) {
      TableReader travel_reader(*travel, reader.name_of("travel"), report_);
      switches = read_travel(travel_reader, *axis.product, axis.plant);
    }
    axis.motor_data = motor_data_of(axis.plant);
    read_nameplate(reader, axis.motor_data);
    if (report_.diagnostics.size() != complaints) return;  // the plant's complaints would be echoes
    for (const std::string& message : plant::validate(axis.plant)) complain_of_plant(reader, message, switches);
  }

  void read_nameplate(TableReader& axis, drive::MotorData& motor) {
    const std::size_t complaints = report_.diagnostics.size();
    read_group(axis, "nameplate", motor, nameplate_keys);
    const toml::table* table = axis.table("nameplate");
    if (table == nullptr || report_.diagnostics.size() != complaints) return;
    TableReader reader(*table, axis.name_of("nameplate"), report_);
    for (const Range& range : nameplate_ranges) {
      const auto value = (*table)[range.name].value<double>();
      if (!value || (*value >= range.minimum && *value <= range.maximum)) continue;
      reader.complain(range.name, fmt::format("{:g} is out of range", *value),
                      fmt::format("expected {:g} .. {:g}", range.minimum, range.maximum));
    }
  }

  // `message` begins with the name of a parameter, as plant::validate writes it ("motor.pole_pairs: ...").
  void complain_of_plant(TableReader& axis, const std::string& message, const std::vector<std::string>& switches) {
    const std::size_t colon = message.find(": ");
    std::string name = message.substr(0, colon);
    const std::string what = colon == std::string::npos ? message : message.substr(colon + 2);
    if (name == "load.low_stop_counts") name = "travel.low_stop";
    if (name == "load.high_stop_counts") name = "travel.high_stop";
    if (name == "encoder.start_position_counts") name = "travel.start";
    if (name.starts_with("switches[")) {
      std::size_t number = 0;
      const std::string_view digits = std::string_view(name).substr(std::strlen("switches["));
      std::from_chars(digits.data(), digits.data() + digits.size(), number);
      name = number < switches.size() ? "travel." + switches[number] : "travel";
    }
    const std::string_view group = std::string_view(name).substr(0, name.find('.'));
    toml::source_position at = axis.place(group);
    const toml::table* table = axis.table(group);
    if (table != nullptr && group.size() < name.size()) {
      if (const toml::node* node = table->get(name.substr(group.size() + 1))) at = node->source().begin;
    }
    report_.complain(at, fmt::format("axis.{}: {}", name, what), "docs/line-file.md has the range of each parameter");
  }

  std::filesystem::path folder_;
  std::span<const Product> products_;
  FileReport report_;
  LineSettings settings_;
  std::set<std::string> taken_links_;
};

// A dotted key makes a table within a table for each of its parts, and the TOML library goes down into all of them on
// the stack; of brackets it counts how deep they are itself.
constexpr std::size_t most_key_parts = 16;

// Where the string or comment that begins at `at` ends; `at` itself if none does.
std::size_t end_of_text(std::string_view text, std::size_t at) {
  const char quote = text[at];
  if (quote == '#') return std::min(text.find('\n', at), text.size());
  if (quote != '"' && quote != '\'') return at;
  const bool of_lines = text.substr(at, 3) == std::string(3, quote);
  const std::string_view mark = text.substr(at, of_lines ? 3 : 1);
  for (std::size_t i = at + mark.size(); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (text.substr(i, mark.size()) == mark) {
      return i + mark.size();
    } else if (text[i] == '\n' && !of_lines) {
      return i;  // a mistake that the TOML library will name
    }
  }
  return text.size();
}

// The line where a key has more parts than that; 0: nowhere.
std::size_t line_with_deep_key(std::string_view text) {
  std::size_t dots = 0;
  for (std::size_t i = 0; i < text.size();) {
    if (const std::size_t end = end_of_text(text, i); end != i) {
      i = end;
      continue;
    }
    const char c = text[i++];
    if (c == '.' && ++dots >= most_key_parts) {
      return static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n')) +
             1;
    }
    if (c == '\n' || c == ',' || c == '=' || c == '[' || c == '{') dots = 0;
  }
  return 0;
}

}  // namespace

LineFile parse_line_file(std::string_view text, const std::string& file, std::span<const Product> products) {
  if (const std::size_t line = line_with_deep_key(text); line != 0) {
    LineFile failed;
    failed.diagnostics.push_back({file, static_cast<std::uint32_t>(line), 1, "a key has too many parts",
                                  fmt::format("write at most {} names with dots between them", most_key_parts)});
    return failed;
  }
  try {
    const toml::table root = toml::parse(text, file);
    return LineFileReader(file, products).read(root);
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    LineFile failed;
    failed.diagnostics.push_back({file, at.line, at.column, std::string(error.description()), "correct the TOML here"});
    return failed;
  }
}

LineFile load_line_file(const std::string& path, std::span<const Product> products) {
  LineFile failed;
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    failed.diagnostics.push_back({path, 0, 0, "is a folder", "give the name of a line file"});
    return failed;
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    failed.diagnostics.push_back({path, 0, 0, fmt::format("cannot be read: {}", std::strerror(errno)),
                                  "give the name of a line file, or none for the built-in line"});
    return failed;
  }
  std::string text(largest_file + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > largest_file) {
    failed.diagnostics.push_back({path, 0, 0, "is longer than 1 MiB", "is it a line file?"});
    return failed;
  }
  return parse_line_file(text, path, products);
}

}  // namespace servodrome::line
