#include "links/ethercat/link.hpp"

#include "links/ethercat/system_links.hpp"

namespace servodrome::links {
namespace {

struct OpenEthercatLink {
  EthercatBus& bus;
  boost::asio::io_context& io;
  DescriptorWatch& watch;
  LineHost& host;

  std::unique_ptr<EthercatLink> operator()(const RawName& name) const {
    return open_raw_link(name, bus, io, watch, host);
  }
  std::unique_ptr<EthercatLink> operator()(const EthercatUdpName& name) const {
    return open_udp_link(name, bus, io, host);
  }
  std::unique_ptr<EthercatLink> operator()(const MemName&) const { refuse_mem_link("EtherCAT", ethercat_schemes); }
};

}  // namespace

std::unique_ptr<EthercatLink> open_ethercat_link(const EthercatLinkName& name, EthercatBus& bus,
                                                 boost::asio::io_context& io, DescriptorWatch& watch, LineHost& host) {
  return std::visit(OpenEthercatLink{bus, io, watch, host}, name);
}

}  // namespace servodrome::links
