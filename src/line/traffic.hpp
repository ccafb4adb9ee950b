#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "line/line.hpp"

// Records what passes on a bus, to be read later.
namespace servodrome::line {

enum class TrafficKind : std::uint8_t {
  can,           // `bytes` is a canopen::Frame, `sender` the port
  can_dropped,   // the same, withheld by a disturbance
  can_error,     // the same, broken by an error frame
  ethernet_out,  // an Ethernet frame of EtherCAT as the master sent it
  ethernet_in,   // an Ethernet frame of EtherCAT as it came back
  serial,        // characters of an RS485 line, `sender` the port
  modbus_tcp,    // a message of Modbus TCP
};

struct TrafficFrame {
  std::uint64_t number = 0;  // counts all frames during the recording, from 1 on
  Time at{};
  TrafficKind kind{};
  bool from_master = false;  // RS485 lines and EtherCAT only
  std::uint32_t sender = 0;
  std::span<const std::uint8_t> bytes;  // valid until the next frame is added
};

// A ring buffer of frames in a fixed amount of memory. New frames overwrite the oldest ones.
class TrafficRing {
 public:
  explicit TrafficRing(std::size_t bytes) : memory_(bytes / alignment * alignment) {}

  // Adds a frame and gives it its number; `frame.number` and `frame.bytes` are ignored. The bytes are `head` followed
  // by `rest`, so that the caller need not join them. A frame that does not fit into the ring is not recorded.
  void add(const TrafficFrame& frame, std::span<const std::uint8_t> head, std::span<const std::uint8_t> rest);

  std::uint64_t newest() const { return newest_; }  // number of the newest frame; 0: there is none
  std::uint64_t oldest() const { return oldest_; }

  // A reader's position in the ring: the next frame to read.
  struct Cursor {
    std::uint64_t number = 0;
    std::size_t offset = 0;
  };
  Cursor begin() const { return {oldest_, first_}; }
  // Removes all frames. Returns the position of the next frame that will be added.
  Cursor clear() {
    first_ = end_ = 0;
    oldest_ = newest_ + 1;
    return begin();
  }
  // Returns the frame at the cursor and moves the cursor on, or returns nothing if there is no such frame yet. If the
  // frame has been overwritten, the cursor jumps to the oldest one; the frame's number shows the gap.
  std::optional<TrafficFrame> next(Cursor& cursor) const;

 private:
  static constexpr std::size_t alignment = 8;
  struct Header {
    std::int64_t at;
    std::uint32_t sender;
    std::uint16_t length;
    TrafficKind kind;
    bool from_master;
  };
  static_assert(sizeof(Header) == 16);
  static constexpr std::uint16_t wrap = 0xFFFF;  // as a length: the next frame is at the beginning

  static std::size_t size_of(std::size_t length) {
    return sizeof(Header) + (length + alignment - 1) / alignment * alignment;
  }
  Header header_at(std::size_t offset) const;
  std::size_t behind(std::size_t offset) const;
  void forget_oldest();

  std::vector<std::uint8_t> memory_;
  std::size_t first_ = 0;  // offset of the oldest frame
  std::size_t end_ = 0;    // offset behind the newest frame
  std::uint64_t oldest_ = 1;
  std::uint64_t newest_ = 0;
};

// Records a bus from construction to destruction. Nothing is allocated in between.
class TrafficTap {
 public:
  virtual ~TrafficTap() = default;
  // Records the message whose characters are still being joined, if the pause after it shows that it is complete.
  virtual void flush() {}

  static std::unique_ptr<TrafficTap> on(NamedBus& bus, TrafficRing& ring);
  static std::unique_ptr<TrafficTap> on(NamedEthercatBus& bus, TrafficRing& ring);
  static std::unique_ptr<TrafficTap> on(NamedSerialBus& bus, TrafficRing& ring);
};

}  // namespace servodrome::line
