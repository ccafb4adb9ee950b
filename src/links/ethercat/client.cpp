#include "links/ethercat/client.hpp"

#include <fmt/format.h>

#include "links/ethercat/client_udp.hpp"
#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

struct OpenEthercatClient {
  std::unique_ptr<EthercatClient> operator()(const RawName& name) const { return open_raw_client(name); }
  std::unique_ptr<EthercatClient> operator()(const EthercatUdpName& name) const {
    return std::make_unique<UdpEthercatClient>(name);
  }
  std::unique_ptr<EthercatClient> operator()(const MemName&) const { refuse_mem_client("EtherCAT", ethercat_schemes); }
};

}  // namespace

void check_content_size(std::size_t size, const std::string& link) {
  if (size <= most_ethercat_content) return;
  throw LinkError(
      std::make_error_code(std::errc::message_size),
      fmt::format("EtherCAT link \"{}\": {} bytes do not fit into a frame, which has at most {}; send several", link,
                  size, most_ethercat_content));
}

std::unique_ptr<EthercatClient> open_ethercat_client(std::string_view link) {
  return std::visit(OpenEthercatClient{}, parse_ethercat_link(link));
}

}  // namespace servodrome::links
