#include "links/serial/stream_link.hpp"

namespace servodrome::links {
namespace {

// Retry interval while the port's queue on the line is full.
constexpr auto full_line_wait = std::chrono::milliseconds(5);

}  // namespace

StreamLink::StreamLink(std::string name, const Open& open, SerialLine& line, boost::asio::io_context& io,
                       LineHost& host)
    : name_(std::move(name)), stream_(open(*this)), line_(line), host_(host), port_(line.attach(*this)), full_(io) {
  if (stream_->is_open()) on_open();
}

StreamLink::~StreamLink() { line_.detach(port_); }

void StreamLink::on_open() {
  counters_.clients = 1;
  read();
}

void StreamLink::on_close() { counters_.clients = 0; }

void StreamLink::read() {
  const std::size_t pending = line_.pending(port_);
  if (pending < most_pending) {
    stream_->read(most_pending - pending);
    return;
  }
  full_.expires_after(full_line_wait);
  full_.async_wait([this](boost::system::error_code code) {
    if (!code) read();
  });
}

void StreamLink::on_bytes(std::string_view bytes) {
  counters_.to_bus += bytes.size();
  const auto* const characters = reinterpret_cast<const std::uint8_t*>(bytes.data());
  line_.transmit(port_, std::span(characters, bytes.size()), host_.now());
  host_.wake();
  read();
}

void StreamLink::receive(std::uint8_t character, bool /*intact*/, Time /*at*/) {
  if (!stream_->is_open()) return;
  if (stream_->unwritten() >= most_waiting_bytes) {
    ++counters_.dropped;
    return;
  }
  ++counters_.from_bus;
  const char byte = static_cast<char>(character);
  stream_->write({&byte, 1});
}

}  // namespace servodrome::links
