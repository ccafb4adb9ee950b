#include "links/can/client.hpp"

#include "links/can/client_slcan.hpp"
#include "links/can/client_socketcand.hpp"
#include "links/can/link_name.hpp"
#include "links/can/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

struct OpenCanClient {
  const CanClientOptions& options;

  std::unique_ptr<CanClient> operator()(const SocketcandName& name) const {
    return std::make_unique<SocketcandClient>(name, options.connect_timeout);
  }
  std::unique_ptr<CanClient> operator()(const SlcanName& name) const {
    return std::make_unique<SlcanClient>(name, options);
  }
  std::unique_ptr<CanClient> operator()(const SocketcanName& name) const { return open_socketcan_client(name); }
  std::unique_ptr<CanClient> operator()(const MemName&) const { refuse_mem_client("CAN", can_schemes); }
};

}  // namespace

std::unique_ptr<CanClient> open_can_client(std::string_view link, const CanClientOptions& options) {
  return std::visit(OpenCanClient{options}, parse_can_link(link));
}

void MemoryCanClient::send(const canopen::Frame& frame) {
  if (!port_.send(frame, clock_.now())) {
    throw LinkError(
        std::make_error_code(std::errc::no_buffer_space),
        "CAN link \"mem:\": the bus takes no more frames; let virtual time pass, or check whether the port is bus-off");
  }
}

std::optional<canopen::Frame> MemoryCanClient::receive(Time timeout) {
  const Time deadline = clock_.now() + timeout;
  while (port_.waiting() == 0 && clock_.now() < deadline) clock_.step(deadline);
  const auto received = port_.receive();
  if (!received) return std::nullopt;
  return received->frame;
}

}  // namespace servodrome::links
