#pragma once

#include <boost/asio/io_context.hpp>

#include "links/serial/client.hpp"
#include "links/serial_rig.hpp"
#include "modbus/rtu_server.hpp"
#include "scenario/support.hpp"
#include "serial10/frame.hpp"

namespace servodrome::scenario::test {

using servodrome::test::bytes_of;
using servodrome::test::hex_of;

inline constexpr std::string_view one_rtu_axis = R"(
clock = "virtual"
[[bus]]
name = "rs"
type = "rs485"
bit_rate = 19200
format = "8E1"
[[axis]]
name = "x"
product = "generic402"
serial = "rs"
station = 1
)";
inline const std::string two_rtu_axes = std::string(one_rtu_axis) + R"(
[[axis]]
name = "y"
product = "generic402"
serial = "rs"
station = 2
)";
inline constexpr std::string_view one_serial10_axis = R"(
clock = "virtual"
[[bus]]
name = "rs"
type = "rs485"
[[axis]]
name = "x"
product = "ismk"
serial = "rs"
node = 1
)";

// A Modbus RTU frame with its CRC, in hexadecimal.
inline std::string rtu(const std::string& hex) {
  std::vector<std::uint8_t> frame = bytes_of(hex);
  const std::size_t size = frame.size();
  frame.resize(size + 2);
  modbus::seal_rtu_frame(frame, size);
  return hex_of(frame);
}

inline std::string serial10_frame(serial10::Command command, std::uint16_t index, std::uint32_t data = 0,
                                  std::uint8_t id = 1) {
  return hex_of(serial10::Frame::make(id, command, index, 0, data).bytes);
}

// An RS485 line under a scenario, and a master on it.
class SerialScene {
 public:
  explicit SerialScene(const std::string& rules, std::string_view line_text = one_rtu_axis)
      : line(line::test::settings_of(line_text)),
        bus(*line.find_serial_bus("rs")),
        master(bus.line, line),
        director(line, scenario_of(rules)) {
    director.begin();
    line.run_until(60ms);
  }

  // All characters that the master receives within the time after its request.
  std::string ask(const std::string& request, Time within = 100ms) {
    master.send(bytes_of(request));
    return heard(within);
  }
  std::string heard(Time within) {
    std::vector<std::uint8_t> bytes;
    const Time until = line.now() + within;
    while (line.now() < until) master.receive(bytes, until - line.now());
    return hex_of(bytes);
  }
  // The time from now until the last character is received.
  Time time_of(std::size_t characters) {
    std::vector<std::uint8_t> bytes;
    const Time from = line.now();
    while (bytes.size() < characters && line.now() < from + 5s) master.receive(bytes, 1ms);
    return line.now() - from;
  }
  std::int64_t object(std::uint16_t index) { return line.axes().front()->device().dictionary().number(index); }
  std::uint64_t acts(std::size_t rule = 0) const { return director.rules().at(rule).acts; }
  Time character() const { return bus.line.format().character_time(); }

  line::Line line;
  line::NamedSerialBus& bus;
  links::MemoryByteClient master;
  Director director;
};

// The same over Modbus TCP. Links run in real time, the line's time advances with each step.
class TcpScene final : public links::LineHost, public modbus::Units {
 public:
  explicit TcpScene(const std::string& rules)
      : line(line::test::settings_of(one_rtu_axis)), bus(*line.find_serial_bus("rs")) {
    bus.links.push_back(
        links::open_serial_link(links::parse_serial_link("tcp:127.0.0.1:0"), bus.line, *this, io, *this));
    director = std::make_unique<Director>(line, scenario_of(rules));
    director->begin();
  }

  Time now() override { return line.now(); }
  void wake() override {}
  modbus::Server* find(std::uint8_t unit) override { return line.find_unit(bus, unit); }

  links::test::RawClient client() const {
    const auto name = links::parse_serial_link(bus.links.front()->name());
    return links::test::RawClient::tcp(std::get<links::ModbusTcpName>(name).endpoint.port);
  }
  void step() {
    io.restart();
    io.run_one_for(1ms);
    line.run_until(line.now() + 1ms);
  }
  bool until(const std::function<bool()>& condition) {
    const auto give_up = std::chrono::steady_clock::now() + 10s;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > give_up) return false;
      step();
    }
    return true;
  }
  void pass(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) step();
  }

  boost::asio::io_context io;
  line::Line line;
  line::NamedSerialBus& bus;
  std::unique_ptr<Director> director;
};

}  // namespace servodrome::scenario::test
