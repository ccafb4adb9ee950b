#pragma once

#include <string>
#include <vector>

#include "ethercat/slave/slave.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/operation.hpp"

// A line of generic402-ec drives in virtual time, their master in the same process, and the frames of one cycle, which
// the bench sends repeatedly without the master.
namespace servodrome::bench {

// `ideal`: no noise, offsets or other imperfections of power stages and sensors.
inline line::Line make_drive_line(std::size_t slaves, bool ideal = false) {
  std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"ecat\"\ntype = \"ethercat\"\n";
  for (std::size_t i = 1; i <= slaves; ++i) {
    text += "[[axis]]\nname = \"a" + std::to_string(i) + "\"\nproduct = \"generic402-ec\"\n";
    if (ideal) text += "ideal = true\n";
  }
  return line::Line(line::parse_line_file(text, "bench", line::all_products()).settings);
}

// The frames of the last cycle, as the master sent them.
struct Cycle final : links::EthercatObserver {
  void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation, Direction direction,
                links::Time at) override {
    if (direction != Direction::in) return;
    if (at != time) frames.clear();
    time = at;
    frames.emplace_back(bytes.begin(), bytes.end());
  }
  // Passes frames like a line in real time.
  void exchange(line::Line& line, links::Time at) {
    links::EthercatBus& bus = line.ethercat_buses().front()->bus;
    line.keep_up(at);
    for (auto& frame : frames) {
      bus.pass(frame, at, links::EthercatBus::Port::primary, links::EthercatBus::Encapsulation::payload);
      bus.settle(at);
    }
  }
  std::vector<std::vector<std::uint8_t>> frames;
  links::Time time{};
};

}  // namespace servodrome::bench
