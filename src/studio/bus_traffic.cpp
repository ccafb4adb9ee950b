#include "studio/bus_traffic.hpp"

#include <array>
#include <cstring>

#include "canopen/frame.hpp"

namespace servodrome::studio {
namespace {

constexpr auto end_of_answer = std::chrono::milliseconds(50);  // pause that ends an answer

// Ethernet header put before an EtherCAT frame's content: broadcast, EtherType 88A4h (ETG.1000.4 clause 5.3.2). The
// client does not report the real source address. In returned frames bit 1 of its first byte is set, as the first slave
// does.
constexpr std::size_t source_address = 6;
constexpr std::array<std::uint8_t, 14> ethernet_header{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x00,
                                                       0x00, 0x00, 0x00, 0x00, 0x01, 0x88, 0xA4};

line::TrafficKind kind_of(const std::string& type, const std::string& link) {
  if (type == "can") return line::TrafficKind::can;
  if (type == "ethercat") return line::TrafficKind::ethernet_out;
  return link.find("tcp:") != std::string::npos ? line::TrafficKind::modbus_tcp : line::TrafficKind::serial;
}

}  // namespace

BusTraffic::BusTraffic(const std::string& type, const std::string& link, Clock::time_point start)
    : kind_(kind_of(type, link)), start_(start) {}

links::Heard BusTraffic::heard() {
  return [this](bool sent, std::span<const std::uint8_t> bytes) {
    if (wanted_.load(std::memory_order_relaxed) > 0) hear(sent, bytes);
  };
}

void BusTraffic::want(bool on) { wanted_ += on ? 1 : -1; }

void BusTraffic::hear(bool sent, std::span<const std::uint8_t> bytes) {
  const line::Time at = Clock::now() - start_;
  const std::lock_guard lock(mutex_);
  switch (kind_) {
    case line::TrafficKind::can: {
      canopen::Frame frame;
      std::memcpy(&frame, bytes.data(), sizeof frame);
      add(at, sent, sent ? 0U : 0x100U | (frame.id & 0x7FU), bytes, {});
      break;
    }
    case line::TrafficKind::ethernet_out: {
      auto header = ethernet_header;
      if (!sent) header[source_address] |= 0x02;
      add(at, sent, 0, header, bytes);
      break;
    }
    default:
      if (sent) {
        end_answer();
        add(at, true, 0, bytes, {});
        break;
      }
      if (answer_.empty()) answer_began_ = at;
      answer_went_on_ = at;
      answer_.insert(answer_.end(), bytes.begin(), bytes.end());
  }
}

void BusTraffic::add(line::Time at, bool sent, std::uint32_t sender, std::span<const std::uint8_t> head,
                     std::span<const std::uint8_t> rest) {
  line::TrafficFrame frame;
  frame.at = at;
  frame.kind = kind_;
  if (kind_ == line::TrafficKind::ethernet_out && !sent) frame.kind = line::TrafficKind::ethernet_in;
  frame.from_master = sent;
  frame.sender = sender;
  waiting_.add(frame, head, rest);
}

void BusTraffic::end_answer() {
  if (answer_.empty()) return;
  add(answer_began_, false, 0, answer_, {});
  answer_.clear();
}

void BusTraffic::fetch(line::TrafficRing& ring) {
  const std::lock_guard lock(mutex_);
  if (Clock::now() - start_ > answer_went_on_ + end_of_answer) end_answer();
  while (const auto frame = waiting_.next(cursor_)) ring.add(*frame, frame->bytes, {});
}

}  // namespace servodrome::studio
