#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "line/line.hpp"

// What passed on a bus, kept to be read later.
namespace servodrome::line {

enum class TrafficKind : std::uint8_t {
  can,           // `bytes` is a canopen::Frame, `sender` the port
  can_dropped,   // the same, withheld by a disturbance
  can_error,     // the same, broken by an error frame
  ethernet_out,  // an Ethernet frame of EtherCAT as the master sent it
  ethernet_in,   // as it came back
  serial,        // characters of an RS485 line, `sender` the port
  modbus_tcp,    // a message of Modbus TCP
};

struct TrafficFrame {
  std::uint64_t number = 0;  // of all that passed while it was recorded, from 1 on
  Time at{};
  TrafficKind kind{};
  bool from_master = false;  // of RS485 lines and EtherCAT
  std::uint32_t sender = 0;
  std::span<const std::uint8_t> bytes;  // until the next frame
};

// Frames one behind the other in a fixed piece of memory: the newest take the place of the oldest.
class TrafficRing {
 public:
  explicit TrafficRing(std::size_t bytes) : memory_(bytes / alignment * alignment) {}

  // `frame.number` is given here. Two parts of its bytes, so that no caller needs to join them.
  void add(const TrafficFrame& frame, std::span<const std::uint8_t> head, std::span<const std::uint8_t> rest);

  std::uint64_t newest() const { return newest_; }  // number; 0: there is none
  std::uint64_t oldest() const { return oldest_; }

  // A place in the ring: of the next frame to be read.
  struct Cursor {
    std::uint64_t number = 0;
    std::size_t offset = 0;
  };
  Cursor begin() const { return {oldest_, first_}; }
  // Forgets everything; where the next frame will be.
  Cursor clear() {
    first_ = end_ = 0;
    oldest_ = newest_ + 1;
    return begin();
  }
  // The frame at the cursor, which goes on; nothing: there is none yet. A cursor whose frame has been overwritten goes
  // on with the oldest there is, as its number tells.
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
  static constexpr std::uint16_t wrap = 0xFFFF;  // length: go on at the beginning

  static std::size_t size_of(std::size_t length) {
    return sizeof(Header) + (length + alignment - 1) / alignment * alignment;
  }
  Header header_at(std::size_t offset) const;
  std::size_t behind(std::size_t offset) const;
  void forget_oldest();

  std::vector<std::uint8_t> memory_;
  std::size_t first_ = 0;  // of the oldest frame
  std::size_t end_ = 0;    // behind the newest
  std::uint64_t oldest_ = 1;
  std::uint64_t newest_ = 0;
};

// Records a bus from its making to its end. Nothing is allocated meanwhile.
class TrafficTap {
 public:
  virtual ~TrafficTap() = default;
  // Hands over what is being put together, as far as it is complete.
  virtual void flush() {}

  static std::unique_ptr<TrafficTap> on(NamedBus& bus, TrafficRing& ring);
  static std::unique_ptr<TrafficTap> on(NamedEthercatBus& bus, TrafficRing& ring);
  static std::unique_ptr<TrafficTap> on(NamedSerialBus& bus, TrafficRing& ring);
};

}  // namespace servodrome::line
