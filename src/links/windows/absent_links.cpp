// Links that Windows does not have. The parsers of link names refuse them first, with the reason; these functions exist
// only for the linker.
#include "links/can/system_links.hpp"
#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"
#include "links/serial/system_links.hpp"
#include "links/system_schemes.hpp"

namespace servodrome::links {
namespace {

[[noreturn]] void refuse(const LinkScheme& scheme) {
  throw LinkError(std::make_error_code(std::errc::not_supported), std::string(absence_of(scheme.name)));
}

}  // namespace

std::unique_ptr<CanLink> open_socketcan_link(const SocketcanName& /*name*/, CanBus& /*bus*/,
                                             boost::asio::io_context& /*io*/, LineHost& /*host*/) {
  refuse(scheme::socketcan);
}

std::unique_ptr<CanClient> open_socketcan_client(const SocketcanName& /*name*/) { refuse(scheme::socketcan); }

std::unique_ptr<EthercatLink> open_raw_link(const RawName& /*name*/, EthercatBus& /*bus*/,
                                            boost::asio::io_context& /*io*/, DescriptorWatch& /*watch*/,
                                            LineHost& /*host*/) {
  refuse(scheme::raw);
}

std::unique_ptr<EthercatClient> open_raw_client(const RawName& /*name*/) { refuse(scheme::raw); }

int monitor_interface(const RawName& /*name*/, const std::function<bool()>& /*over*/,
                      const std::function<void(std::span<const std::uint8_t> frame)>& /*take*/) {
  refuse(scheme::raw);
}

std::unique_ptr<SerialLink> open_pty_link(const PtyName& /*name*/, SerialLine& /*line*/,
                                          boost::asio::io_context& /*io*/, LineHost& /*host*/) {
  refuse(scheme::pty);
}

}  // namespace servodrome::links
