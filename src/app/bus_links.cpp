#include "app/bus_links.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands.hpp"
#include "links/can/link_name.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"
#include "links/nearest_name.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::app {
namespace {

// The links by which masters reach a bus, and the parser for links of its kind.
struct Reach {
  std::string_view name;
  std::vector<std::string>* links;
  void (*parse)(const std::string& link);  // throws LinkError for a link of another kind
  bool cleared = false;

  // Describes why the link does not fit this kind of bus; empty if it fits.
  std::string problem(const std::string& link) const {
    try {
      parse(link);
      return {};
    } catch (const links::LinkError& error) {
      return error.what();
    }
  }
};

// The bus of `--bus NAME=LINK`, or of `--bus LINK` if the line has only one bus of the link's kind.
Reach& bus_of(std::vector<Reach>& buses, const std::string& option, const std::string& name, const std::string& link) {
  std::vector<std::string_view> names;
  std::vector<Reach*> found;
  for (Reach& bus : buses) {
    names.push_back(bus.name);
    if (name.empty() ? buses.size() == 1 || bus.problem(link).empty() : bus.name == name) found.push_back(&bus);
  }
  if (!name.empty() && found.empty()) {
    throw Failure::wrong_use(
        fmt::format("--bus {}: there is no bus \"{}\"; {}", option, name, links::suggestion(name, names)));
  }
  if (found.size() > 1) {
    throw Failure::wrong_use(fmt::format("--bus {}: the line has {} buses; write --bus NAME=LINK with one of {}",
                                         option, buses.size(), fmt::join(names, ", ")));
  }
  Reach& bus = found.empty() ? buses.front() : *found.front();
  if (const std::string problem = bus.problem(link); !problem.empty()) {
    throw Failure::wrong_use(fmt::format("--bus {}: {}", option, problem));
  }
  return bus;
}

}  // namespace

void override_links(line::LineSettings& settings, const std::vector<std::string>& options) {
  std::vector<Reach> buses;
  for (line::BusSettings& bus : settings.buses) {
    buses.push_back({bus.name, &bus.links, [](const std::string& link) { links::parse_can_link(link); }});
  }
  for (line::SerialBusSettings& bus : settings.serial_buses) {
    buses.push_back({bus.name, &bus.links, [](const std::string& link) { links::parse_serial_link(link); }});
  }
  for (line::EthercatBusSettings& bus : settings.ethercat_buses) {
    buses.push_back({bus.name, &bus.links, [](const std::string& link) { links::parse_ethercat_link(link); }});
  }
  for (const std::string& option : options) {
    // In a link, a colon comes before any equals sign.
    const std::size_t equals = option.find('=');
    const bool named = equals < option.find(':');
    const std::string link = named ? option.substr(equals + 1) : option;
    Reach& bus = bus_of(buses, option, named ? option.substr(0, equals) : "", link);
    if (!bus.cleared) bus.links->clear();
    bus.cleared = true;
    if (std::find(bus.links->begin(), bus.links->end(), link) != bus.links->end()) {
      throw Failure::wrong_use(fmt::format("--bus {}: the link is given twice; give it once", option));
    }
    bus.links->push_back(link);
  }
}

}  // namespace servodrome::app
