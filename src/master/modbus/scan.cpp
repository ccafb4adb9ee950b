#include "master/modbus/scan.hpp"

namespace servodrome::master {

std::vector<FoundStation> scan_stations(ModbusClient& client, std::uint8_t first, std::uint8_t last) {
  std::vector<FoundStation> stations;
  for (unsigned unit = first; unit <= last; ++unit) {
    FoundStation station{.unit = static_cast<std::uint8_t>(unit)};
    try {
      station.identification = client.read_device_identification(station.unit);
    } catch (const ModbusError& error) {
      const bool unreachable = error.exception() == modbus::Exception::gateway_path_unavailable ||
                               error.exception() == modbus::Exception::gateway_target_failed_to_respond;
      if (error.kind() != ModbusError::Kind::refused || unreachable) continue;
    }
    stations.push_back(std::move(station));
  }
  return stations;
}

}  // namespace servodrome::master
