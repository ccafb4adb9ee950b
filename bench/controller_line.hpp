#pragma once

#include <memory>
#include <vector>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/segment.hpp"

// Slave controllers in line, set up for 16 bytes of process data each way, and the frames of a cycle through them.
namespace servodrome::ethercat {

inline constexpr std::size_t slaves_per_datagram = 46;  // 32 bytes each

struct ControllerLine {
  explicit ControllerLine(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      escs.push_back(std::make_unique<Esc>(std::span<std::uint8_t>{}));
      slaves.push_back({.esc = escs.back().get(), .forward = Time{500}, .backward = Time{500}});
    }
    segment = std::make_unique<Segment>(slaves);
    for (std::size_t i = 0; i < count; ++i) {
      escs[i]->power_on(Time{0});
      const auto position = static_cast<std::uint16_t>(0U - i);
      const auto logical = static_cast<std::uint32_t>(32 * i);
      write(address_of(position, 0x0810), {0x00, 0x11, 16, 0, 0x64, 0, 1, 0});
      write(address_of(position, 0x0818), {0x80, 0x11, 16, 0, 0x20, 0, 1, 0});
      for (std::uint8_t n = 0; n < 2; ++n) {
        std::vector<std::uint8_t> fmmu{0, 0, 0, 0, 16, 0, 0, 7, 0x00, 0x11, 0, 2, 1, 0, 0, 0};
        store_u32(fmmu.data(), logical + 16U * n);
        if (n == 1) fmmu[8] = 0x80, fmmu[11] = 1;
        write(address_of(position, static_cast<std::uint16_t>(0x0600 + 16 * n)), fmmu);
      }
      exchange(*escs[i]);
    }
  }

  // What the application of a slave does with its buffers, at the least.
  static void exchange(Esc& esc) {
    if (!esc.open_for_reading(2).empty()) esc.close_reading(2);
    esc.open_for_writing(3);
    esc.close_writing(3);
  }

  void write(std::uint32_t address, const std::vector<std::uint8_t>& data) {
    FrameWriter writer = FrameWriter::ethernet(memory);
    const auto place = writer.add(Command::apwr, 0, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    segment->process(writer.bytes(), now);
  }

  // Returns the sum of the working counters.
  unsigned cycle() {
    unsigned counters = 0;
    for (std::size_t first = 0; first < slaves.size(); first += slaves_per_datagram) {
      const std::size_t count = std::min(slaves_per_datagram, slaves.size() - first);
      FrameWriter writer = FrameWriter::ethernet(memory);
      const auto data = writer.add(Command::lrw, 0, static_cast<std::uint32_t>(32 * first), 32 * count);
      const auto status = first == 0 ? writer.add(Command::brd, 0, address_of(0, reg::al_status), 2) : data.first(0);
      now += std::chrono::milliseconds(1);
      segment->process(writer.bytes(), now);
      counters += load_u16(data.data() + data.size()) + (first == 0 ? load_u16(status.data() + 2) : 0U);
    }
    return counters;
  }

  Time now{0};
  std::array<std::uint8_t, max_frame> memory;
  std::vector<std::unique_ptr<Esc>> escs;
  std::vector<Segment::Slave> slaves;
  std::unique_ptr<Segment> segment;
};

}  // namespace servodrome::ethercat
