#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "line/traffic.hpp"
#include "tools/sniff/can_decoder.hpp"
#include "tools/sniff/ethercat_decoder.hpp"
#include "tools/sniff/modbus_tcp_decoder.hpp"
#include "tools/sniff/serial_decoder.hpp"

namespace servodrome::studio {

// Decoders that convert frames to text.
struct TrafficDecoders {
  master::CanDecoder can{};
  master::EthercatDecoder ethercat{};
  master::SerialDecoder serial{};
  master::ModbusTcpDecoder modbus_tcp{};
};

enum class Medium : std::uint8_t { can, serial, ethercat };

// A bus whose traffic can be recorded.
class TrafficSource {
 public:
  virtual ~TrafficSource() = default;
  virtual const std::string& name() const = 0;
  virtual Medium medium() const = 0;
  virtual std::unique_ptr<line::TrafficTap> tap(line::TrafficRing& ring) = 0;
  // Name of the sender on CAN and serial lines; empty: the master.
  virtual std::string sender(std::uint32_t sender) const = 0;
  // Gives the decoders the present data of the drives on the bus.
  virtual void introduce(TrafficDecoders& decoders) = 0;
};

}  // namespace servodrome::studio
