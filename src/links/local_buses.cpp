#include "links/local_buses.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>

#include "links/link_scheme.hpp"

namespace servodrome::links {
namespace {

namespace fs = std::filesystem;

// ARPHRD_ values of <linux/if_arp.h>, in the format of sysfs.
constexpr const char* arphrd_ether = "1";
constexpr const char* arphrd_can = "280";

std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> entries;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    entries.push_back(entry->path());
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

// Returns "down" if the interface is not configured. A card that is up but not connected has "0" in `carrier`.
std::string state_of(const fs::path& interface) {
  constexpr unsigned long iff_up = 1;
  const std::string flags = first_line(interface / "flags");
  char* end = nullptr;
  if ((std::strtoul(flags.c_str(), &end, 16) & iff_up) == 0) return "down";
  return first_line(interface / "carrier") == "0" ? "no cable" : "up";
}

void add_interfaces(const fs::path& root, std::vector<LocalBus>& buses) {
  for (const fs::path& interface : entries_of(root / "sys/class/net")) {
    const std::string type = first_line(interface / "type");
    const std::string name = interface.filename().string();
    if (type == arphrd_can) {
      buses.push_back({LocalBus::Kind::can, scheme::socketcan.with(name), state_of(interface), {}});
    } else if (type == arphrd_ether && !fs::exists(interface / "bridge") && !fs::exists(interface / "wireless")) {
      buses.push_back({LocalBus::Kind::ethernet, scheme::raw.with(name), state_of(interface), {}});
    }
  }
}

// Terminals without hardware have no `device`. Unused ttyS entries of the system have type 0.
void add_serial_ports(const fs::path& root, std::vector<LocalBus>& buses) {
  std::map<std::string, std::string> adapters;
  for (const fs::path& link : entries_of(root / "dev/serial/by-id")) {
    std::error_code error;
    const fs::path device = fs::read_symlink(link, error);
    if (!error) adapters[device.filename().string()] = link.filename().string();
  }
  for (const fs::path& tty : entries_of(root / "sys/class/tty")) {
    const std::string name = tty.filename().string();
    if (!fs::exists(tty / "device") || !fs::exists(root / "dev" / name) || first_line(tty / "type") == "0") continue;
    buses.push_back({LocalBus::Kind::serial, scheme::serial.with("/dev/" + name), {}, adapters[name]});
  }
}

}  // namespace

std::vector<LocalBus> local_buses(const std::filesystem::path& root) {
  std::vector<LocalBus> buses;
  add_interfaces(root, buses);
  add_serial_ports(root, buses);
  std::stable_sort(buses.begin(), buses.end(),
                   [](const LocalBus& left, const LocalBus& right) { return left.kind < right.kind; });
  return buses;
}

}  // namespace servodrome::links
