#include "links/adapter_port.hpp"

#include "links/serial/tty.hpp"

namespace servodrome::links {
namespace {

constexpr std::uint32_t bit_rate = 115'200;

}  // namespace

struct AdapterPort::System {
  bool is_lost = false;
};

AdapterPort::AdapterPort(const std::string& path, boost::asio::io_context& io)
    : system_(new System), stream_(serial_stream(io, open_tty(path, {.bit_rate = bit_rate}).release())) {}

AdapterPort::~AdapterPort() = default;

bool AdapterPort::has_client() const { return !system_->is_lost; }

// A read is always pending and takes the bytes as they come.
bool AdapterPort::has_input() const { return false; }

// Only the loss of the port itself, an adapter that is unplugged, ends the stream.
void AdapterPort::reset() { system_->is_lost = true; }

}  // namespace servodrome::links
