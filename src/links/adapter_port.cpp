#include "links/adapter_port.hpp"

#include <unistd.h>

#include "links/pty.hpp"

namespace servodrome::links {

struct AdapterPort::System {
  Pty pty;
};

AdapterPort::AdapterPort(const std::string& path, boost::asio::io_context& io)
    : system_(new System{Pty(path)}), stream_(io, ::dup(system_->pty.master())) {}

AdapterPort::~AdapterPort() = default;

bool AdapterPort::has_client() const { return system_->pty.has_client(); }
bool AdapterPort::has_input() const { return system_->pty.has_input(); }
void AdapterPort::reset() { system_->pty.reset(); }

}  // namespace servodrome::links
