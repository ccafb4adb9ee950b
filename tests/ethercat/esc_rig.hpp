#pragma once

#include <gtest/gtest.h>
#include <memory>
#include <numeric>
#include <vector>

#include "ethercat/esc/esc.hpp"
#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/segment.hpp"

// Slave controllers in line, and a master that sends one datagram at a time, in virtual time.
namespace servodrome::ethercat::test {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

inline Bytes words(std::initializer_list<unsigned> values) {
  Bytes bytes;
  for (const unsigned value : values) {
    bytes.push_back(static_cast<std::uint8_t>(value));
    bytes.push_back(static_cast<std::uint8_t>(value >> 8));
  }
  return bytes;
}

template <typename T>
Bytes bytes_of(T value) {
  Bytes bytes(sizeof value);
  store(bytes.data(), value);
  return bytes;
}

// The shortest possible slave information: the configuration area with its checksum.
inline std::vector<std::uint8_t> plain_sii() {
  std::vector<std::uint8_t> image(64, 0);
  image[0] = 0x08;  // PDI: 16-bit processor
  image[1] = 0x0E;
  image[8] = 0x34;  // alias 1234h
  image[9] = 0x12;
  image[14] = sii_checksum(std::span(image).first(14));
  return image;
}

struct Answer {
  Segment::Exit exit = Segment::Exit::lost;
  Bytes data;
  unsigned counter = 0;
  std::uint16_t position = 0;
  std::uint16_t interrupt = 0;
  bool circulating = false;
};

class Line {
 public:
  explicit Line(std::size_t count, Time hop = Time{0}, SiiInterface::Timing timing = {}) : sii(count, plain_sii()) {
    for (std::size_t i = 0; i < count; ++i) {
      escs.push_back(std::make_unique<Esc>(sii[i], timing));
      slaves.push_back({.esc = escs.back().get(), .forward = hop, .backward = hop});
    }
    segment = std::make_unique<Segment>(slaves);
    for (auto& esc : escs) esc->power_on(now);
  }

  Answer send(Command command, std::uint32_t address, const Bytes& data, Segment::Port port = Segment::Port::primary) {
    std::array<std::uint8_t, max_frame> memory;
    FrameWriter writer = FrameWriter::ethernet(memory);
    const std::span<std::uint8_t> place = writer.add(command, 0x55, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    Answer answer;
    answer.exit = segment->process(writer.bytes(), now, port).exit;
    Frame frame;
    parse_ethernet(writer.bytes(), frame);
    const Datagram& datagram = frame.datagrams()[0];
    answer.data.assign(datagram.data(), datagram.data() + datagram.length);
    answer.counter = datagram.working_counter();
    answer.position = datagram.position();
    answer.interrupt = datagram.interrupt();
    answer.circulating = datagram.circulating();
    return answer;
  }

  // Reads and writes the slave at `position`, which must answer.
  Answer write(std::size_t position, std::uint16_t offset, const Bytes& data) {
    return send(Command::apwr, address_of(static_cast<std::uint16_t>(0U - position), offset), data);
  }
  Answer read(std::size_t position, std::uint16_t offset, std::size_t length) {
    return send(Command::aprd, address_of(static_cast<std::uint16_t>(0U - position), offset), Bytes(length));
  }
  template <typename T>
  T get(std::size_t position, std::uint16_t offset) {
    const Answer answer = read(position, offset, sizeof(T));
    EXPECT_EQ(answer.counter, 1U);
    return load<T>(answer.data.data());
  }
  template <typename T>
  void put(std::size_t position, std::uint16_t offset, T value) {
    EXPECT_EQ(write(position, offset, bytes_of(value)).counter, 1U);
  }

  void set_sync_manager(std::size_t position, unsigned n, unsigned start, unsigned length, unsigned control) {
    const Bytes settings = words({start, length, control, 1});
    EXPECT_EQ(write(position, static_cast<std::uint16_t>(reg::sync_manager + 8 * n), settings).counter, 1U);
  }
  void set_fmmu(std::size_t position, unsigned n, std::uint32_t logical, unsigned length, unsigned physical,
                unsigned type, unsigned first_bit = 0, unsigned last_bit = 7, unsigned physical_bit = 0) {
    Bytes settings(16);
    store_u32(&settings[0], logical);
    store_u16(&settings[4], length);
    settings[6] = static_cast<std::uint8_t>(first_bit);
    settings[7] = static_cast<std::uint8_t>(last_bit);
    store_u16(&settings[8], physical);
    settings[10] = static_cast<std::uint8_t>(physical_bit);
    settings[11] = static_cast<std::uint8_t>(type);
    settings[12] = 1;
    EXPECT_EQ(write(position, static_cast<std::uint16_t>(reg::fmmu + 16 * n), settings).counter, 1U);
  }

  Time now{1'000'000};
  std::vector<std::vector<std::uint8_t>> sii;
  std::vector<std::unique_ptr<Esc>> escs;
  std::vector<Segment::Slave> slaves;
  std::unique_ptr<Segment> segment;
};

inline Bytes counting(std::size_t length, std::uint8_t first = 1) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), first);
  return bytes;
}

}  // namespace servodrome::ethercat::test
