#pragma once

#include <array>
#include <cstring>
#include <fmt/format.h>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "line/line.hpp"
#include "line/line_file.hpp"
#include "links/can/memory_port.hpp"

namespace servodrome::line::test {

using namespace std::chrono_literals;

inline constexpr std::string_view two_axes = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "left"
product = "ismc"
node = 1
  [axis.travel]
  negative_limit = -1000000
  positive_limit = 1000000
  home = { from = -5000, to = 5000 }
[[axis]]
name = "right"
product = "generic402"
node = 2
)";

// The same with an RS485 line for the second.
inline const std::string two_axes_and_rs485 = std::string(two_axes) + R"(
bus = "can0"
serial = "rs"
[[bus]]
name = "rs"
type = "rs485"
)";

inline LineSettings settings_of(std::string_view text, std::span<const Product> products = all_products()) {
  LineFile file = parse_line_file(text, "test.toml", products);
  if (!file.diagnostics.empty()) throw std::runtime_error(to_string(file.diagnostics.front()));
  return std::move(file.settings);
}

// Every frame of a bus with its times, for comparisons.
class Recorder final : public links::BusObserver {
 public:
  explicit Recorder(links::CanBus& bus) : bus_(bus) { bus_.add_observer(*this); }
  ~Recorder() override { bus_.remove_observer(*this); }
  void on_bus_event(const links::BusEvent& event) override { events.push_back(event); }

  std::string text() const {
    std::string result;
    for (const links::BusEvent& event : events) {
      result += fmt::format("{} {} {:03X}#", event.start.count(), event.end.count(), event.frame.id);
      for (unsigned i = 0; i < event.frame.length; ++i) result += fmt::format("{:02X}", event.frame.data[i]);
      result += '\n';
    }
    return result;
  }

  std::vector<links::BusEvent> events;

 private:
  links::CanBus& bus_;
};

// A master's end of an SDO, expedited transfers only.
inline canopen::Frame sdo_write(std::uint8_t node, std::uint16_t index, std::uint8_t sub, std::uint32_t value,
                                unsigned size) {
  canopen::Frame frame;
  frame.id = 0x600U + node;
  frame.length = 8;
  frame.data[0] = static_cast<std::uint8_t>(0x23U | (4 - size) << 2U);
  frame.data[1] = static_cast<std::uint8_t>(index);
  frame.data[2] = static_cast<std::uint8_t>(index >> 8U);
  frame.data[3] = sub;
  std::memcpy(&frame.data[4], &value, sizeof value);
  return frame;
}

inline canopen::Frame sdo_read(std::uint8_t node, std::uint16_t index, std::uint8_t sub) {
  canopen::Frame frame = sdo_write(node, index, sub, 0, 4);
  frame.data[0] = 0x40;
  return frame;
}

inline canopen::Frame nmt(std::uint8_t command, std::uint8_t node) {
  canopen::Frame frame;
  frame.length = 2;
  frame.data[0] = command;
  frame.data[1] = node;
  return frame;
}

inline std::uint32_t number_in(const canopen::Frame& frame) {
  std::uint32_t value = 0;
  std::memcpy(&value, &frame.data[4], sizeof value);
  return value;
}

}  // namespace servodrome::line::test
