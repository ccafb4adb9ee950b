#include "links/local_buses.hpp"

#include <algorithm>
#include <array>
#include <windows.h>

#include "links/link_scheme.hpp"

namespace servodrome::links {

// The registry lists the serial ports: a driver's device, such as \Device\Serial0, and the name of its port. CAN
// interfaces and network cards have no links on Windows.
std::vector<LocalBus> local_buses(const std::filesystem::path& /*root*/) {
  std::vector<LocalBus> buses;
  HKEY ports = nullptr;
  if (::RegOpenKeyExA(HKEY_LOCAL_MACHINE, "HARDWARE\\DEVICEMAP\\SERIALCOMM", 0, KEY_READ, &ports) != ERROR_SUCCESS) {
    return buses;
  }
  for (DWORD index = 0;; ++index) {
    std::array<char, 256> device{};
    std::array<char, 256> port{};
    auto device_size = static_cast<DWORD>(device.size());
    auto port_size = static_cast<DWORD>(port.size() - 1);  // the registry need not end a text with a zero
    DWORD type = 0;
    if (::RegEnumValueA(ports, index, device.data(), &device_size, nullptr, &type, reinterpret_cast<BYTE*>(port.data()),
                        &port_size) != ERROR_SUCCESS) {
      break;
    }
    if (type != REG_SZ) continue;
    buses.push_back({LocalBus::Kind::serial, scheme::serial.with(port.data()), {}, device.data()});
  }
  ::RegCloseKey(ports);
  std::sort(buses.begin(), buses.end(),
            [](const LocalBus& left, const LocalBus& right) { return left.link < right.link; });
  return buses;
}

}  // namespace servodrome::links
