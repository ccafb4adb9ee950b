#include "links/can/slcan_link.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>

#include "links/file_descriptor.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

// A pty gives no event when a client opens it again, so it is polled at this interval.
constexpr auto client_poll_time = std::chrono::milliseconds(10);
constexpr auto input_poll_time = std::chrono::milliseconds(2);

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
      adapter_port_(name.path, io),
      bus_(bus),
      host_(host),
      port_(bus.attach(*this, link_queue_depth)),
      adapter_(*this),
      stream_(adapter_port_.stream()),
      client_poll_(io) {
  bus_.set_participation(port_, Participation::off);
  wait_for_client();
}

SlcanLink::~SlcanLink() {
  *alive_ = false;
  bus_.detach(port_);
}

// A client that has just opened the pty may already have written to it.
bool SlcanLink::settled() {
  if (counters_.clients == 0 && adapter_port_.has_client()) wait_for_client();
  return counters_.clients == 0 || !reading_ || !adapter_port_.has_input();
}

void SlcanLink::wait_for_client() {
  if (counters_.clients != 0) return;  // settled() has already found the client
  if (adapter_port_.has_client()) {
    counters_.clients = 1;
    host_.wake();  // drives' frames now have a receiver, so the line sleeps less
    read();
    if (stream_may_miss_input) watch_input();
    return;
  }
  client_poll_.expires_after(client_poll_time);
  client_poll_.async_wait([this, alive = alive_](error_code code) {
    if (*alive && !code) wait_for_client();
  });
}

// Polls the port periodically during a read, because Asio may miss its input (stream_may_miss_input). Does nothing
// during a write, which cancel() would end as well.
void SlcanLink::watch_input() {
  client_poll_.expires_after(input_poll_time);
  client_poll_.async_wait([this, alive = alive_](error_code code) {
    if (!*alive || code || counters_.clients == 0) return;
    if (reading_ && !is_writing_ && has_arrived(descriptor_of(stream_))) {
      error_code ignored;
      stream_.cancel(ignored);  // the read starts again and finds the bytes
    }
    watch_input();
  });
}

void SlcanLink::lose_client() {
  adapter_.reset();
  bus_.set_port_bit_rate(port_, 0);
  unread_ = {};
  waiting_.clear();
  paused_ = false;
  lost_frames_ = false;
  counters_.clients = 0;
  error_code ignored;
  stream_.cancel(ignored);
  adapter_port_.reset();
  wait_for_client();
}

void SlcanLink::read() {
  if (reading_) return;
  reading_ = true;
  stream_.async_read_some(boost::asio::buffer(input_), [this, alive = alive_](error_code code, std::size_t size) {
    if (!*alive) return;
    reading_ = false;
    if (code == boost::asio::error::operation_aborted) {
      if (counters_.clients > 0) read();
      return;
    }
    if (code) {
      lose_client();  // EIO: the other end is closed
      return;
    }
    unread_ = std::string_view(input_.data(), size);
    work();
  });
}

void SlcanLink::work() {
  // Stops while the client does not read its answers (the end of a write calls work() again) or the bus queue is full.
  while (!unread_.empty() && waiting_.size() <= most_waiting_bytes && !paused_) {
    paused_ = bus_.queue_space(port_) == 0 && bus_.error_state(port_) == ErrorState::active;
    if (paused_) break;
    adapter_.receive(unread_.front(), waiting_);
    unread_.remove_prefix(1);
  }
  counters_.malformed = adapter_.refused_commands();
  write();
  if (unread_.empty() && counters_.clients > 0) read();
}

void SlcanLink::resume() {
  if (!paused_) return;
  paused_ = false;
  boost::asio::post(stream_.get_executor(), [this, alive = alive_] {
    if (*alive) work();
  });
}

void SlcanLink::write() {
  if (is_writing_ || waiting_.empty()) return;
  is_writing_ = true;
  std::swap(writing_, waiting_);
  waiting_.clear();
  boost::asio::async_write(stream_, boost::asio::buffer(writing_),
                           [this, alive = alive_](error_code code, std::size_t) {
                             if (!*alive) return;
                             is_writing_ = false;
                             writing_.clear();
                             if (code) return;  // the pending read fails as well and handles it
                             write();
                             work();
                           });
}

void SlcanLink::on_frame(const canopen::Frame& frame, Time at) {
  const std::string text = adapter_.frame_text(frame, at);
  if (text.empty()) return;
  if (waiting_.size() + writing_.size() + text.size() > most_waiting_bytes) {
    ++counters_.dropped;
    lost_frames_ = true;
    return;
  }
  ++counters_.from_bus;
  waiting_ += text;
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
