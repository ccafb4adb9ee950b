#pragma once

#include <cstring>
#include <memory>
#include <vector>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/segment.hpp"

// Slave controllers in line, set up for 16 bytes of process data in each direction, and the frames of a cycle. The
// frames are composed once, as a master sends them, and copied in each cycle to the buffer in which a link receives
// frames.
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
    for (std::size_t first = 0; first < count; first += slaves_per_datagram) {
      FrameWriter writer = FrameWriter::ethernet(memory);
      const std::size_t data = 32 * std::min(slaves_per_datagram, count - first);
      writer.add(Command::lrw, 0, static_cast<std::uint32_t>(32 * first), data);
      if (first == 0) writer.add(Command::brd, 0, address_of(0, reg::al_status), 2);
      sent.emplace_back(writer.bytes().begin(), writer.bytes().end());
    }
  }

  // The minimum that a slave's application does with its buffers.
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

  // Returns the sum of the working counters of all LRWs and of the BRD at the end of the first frame.
  unsigned cycle() {
    unsigned counters = 0;
    for (const std::vector<std::uint8_t>& frame : sent) {
      std::memcpy(memory.data(), frame.data(), frame.size());
      now += std::chrono::milliseconds(1);
      segment->process(std::span(memory).first(frame.size()), now);
      const std::size_t lrw = 16 + datagram_header_size + (load_u16(&memory[22]) & length_mask);
      counters += load_u16(&memory[lrw]);
      if (lrw + 2 != frame.size()) counters += load_u16(&memory[frame.size() - 2]);
    }
    return counters;
  }

  Time now{0};
  std::array<std::uint8_t, max_frame> memory;
  std::vector<std::unique_ptr<Esc>> escs;
  std::vector<Segment::Slave> slaves;
  std::vector<std::vector<std::uint8_t>> sent;
  std::unique_ptr<Segment> segment;
};

}  // namespace servodrome::ethercat
