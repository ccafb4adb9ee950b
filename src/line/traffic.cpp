#include "line/traffic.hpp"

#include <cstring>

#include "links/ethercat/log.hpp"
#include "links/serial/messages.hpp"

namespace servodrome::line {

TrafficRing::Header TrafficRing::header_at(std::size_t offset) const {
  Header header;
  std::memcpy(&header, &memory_[offset], sizeof header);
  return header;
}

// The offset behind the frame at `offset`. If there is no room for a header, the next frame is at the beginning.
std::size_t TrafficRing::behind(std::size_t offset) const {
  const std::size_t next = offset + size_of(header_at(offset).length);
  if (next + sizeof(Header) > memory_.size()) return 0;
  return next != end_ && header_at(next).length == wrap ? 0 : next;
}

void TrafficRing::forget_oldest() {
  first_ = behind(first_);
  ++oldest_;
}

void TrafficRing::add(const TrafficFrame& frame, std::span<const std::uint8_t> head,
                      std::span<const std::uint8_t> rest) {
  const std::size_t length = head.size() + rest.size();
  const std::size_t size = size_of(length);
  if (length >= wrap || size + sizeof(Header) > memory_.size()) return;
  if (end_ + size > memory_.size()) {
    // Remove the frames behind `end_` first: the wrap mark would hide them.
    while (oldest_ <= newest_ && first_ >= end_) forget_oldest();
    if (end_ + sizeof(Header) <= memory_.size()) {
      const Header mark{0, 0, wrap, {}, false};
      std::memcpy(&memory_[end_], &mark, sizeof mark);
    }
    end_ = 0;
    if (oldest_ > newest_) first_ = 0;
  }
  while (oldest_ <= newest_ && first_ >= end_ && first_ < end_ + size) forget_oldest();
  if (oldest_ > newest_) first_ = end_;
  const Header header{frame.at.count(), frame.sender, static_cast<std::uint16_t>(length), frame.kind,
                      frame.from_master};
  std::uint8_t* at = &memory_[end_];
  std::memcpy(at, &header, sizeof header);
  at += sizeof header;
  if (!head.empty()) std::memcpy(at, head.data(), head.size());
  if (!rest.empty()) std::memcpy(at + head.size(), rest.data(), rest.size());
  end_ += size;
  ++newest_;
}

std::optional<TrafficFrame> TrafficRing::next(Cursor& cursor) const {
  // Also for number == oldest_: the wrap mark that leads to this frame may be overwritten.
  if (cursor.number <= oldest_) cursor = begin();
  if (cursor.number > newest_) return std::nullopt;
  // A cursor that waited behind the newest frame may have to go on at the beginning.
  if (cursor.number != oldest_ &&
      (cursor.offset + sizeof(Header) > memory_.size() || header_at(cursor.offset).length == wrap)) {
    cursor.offset = 0;
  }
  const Header header = header_at(cursor.offset);
  TrafficFrame frame;
  frame.number = cursor.number;
  frame.at = Time(header.at);
  frame.kind = header.kind;
  frame.from_master = header.from_master;
  frame.sender = header.sender;
  frame.bytes = std::span(memory_).subspan(cursor.offset + sizeof(Header), header.length);
  cursor.offset += size_of(header.length);
  ++cursor.number;
  return frame;
}

namespace {

class CanTap final : public TrafficTap, private links::BusObserver {
 public:
  CanTap(links::CanBus& bus, TrafficRing& ring) : bus_(bus), ring_(ring) { bus_.add_observer(*this); }
  ~CanTap() override { bus_.remove_observer(*this); }
  CanTap(const CanTap&) = delete;
  CanTap& operator=(const CanTap&) = delete;

 private:
  void on_bus_event(const links::BusEvent& event) override {
    using Kind = links::BusEvent::Kind;
    TrafficFrame frame;
    frame.at = event.end;
    frame.sender = static_cast<std::uint32_t>(event.port);
    frame.kind = event.kind == Kind::frame     ? TrafficKind::can
                 : event.kind == Kind::dropped ? TrafficKind::can_dropped
                                               : TrafficKind::can_error;
    ring_.add(frame, {reinterpret_cast<const std::uint8_t*>(&event.frame), sizeof event.frame}, {});
  }

  links::CanBus& bus_;
  TrafficRing& ring_;
};

class EthercatTap final : public TrafficTap, private links::EthercatObserver {
 public:
  EthercatTap(links::EthercatBus& bus, TrafficRing& ring) : bus_(bus), ring_(ring) { bus_.add_observer(*this); }
  ~EthercatTap() override { bus_.remove_observer(*this); }
  EthercatTap(const EthercatTap&) = delete;
  EthercatTap& operator=(const EthercatTap&) = delete;

 private:
  void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                Direction direction, Time at) override {
    TrafficFrame frame;
    frame.at = at;
    frame.from_master = direction == Direction::in;
    frame.kind = frame.from_master ? TrafficKind::ethernet_out : TrafficKind::ethernet_in;
    std::span<const std::uint8_t> head;
    if (encapsulation == ethercat::Segment::Encapsulation::payload)
      head = links::EthercatLog::made_up_header(direction);
    ring_.add(frame, head, bytes);
  }

  links::EthercatBus& bus_;
  TrafficRing& ring_;
};

class SerialTap final : public TrafficTap {
 public:
  SerialTap(links::SerialLine& line, TrafficRing& ring)
      : messages_(line, [&ring](const links::SerialMessage& message) {
          TrafficFrame frame;
          frame.at = message.at;
          frame.from_master = message.side == links::SerialSender::master;
          frame.sender = static_cast<std::uint32_t>(message.port);
          frame.kind = message.is_tcp ? TrafficKind::modbus_tcp : TrafficKind::serial;
          ring.add(frame, {}, message.bytes);
        }) {}

 private:
  void flush() override { messages_.flush(); }

  links::SerialMessages messages_;
};

}  // namespace

std::unique_ptr<TrafficTap> TrafficTap::on(NamedBus& bus, TrafficRing& ring) {
  return std::make_unique<CanTap>(bus.bus, ring);
}
std::unique_ptr<TrafficTap> TrafficTap::on(NamedEthercatBus& bus, TrafficRing& ring) {
  return std::make_unique<EthercatTap>(bus.bus, ring);
}
std::unique_ptr<TrafficTap> TrafficTap::on(NamedSerialBus& bus, TrafficRing& ring) {
  return std::make_unique<SerialTap>(bus.line, ring);
}

}  // namespace servodrome::line
