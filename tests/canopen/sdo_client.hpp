#pragma once

#include <random>

#include "canopen/crc16.hpp"
#include "test_device.hpp"

// A small SDO client that can lose frames of block transfers, to test the server.
namespace servodrome::canopen::test {

using Bytes = std::vector<std::byte>;

template <typename Device>
class SdoClient {
 public:
  SdoClient(Device& device, std::uint32_t seed = 1) : device_(device), random_(seed) {}

  double loss = 0;                // probability that a segment is lost
  std::uint8_t block_size = 127;  // of uploads
  unsigned repeated_blocks = 0;

  AbortCode download_segmented(std::uint16_t index, const Bytes& bytes, bool announce) {
    Frame frame = request(announce ? 0x21 : 0x20, index);
    if (announce) put(frame, static_cast<std::uint32_t>(bytes.size()));
    if (!ask(frame)) return aborted_;
    bool toggle = false;
    std::size_t position = 0;
    do {
      const std::size_t size = std::min<std::size_t>(7, bytes.size() - position);
      const bool last = position + size == bytes.size();
      frame = request(static_cast<std::uint8_t>((toggle ? 0x10 : 0) | (7 - size) << 1 | (last ? 1 : 0)), 0);
      if (size != 0) std::memcpy(&frame.data[1], bytes.data() + position, size);
      if (!ask(frame)) return aborted_;
      EXPECT_EQ(answer_.data[0], toggle ? 0x30 : 0x20);
      toggle = !toggle;
      position += size;
    } while (position < bytes.size());
    return AbortCode::none;
  }

  Bytes upload_segmented(std::uint16_t index) {
    Bytes bytes;
    if (!ask(request(0x40, index))) return bytes;
    if ((answer_.data[0] & 0x02) != 0) {  // expedited
      append(bytes, 4, 4U - (answer_.data[0] >> 2 & 3U));
      return bytes;
    }
    std::uint32_t announced = 0;
    std::memcpy(&announced, &answer_.data[4], 4);
    for (bool toggle = false;; toggle = !toggle) {
      if (!ask(request(toggle ? 0x70 : 0x60, 0))) return {};
      append(bytes, 1, 7U - (answer_.data[0] >> 1 & 7U));
      if ((answer_.data[0] & 1) != 0) break;
    }
    EXPECT_EQ(bytes.size(), announced);
    return bytes;
  }

  AbortCode download_block(std::uint16_t index, const Bytes& bytes, bool announce, bool spoil_crc = false) {
    Frame frame = request(announce ? 0xC6 : 0xC4, index);
    if (announce) put(frame, static_cast<std::uint32_t>(bytes.size()));
    if (!ask(frame)) return aborted_;
    std::size_t position = 0;
    unsigned size = answer_.data[4];
    const std::size_t end = std::max<std::size_t>(bytes.size(), 1);
    while (position < end) {
      bool answered = false;
      bool delivered = false;
      for (unsigned sequence = 1; sequence <= size && !answered; ++sequence) {
        const std::size_t at = position + (sequence - 1) * 7;
        const bool last = at + 7 >= end;
        frame = request(static_cast<std::uint8_t>(sequence | (last ? 0x80U : 0U)), 0);
        std::fill(frame.data.begin() + 1, frame.data.end(), std::uint8_t{0});
        if (at < bytes.size())
          std::memcpy(&frame.data[1], bytes.data() + at, std::min<std::size_t>(7, bytes.size() - at));
        if (!lost()) {
          answered = give(frame);
          delivered = true;
        }
        if (answered && answer_.data[0] == 0x80) return aborted_;
        if (last) break;
      }
      if (!delivered) continue;  // the server cannot know of this sub-block: all of it is repeated
      if (!answered && !wait()) return AbortCode::protocol_timed_out;
      if (answer_.data[0] == 0x80) return aborted_;
      EXPECT_EQ(answer_.data[0], 0xA2);
      if (answer_.data[1] < size && position + answer_.data[1] * 7U < end) ++repeated_blocks;
      position += answer_.data[1] * 7U;
      size = answer_.data[2];
    }
    const std::size_t unused = position - bytes.size();
    const auto crc = static_cast<std::uint16_t>(crc16(bytes) ^ (spoil_crc ? 1 : 0));
    frame = request(static_cast<std::uint8_t>(0xC1 | unused << 2), 0);
    frame.data[1] = static_cast<std::uint8_t>(crc);
    frame.data[2] = static_cast<std::uint8_t>(crc >> 8);
    return ask(frame) ? AbortCode::none : aborted_;
  }

  Bytes upload_block(std::uint16_t index) {
    Bytes bytes;
    Frame frame = request(0xA4, index);
    frame.data[4] = block_size;
    if (!ask(frame)) return bytes;
    std::uint32_t announced = 0;
    std::memcpy(&announced, &answer_.data[4], 4);
    device_.node.receive(request(0xA3, 0), device_.now);
    for (bool complete = false; !complete;) {
      std::uint8_t good = 0;
      Frame segment;
      while (device_.node.take(segment)) {
        if (lost()) continue;
        if ((segment.data[0] & 0x7F) != good + 1 || complete) continue;
        ++good;
        answer_ = segment;
        append(bytes, 1, 7);
        complete = (segment.data[0] & 0x80) != 0;
      }
      if (!complete && good < block_size) ++repeated_blocks;
      block_size = static_cast<std::uint8_t>(1 + random_() % 127);  // the block size may change each time
      frame = request(0xA2, 0);
      frame.data[1] = good;
      frame.data[2] = block_size;
      device_.node.receive(frame, device_.now);
    }
    if (!device_.node.take(answer_)) ADD_FAILURE() << "no end of the block upload";
    EXPECT_EQ(answer_.data[0] & 0xE3, 0xC1);
    for (unsigned padding = answer_.data[0] >> 2 & 7U; padding > 0 && !bytes.empty(); --padding) bytes.pop_back();
    EXPECT_EQ(bytes.size(), announced);
    EXPECT_EQ(crc16(bytes), answer_.data[1] | answer_.data[2] << 8);
    device_.node.receive(request(0xA1, 0), device_.now);
    return bytes;
  }

  AbortCode aborted() const { return aborted_; }

 private:
  Frame request(std::uint8_t command, std::uint16_t index) const {
    Frame frame;
    frame.id = 0x600U + device_.node.node_id();
    frame.length = 8;
    frame.data[0] = command;
    frame.data[1] = static_cast<std::uint8_t>(index);
    frame.data[2] = static_cast<std::uint8_t>(index >> 8);
    return frame;
  }
  static void put(Frame& frame, std::uint32_t value) { std::memcpy(&frame.data[4], &value, 4); }
  void append(Bytes& bytes, std::size_t from, std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) bytes.push_back(std::byte{answer_.data[from + i]});
  }
  bool lost() { return loss > 0 && static_cast<double>(random_() % 10000) < loss * 10000; }
  // Passes the frame to the server; true if there was an answer.
  bool give(const Frame& frame) {
    device_.node.receive(frame, device_.now);
    return collect();
  }
  bool collect() {
    if (!device_.node.take(answer_)) return false;
    if (answer_.data[0] == 0x80) {
      std::uint32_t code = 0;
      std::memcpy(&code, &answer_.data[4], 4);
      aborted_ = static_cast<AbortCode>(code);
    }
    return true;
  }
  bool ask(const Frame& frame) {
    if (!give(frame)) {
      ADD_FAILURE() << "no answer to " << text_of(frame);
      return false;
    }
    return answer_.data[0] != 0x80;
  }
  // After half the server's timeout, and at most half a second, it requests the missing segments.
  bool wait() {
    device_.now += std::min<Time>(device_.profile.sdo_timeout / 2, 500ms);
    device_.node.poll(device_.now);
    return collect();
  }

  Device& device_;
  std::minstd_rand random_;
  Frame answer_;
  AbortCode aborted_ = AbortCode::none;
};

}  // namespace servodrome::canopen::test
