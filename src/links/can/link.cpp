#include "links/can/link.hpp"

#include "links/can/slcan_link.hpp"
#include "links/can/socketcand_server.hpp"
#include "links/can/system_links.hpp"

namespace servodrome::links {
namespace {

struct OpenCanLink {
  CanBus& bus;
  boost::asio::io_context& io;
  LineHost& host;

  std::unique_ptr<CanLink> operator()(const SocketcandName& name) const {
    return std::make_unique<SocketcandServer>(name, bus, io, host);
  }
  std::unique_ptr<CanLink> operator()(const SlcanName& name) const {
    return std::make_unique<SlcanLink>(name, bus, io, host);
  }
  std::unique_ptr<CanLink> operator()(const SocketcanName& name) const {
    return open_socketcan_link(name, bus, io, host);
  }
  std::unique_ptr<CanLink> operator()(const MemName&) const { refuse_mem_link("CAN", can_schemes); }
};

}  // namespace

std::unique_ptr<CanLink> open_can_link(const CanLinkName& name, CanBus& bus, boost::asio::io_context& io,
                                       LineHost& host) {
  return std::visit(OpenCanLink{bus, io, host}, name);
}

}  // namespace servodrome::links
