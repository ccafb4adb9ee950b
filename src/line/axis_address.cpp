#include "line/axis_address.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "line/registry.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::line {
namespace {

class AxisAddressReader {
 public:
  explicit AxisAddressReader(const LineSettings& settings) : settings_(settings) {}

  void read(TableReader& reader, AxisSettings& axis) {
    read_fieldbus_address(reader, axis);
    read_serial_address(reader, axis);
  }

 private:
  // Finds the axis' fieldbus among those of the product's kind: by name, or the only one that exists.
  void read_fieldbus_address(TableReader& reader, AxisSettings& axis) {
    if (axis.product == nullptr) {  // marks all keys as known: the kind of bus is unknown
      for (const char* key : {"bus", "alias", "oscillator_ppm", "cable_ns", "sync_error_limit"}) reader.node(key);
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

  // Returns the index into `names`, which are the buses that fit the product.
  std::optional<std::size_t> read_fieldbus(TableReader& reader, const AxisSettings& axis,
                                           const std::vector<std::string_view>& names) {
    std::string bus;
    reader.read("bus", bus);
    const auto found = std::find(names.begin(), names.end(), bus);
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    if (bus.empty() && reader.node("serial") != nullptr) return std::nullopt;  // on the RS485 line alone
    if (bus.empty() && names.size() == 1) return 0;
    const std::vector<std::string_view> all = bus_names(settings_);
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
                      names.empty() ? no_such_bus(axis) : links::suggestion(bus, names));
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
    if (reader.node("sync_error_limit") != nullptr)
      reader.read("sync_error_limit", ethercat.sync_error_limit.emplace());
    ethercat.cable = links::Time(cable_ns);
    if (std::abs(ethercat.oscillator_ppm) > worst_oscillator_ppm) {
      reader.complain("oscillator_ppm", fmt::format("{:g} is out of range", ethercat.oscillator_ppm),
                      fmt::format("expected -{0:g} .. {0:g}", worst_oscillator_ppm));
    }
    for (const char* key : {"node", "bit_rate"}) {
      if (reader.node(key) == nullptr) continue;
      reader.complain(key, "is only for an axis on a CAN bus", "an EtherCAT slave's address is its place in the file");
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
    for (const char* key : {"alias", "oscillator_ppm", "cable_ns", "sync_error_limit"}) {
      if (reader.node(key) != nullptr) {
        reader.complain(key, "is only for an axis on an EtherCAT segment", "leave the key out");
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

  // A drive may be set to a bit rate other than that of its bus, but only to one that it supports.
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

  void read_serial_address(TableReader& reader, AxisSettings& axis) {
    AxisSerialSettings serial;
    std::string bus;
    std::string protocol;
    reader.read("serial", bus);
    reader.read("station", serial.station, 1, modbus::highest_station);
    reader.read("serial_protocol", protocol);
    if (bus.empty()) {
      for (const char* key : {"station", "serial_protocol"}) {
        if (reader.node(key) == nullptr) continue;
        reader.complain(key, "is only for an axis on an RS485 line", "name the line: serial = \"NAME\"");
      }
      return;
    }
    const auto found = find_serial_bus(bus);
    if (!found) {
      std::vector<std::string_view> names;
      for (const SerialBusSettings& known : settings_.serial_buses) names.push_back(known.name);
      reader.complain("serial", fmt::format("there is no RS485 line \"{}\"", bus),
                      names.empty() ? "add one: [[bus]] with type = \"rs485\"" : links::suggestion(bus, names));
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
          "docs/line-file.md lists the formats of each product under `format`");
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
                        links::suggestion(protocol, names));
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

  const LineSettings& settings_;
};

}  // namespace

std::vector<std::string_view> bus_names(const LineSettings& settings) {
  std::vector<std::string_view> names;
  for (const BusSettings& bus : settings.buses) names.push_back(bus.name);
  for (const SerialBusSettings& bus : settings.serial_buses) names.push_back(bus.name);
  for (const EthercatBusSettings& bus : settings.ethercat_buses) names.push_back(bus.name);
  return names;
}

void read_axis_address(TableReader& reader, const LineSettings& settings, AxisSettings& axis) {
  AxisAddressReader(settings).read(reader, axis);
}

}  // namespace servodrome::line
