#include "links/can/slcan_link.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>

namespace servodrome::links {
namespace {

// Status byte of the F command (CANUSB manual).
constexpr std::uint8_t receive_queue_full = 0x01;
constexpr std::uint8_t transmit_queue_full = 0x02;
constexpr std::uint8_t error_warning = 0x04;
constexpr std::uint8_t data_overrun = 0x08;
constexpr std::uint8_t error_passive = 0x20;
constexpr std::uint8_t bus_error = 0x80;
constexpr std::uint16_t error_warning_limit = 96;

}  // namespace

SlcanLink::SlcanLink(const SlcanName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host)
    : name_(name),
      stream_(open_adapter_stream(name.path, io, *this)),
      bus_(bus),
      io_(io),
      host_(host),
      port_(bus.attach(*this, link_queue_depth)),
      adapter_(*this) {
  bus_.set_participation(port_, Participation::off);
  if (stream_->is_open()) on_open();
}

SlcanLink::~SlcanLink() {
  *alive_ = false;
  bus_.detach(port_);
}

void SlcanLink::on_open() {
  counters_.clients = 1;
  host_.wake();  // drives' frames now have a receiver, so the line sleeps less
  work();
}

void SlcanLink::on_close() {
  adapter_.reset();
  bus_.set_port_bit_rate(port_, 0);
  unread_.clear();
  reading_ = paused_ = lost_frames_ = false;
  counters_.clients = 0;
}

void SlcanLink::on_bytes(std::string_view bytes) {
  reading_ = false;
  unread_ = bytes;
  work();
}

void SlcanLink::work() {
  // Stops while the client does not read its answers (on_written() calls work() again) or the bus queue is full.
  std::size_t done = 0;
  while (done < unread_.size() && stream_->unwritten() + answers_.size() <= most_waiting_bytes && !paused_) {
    paused_ = bus_.queue_space(port_) == 0 && bus_.error_state(port_) == ErrorState::active;
    if (!paused_) adapter_.receive(unread_[done++], answers_);
  }
  unread_.erase(0, done);
  counters_.malformed = adapter_.refused_commands();
  write();
  if (!unread_.empty() || reading_ || !stream_->is_open()) return;
  reading_ = true;
  stream_->read(SerialStream::most_at_once);
}

void SlcanLink::resume() {
  if (!paused_) return;
  paused_ = false;
  boost::asio::post(io_, [this, alive = alive_] {
    if (*alive) work();
  });
}

void SlcanLink::write() {
  if (answers_.empty()) return;
  stream_->write(answers_);
  answers_.clear();
}

void SlcanLink::on_frame(const canopen::Frame& frame, Time at) {
  const std::string text = adapter_.frame_text(frame, at);
  if (text.empty()) return;
  if (stream_->unwritten() + answers_.size() + text.size() > most_waiting_bytes) {
    ++counters_.dropped;
    lost_frames_ = true;
    return;
  }
  ++counters_.from_bus;
  answers_ += text;
  write();
}

void SlcanLink::on_sent(const canopen::Frame& /*frame*/, std::uint32_t /*tag*/, Time /*at*/) {
  if (bus_.queue_space(port_) >= link_queue_depth / 2) resume();
  if (closing_) close();
}

void SlcanLink::on_error_state(ErrorState /*state*/, Time /*at*/) { resume(); }

void SlcanLink::open(bool listen_only) {
  closing_ = false;
  bus_.set_participation(port_, listen_only ? Participation::listen_only : Participation::normal);
  host_.wake();
}

// Frames that the client sent before it closed the channel are still sent, so that a program may send and exit at once.
void SlcanLink::close() {
  closing_ = bus_.pending(port_) > 0 && bus_.error_state(port_) == ErrorState::active;
  if (!closing_) bus_.set_participation(port_, Participation::off);
}

void SlcanLink::set_bit_rate(std::uint32_t bit_rate) { bus_.set_port_bit_rate(port_, bit_rate); }

bool SlcanLink::transmit(const canopen::Frame& frame) {
  if (!bus_.transmit(port_, frame, host_.now())) {
    ++counters_.refused;
    return false;
  }
  ++counters_.to_bus;
  host_.wake();
  return true;
}

std::uint8_t SlcanLink::status_flags() {
  const PortCounters& counters = bus_.counters(port_);
  unsigned flags = 0;
  if (std::exchange(lost_frames_, false)) flags |= receive_queue_full | data_overrun;
  if (bus_.queue_space(port_) == 0) flags |= transmit_queue_full;
  if (std::max(counters.transmit_errors, counters.receive_errors) >= error_warning_limit) flags |= error_warning;
  if (bus_.error_state(port_) != ErrorState::active) flags |= error_passive;
  if (bus_.error_state(port_) == ErrorState::bus_off) flags |= bus_error;
  return static_cast<std::uint8_t>(flags);
}

}  // namespace servodrome::links
