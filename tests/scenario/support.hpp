#pragma once

#include <gtest/gtest.h>

#include "drive/drive.hpp"
#include "line/support.hpp"
#include "scenario/director.hpp"
#include "scenario/parse.hpp"

namespace servodrome::scenario::test {

using namespace std::chrono_literals;

inline constexpr std::string_view one_axis = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "generic402"
node = 1
)";

inline Scenario scenario_of(const std::string& text) {
  ScenarioFile file = parse_scenario("title = \"test\"\n" + text, "test.toml");
  for (const line::Diagnostic& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
  return std::move(file.scenario);
}

// A line under a scenario, and a master at its CAN bus.
class Stage {
 public:
  explicit Stage(const std::string& rules, std::string_view line_text = one_axis)
      : Stage(scenario_of(rules), line_text) {}
  explicit Stage(Scenario scenario, std::string_view line_text = one_axis)
      : line(line::test::settings_of(line_text)), port(line.buses().front()->bus), director(line, std::move(scenario)) {
    director.begin();
  }

  void run(Time time) { line.run_until(line.now() + time); }
  void send(const canopen::Frame& frame) { port.send(frame, line.now()); }

  // Sends a request and returns all frames with this identifier that come within the time.
  std::vector<canopen::Frame> answers(const canopen::Frame& request, std::uint32_t id, Time within = 20ms) {
    while (port.receive()) {
    }
    send(request);
    run(within);
    return received(id);
  }
  std::vector<canopen::Frame> sdo(const canopen::Frame& request, Time within = 20ms) {
    return answers(request, 0x581, within);
  }
  std::uint32_t read(std::uint16_t index, std::uint8_t sub = 0) {
    const auto frames = sdo(line::test::sdo_read(1, index, sub));
    return frames.size() == 1 ? line::test::number_in(frames.front()) : 0xDEADU;
  }
  void write(std::uint16_t index, std::uint32_t value, unsigned size, std::uint8_t sub = 0) {
    sdo(line::test::sdo_write(1, index, sub, value, size));
  }
  std::vector<canopen::Frame> received(std::uint32_t id) {
    std::vector<canopen::Frame> frames;
    while (const auto frame = port.receive()) {
      if (frame->frame.id == id) frames.push_back(frame->frame);
    }
    return frames;
  }
  line::Axis& x() { return *line.axes().front(); }
  links::ErrorState error_state() { return line.buses().front()->bus.error_state(x().port()); }
  drive::PowerState state() { return x().device().drive().state(); }
  void enable(std::uint32_t mode = 3) {
    write(0x6060, mode, 1);
    for (const std::uint32_t word : {0x06U, 0x07U, 0x0FU}) {
      write(0x6040, word, 2);
      run(200ms);
    }
  }

  line::Line line;
  links::MemoryPort port;
  Director director;
};

}  // namespace servodrome::scenario::test
