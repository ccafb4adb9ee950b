#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drive/loops/motor_data.hpp"
#include "links/time.hpp"
#include "modbus/character_format.hpp"
#include "plant/parameters.hpp"
#include "products/serial_port.hpp"

// The settings of a line, after the line file was read and checked.
namespace servodrome::line {

struct Product;

enum class ClockMode : std::uint8_t { real, virtual_time };

// A CAN bus.
struct BusSettings {
  std::string name;
  std::uint32_t bit_rate = 1'000'000;  // bit/s
  bool ideal = false;                  // frames take no time: links::BusConfig::ideal
  std::vector<std::string> links;      // as links::parse_can_link reads them; empty: masters in this process only
};

// An RS485 line.
struct SerialBusSettings {
  std::string name;
  modbus::CharacterFormat format{.bit_rate = 115200, .parity = modbus::Parity::none};
  links::Time silence{};           // products::SerialSettings::silence of its drives
  std::vector<std::string> links;  // as links::parse_serial_link reads them
};

// An EtherCAT segment; its slaves are connected in the order of the axes.
struct EthercatBusSettings {
  std::string name;
  std::vector<std::string> links;  // as links::parse_ethercat_link reads them
};

// The settings of an axis on an EtherCAT segment.
struct AxisEthercatSettings {
  std::size_t bus = 0;                            // index into LineSettings::ethercat_buses
  std::uint16_t alias = 0;                        // configured station alias; 0: none
  double oscillator_ppm = 0;                      // deviation of its clock
  std::optional<std::uint16_t> sync_error_limit;  // 10F1h:02 at power-on; none: the product's value
  links::Time cable{};                            // delay of a signal on the cable in front of it
};

// The settings of an axis on an RS485 line.
struct AxisSerialSettings {
  std::size_t bus = 0;       // index into LineSettings::serial_buses
  std::uint8_t station = 0;  // 0: the product's factory value
  std::optional<products::SerialProtocol> protocol;
};

// An axis has at least one bus: one fieldbus, an RS485 line or both.
struct AxisSettings {
  std::string name;
  const Product* product = nullptr;
  std::shared_ptr<const Product> described;  // owns `product` if it comes from a maker's description
  std::string model;                         // name of one of the product's models; empty: its default, if it has any
  std::optional<std::size_t> bus;            // index into LineSettings::buses: a CAN bus
  std::uint8_t node_id = 0;                  // 0: the product's factory value
  std::uint32_t bit_rate = 0;                // bit/s; 0: the bit rate of the bus
  std::optional<AxisEthercatSettings> ethercat;
  std::optional<AxisSerialSettings> serial;
  std::uint32_t serial_number = 1;  // 1018h:04
  std::string store;                // file of the non-volatile memory; empty: in memory, until the line ends
  plant::Parameters plant;
  drive::MotorData motor_data;  // the motor parameters set in the drive; they may differ from the real motor
};

// Two axes whose loads are coupled.
struct CouplingSettings {
  std::array<std::size_t, 2> axes{};  // indices into LineSettings::axes
  plant::CouplingParameters parameters;
};

struct ApiSettings {
  bool enabled = true;
  std::string address = "127.0.0.1";
  std::uint16_t port = 8402;  // 0: the system chooses
  std::string page{};         // folder of the studio's page; empty: no page
};

struct LineSettings {
  ClockMode clock = ClockMode::real;
  ApiSettings api;
  std::vector<BusSettings> buses;
  std::vector<SerialBusSettings> serial_buses;
  std::vector<EthercatBusSettings> ethercat_buses;
  std::vector<AxisSettings> axes;
  std::vector<CouplingSettings> couplings;  // an axis is part of one at most
};

// Returns the motor parameters of a drive that is set correctly for the motor in `parameters`.
drive::MotorData motor_data_of(const plant::Parameters& parameters);

// Reads "ADDRESS:PORT" or "[IPV6]:PORT" into `api`. Returns a description of the error, empty if there is none.
std::string parse_api_address(std::string_view text, ApiSettings& api);

}  // namespace servodrome::line
