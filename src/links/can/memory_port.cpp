#include "links/can/memory_port.hpp"

#include <algorithm>

namespace servodrome::links {

MemoryPort::MemoryPort(CanBus& bus, std::size_t inbox_depth)
    : bus_(bus),
      port_(bus.attach(*this, std::max<std::size_t>(inbox_depth, 1))),
      inbox_(std::max<std::size_t>(inbox_depth, 1)) {}

MemoryPort::~MemoryPort() { bus_.detach(port_); }

std::optional<TimedFrame> MemoryPort::receive() {
  if (count_ == 0) return std::nullopt;
  const TimedFrame result = inbox_[first_];
  first_ = (first_ + 1) % inbox_.size();
  --count_;
  return result;
}

void MemoryPort::on_frame(const canopen::Frame& frame, Time at) {
  if (count_ == inbox_.size()) {
    ++dropped_;
    return;
  }
  inbox_[(first_ + count_) % inbox_.size()] = {frame, at};
  ++count_;
}

}  // namespace servodrome::links
